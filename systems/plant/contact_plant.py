"""Builds the hydroelastic plants of the virtual environment and of the rig: a compliant peg in a rigid bore."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Cylinder,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    RoleAssign,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context, DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

import models
from models.hardware import STEEL
from models.meshes import BrokenEdge, TriangleMesh, make_hole, make_peg
from models.scenario import FREE_FIXTURE, Geometry, Scenario
from skill.arrays import Array
from systems.plant.body_pose import BodyPose
from systems.plant.contact_forces import Contact, hydroelastic_forces, single_contacts
from systems.plant.rig_plant import stepper_axes

DIVERGENCE_FORCE = 1e5  # in units of N; a larger contact force means that the simulation has diverged
ALUMINIUM = 2700.0  # in units of kg/m^3
MOUNT_MASS = 0.05  # in units of kg, of each of the mount's two slides
PEG_COLOUR = np.array([0.93, 0.60, 0.22, 0.65])
BLOCK_COLOUR = np.array([0.62, 0.66, 0.70, 1.0])


@dataclass(frozen=True)
class ContactPlant:
    """A finalised plant with its scene graph, peg and block."""

    plant: MultibodyPlant
    scene_graph: SceneGraph
    peg: RigidBody
    block: RigidBody


@dataclass(frozen=True)
class HydroelasticRig(ContactPlant):
    """A finalised plant of the rig; one of `systems.rig.RigPlant`.

    Attributes:
        scenario: resolved.
    """

    scenario: Scenario

    @property
    def carriage_force(self) -> InputPort:
        """Force of the motor on the carriage (1,), N, positive upwards."""
        return self.plant.get_actuation_input_port(self.plant.GetModelInstanceByName("feed"))

    @property
    def gimbal_equilibrium(self) -> InputPort:
        """Equilibrium of the n steppers (2n,), in the order of `stepper_axes`: angles, rad, and then rates, rad/s."""
        return self.plant.get_desired_state_input_port(self.plant.GetModelInstanceByName("gimbal"))

    @property
    def carriage_state(self) -> OutputPort:
        """State of the carriage (2,): position, m, and velocity, m/s."""
        return self.plant.get_state_output_port(self.plant.GetModelInstanceByName("feed"))

    @property
    def gimbal_state(self) -> OutputPort:
        """State of the n axes of the block (2n,): their angles, rad, and then rates, rad/s."""
        return self.plant.get_state_output_port(self.plant.GetModelInstanceByName("gimbal"))

    @cached_property
    def reaction_forces(self) -> OutputPort:
        """List of SpatialForce; element `sensor` is the force of the mount on the peg, at the mount, in P."""
        return self.plant.get_reaction_forces_output_port()

    @cached_property
    def sensor(self) -> int:
        """Index of the sensor's weld joint in `reaction_forces`."""
        return int(self.plant.GetJointByName("sensor").index())

    @cached_property
    def _feed(self) -> PrismaticJoint:
        return self.plant.GetJointByName("feed")

    @property
    def weight(self) -> float:
        """Weight of the peg, N."""
        return float(self.peg.default_mass() * np.linalg.norm(self.plant.gravity_field().gravity_vector()))

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """See `PegCarrier`."""
        pivot, own = _pivot_pose(trial), self.plant.GetMyMutableContextFromRoot(context)
        self.plant.GetFrameByName("pivot").SetPoseInParentFrame(own, pivot)
        self.plant.GetFrameByName("mouth").SetPoseInParentFrame(own, pivot.inverse())
        scene = self.scene_graph.GetMyMutableContextFromRoot(context)
        source, inspector = self.plant.get_source_id(), self.scene_graph.model_inspector()
        for body in (self.peg, self.block):
            for geometry in self.plant.GetCollisionGeometriesForBody(body):
                properties = ProximityProperties(inspector.GetProximityProperties(geometry))
                properties.UpdateProperty("material", "coulomb_friction", _friction(trial))
                self.scene_graph.AssignRole(scene, source, geometry, properties, RoleAssign.kReplace)

    def set_start(self, context: Context, *, carriage: float, angles: Sequence[float]) -> None:
        """See `PegCarrier`."""
        own = self.plant.GetMyMutableContextFromRoot(context)
        self.plant.GetJointByName("feed").set_translation(own, carriage)
        for name, angle in zip(stepper_axes(self.scenario), angles, strict=True):
            self.plant.GetJointByName(name).set_angle(own, angle)

    def tip_height(self, context: Context) -> float:
        """See `PegCarrier`."""
        own = self.plant.GetMyContextFromRoot(context)
        return float(self._feed.get_translation(own)) - self.scenario.sensor.height

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """See `PegCarrier`."""
        own = self.plant.GetMyContextFromRoot(context)
        return self.block.EvalPoseInWorld(own).inverse() @ self.peg.EvalPoseInWorld(own)

    def contact_extent(self, context: Context) -> float:
        """See `PegCarrier`: the area of the contact surfaces, m^2."""
        results = self.plant.get_contact_results_output_port().Eval(self.plant.GetMyContextFromRoot(context))
        surfaces = range(results.num_hydroelastic_contacts())
        return float(sum(results.hydroelastic_contact_info(k).contact_surface().total_area() for k in surfaces))

    def contacts(self, context: Context) -> list[Contact]:
        """See `PegCarrier`."""
        own = self.plant.GetMyContextFromRoot(context)
        parts = hydroelastic_forces(
            self.plant, own, peg=self.peg, block=self.block, dissipation=self.scenario.contact.dissipation
        )
        X_WH, X_WP = self.block.EvalPoseInWorld(own), self.peg.EvalPoseInWorld(own)
        return single_contacts(parts, X_WH, X_WH.inverse() @ X_WP, chamfer=self.scenario.geometry.chamfer)


@dataclass(frozen=True)
class HydroelasticPeg(ContactPlant):
    """A finalised plant of the virtual environment; one of `systems.plant.exact_peg.PegPlant`.

    Attributes:
        pose: port of X_HP.
    """

    pose: OutputPort

    @property
    def index(self) -> BodyIndex:
        """Index of the peg in the forces on it."""
        return self.peg.index()

    @property
    def peg_forces(self) -> InputPort:
        """List of ExternallyAppliedSpatialForce."""
        return self.plant.get_applied_spatial_force_input_port()

    @property
    def peg_state(self) -> OutputPort:
        """Quaternion of R_HP, p_HP (m), angular velocity (rad/s) and velocity (m/s) of the tip in H, (13,)."""
        return self.plant.get_state_output_port(self.peg.model_instance())

    @property
    def contact_wrench(self) -> OutputPort:
        """Torque (N m) and force (N) of the contact on the peg, at its tip, in H, (6,)."""
        return self.plant.get_generalized_contact_forces_output_port(self.peg.model_instance())

    def set_start(self, context: Context, X_HP: RigidTransform) -> None:
        """Puts the peg at a pose, at rest; ``context`` is the root context."""
        self.plant.SetFreeBodyPose(self.plant.GetMyMutableContextFromRoot(context), self.peg, X_HP)

    def peg_pose(self, context: Context) -> RigidTransform:
        """Returns X_HP; ``context`` is the root context."""
        return self.peg.EvalPoseInWorld(self.plant.GetMyContextFromRoot(context))

    def contact_force(self, context: Context) -> tuple[Array, Array] | None:
        """Returns a point of the contact (m) and the contact force on the peg (N), in W, or None without contact.

        The point is the centroid of the contact surface; ``context`` is the root context.
        """
        own = self.plant.GetMyContextFromRoot(context)
        results = self.plant.get_contact_results_output_port().Eval(own)
        if results.num_hydroelastic_contacts() == 0:
            return None
        centroid = results.hydroelastic_contact_info(0).contact_surface().centroid()
        return np.asarray(centroid), np.asarray(self.contact_wrench.Eval(own)[3:])


def AddVirtualPlant(builder: DiagramBuilder, scenario: Scenario) -> HydroelasticPeg:
    """Adds the plant of the virtual environment: a free peg and a fixed block, without gravity.

    The peg has the coupling's virtual mass and inertia; its centre of mass is at the tip.
    """
    plant, scene_graph = AddHydroelasticPlant(builder, scenario)
    coupling = scenario.coupling
    radius = math.sqrt(2.5 * coupling.peg_inertia / coupling.peg_mass)  # a sphere with this inertia
    peg = plant.AddRigidBody(
        "peg",
        plant.AddModelInstance("peg"),
        SpatialInertia(coupling.peg_mass, np.zeros(3), UnitInertia.SolidSphere(radius)),
    )
    block = plant.AddRigidBody("block", plant.AddModelInstance("hole"), _block_inertia(scenario.geometry))
    plant.WeldFrames(plant.world_frame(), block.body_frame())
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    finish_contact_plant(plant, scene_graph, scenario, peg, block)
    sight = builder.AddNamedSystem("sight", BodyPose(peg.index()))
    builder.Connect(plant.get_body_poses_output_port(), sight.GetInputPort("body_poses"))
    return HydroelasticPeg(plant, scene_graph, peg, block, sight.GetOutputPort("pose"))


def AddRigPlant(builder: DiagramBuilder, scenario: Scenario) -> HydroelasticRig:
    """Adds the plant of the rig: peg and sensor on the feed's carriage, and the block on a gimbal with its steppers.

    Raises:
        ValueError: If the scenario is not resolved.
    """
    if scenario.rig.pivot_height is None:
        raise ValueError("scenario.rig.pivot_height is missing: the scenario is not resolved; use resolve_scenario")
    plant, scene_graph = AddHydroelasticPlant(builder, scenario)
    peg, block = _add_rig_bodies(plant, scenario)
    finish_contact_plant(plant, scene_graph, scenario, peg, block)
    centred = builder.AddNamedSystem("centred_mount", ConstantVectorSource(np.zeros(4)))
    mount = plant.get_desired_state_input_port(plant.GetModelInstanceByName("mount"))
    builder.Connect(centred.get_output_port(), mount)
    return HydroelasticRig(plant, scene_graph, peg, block, scenario)


class NominalBodies(NamedTuple):
    """Masses of the rig as its builder knows them, with the axes of the gimbal in the plane of the mouth.

    Attributes:
        mass: of carriage, mount and peg, which the feed moves, kg.
        peg_weight: N.
        turning_inertia: of gimbal, block and rotor about the axis of pitch, where it is largest, kg m^2.
    """

    mass: float
    peg_weight: float
    turning_inertia: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns those of a scenario, whatever its pivot."""
        plant = MultibodyPlant(scenario.contact.time_step)
        peg, _ = _add_rig_bodies(plant, replace(scenario, rig=replace(scenario.rig, pivot_height=0.0)))
        plant.Finalize()
        models = {plant.GetModelInstanceByName(name) for name in ("feed", "mount")}
        bodies = (plant.get_body(index) for model in models for index in plant.GetBodyIndices(model))
        axis = plant.GetJointByName("pitch").velocity_start()
        return cls(
            mass=float(sum(body.default_mass() for body in bodies)),
            peg_weight=float(peg.default_mass() * np.linalg.norm(plant.gravity_field().gravity_vector())),
            turning_inertia=float(plant.CalcMassMatrix(plant.CreateDefaultContext())[axis, axis]),
        )


def _add_rig_bodies(plant: MultibodyPlant, scenario: Scenario) -> tuple[RigidBody, RigidBody]:
    """Adds bodies, joints and drives of the rig to an empty plant; returns peg and block."""
    parser = Parser(plant)
    folder = Path(models.__file__).parent
    parser.package_map().AddPackageXml(str(folder / "package.xml"))
    parser.AddModelsFromUrl("package://haptic_skill_models/rig.sdf")
    feed, gimbal = plant.GetModelInstanceByName("feed"), plant.GetModelInstanceByName("gimbal")
    g = scenario.geometry

    peg = plant.AddRigidBody("peg", feed, _peg_inertia(g))
    carriage = plant.GetBodyByName("carriage", feed)
    sensor_frame = plant.AddFrame(
        FixedOffsetFrame("sensor_mount", peg.body_frame(), RigidTransform([0, 0, scenario.sensor.height]))
    )
    slide = _add_compliant_mount(plant, scenario, carriage)
    # The force/torque sensor measures the reaction force of this weld.
    plant.AddJoint(WeldJoint("sensor", slide.body_frame(), sensor_frame, RigidTransform()))

    pivot = _pivot_pose(scenario)
    above = plant.AddFrame(FixedOffsetFrame("pivot", plant.world_frame(), pivot))
    plant.WeldFrames(above, plant.GetFrameByName("base", gimbal))
    block = plant.AddRigidBody("block", gimbal, _block_inertia(g))
    mouth = plant.AddFrame(FixedOffsetFrame("mouth", plant.GetFrameByName("yaw_ring", gimbal), pivot.inverse()))
    if scenario.rig.clocking_stage:
        plant.AddJoint(RevoluteJoint("clocking", mouth, block.body_frame(), [0.0, 0.0, 1.0]))
    else:
        plant.WeldFrames(mouth, block.body_frame())

    _add_drives(plant, scenario)
    return peg, block


def _pivot_pose(scenario: Scenario) -> RigidTransform:
    return RigidTransform([0.0, 0.0, scenario.rig.pivot_height])


def _friction(scenario: Scenario) -> CoulombFriction:
    return CoulombFriction(scenario.contact.friction, scenario.contact.friction)


def _add_drives(plant: MultibodyPlant, scenario: Scenario) -> None:
    """Adds the actuators of the stepper axes and of the feed, and the friction of the carriage."""
    stepper = scenario.stepper
    for name in stepper_axes(scenario):
        axis = plant.AddJointActuator(name, plant.GetJointByName(name), stepper.holding_torque)
        axis.set_default_rotor_inertia(stepper.reflected_inertia)
        axis.set_default_gear_ratio(1.0)
        axis.set_controller_gains(PdControllerGains(p=stepper.stiffness, d=stepper.damping))
    joint = plant.GetJointByName("feed")
    joint.set_default_damping(scenario.rig.carriage_friction)
    screw = plant.AddJointActuator("feed", joint)
    screw.set_default_rotor_inertia(scenario.feed.rotor_inertia)
    screw.set_default_gear_ratio(scenario.feed.ratio)


def _add_compliant_mount(plant: MultibodyPlant, scenario: Scenario, carriage: RigidBody) -> RigidBody:
    """Adds two lateral slides under the carriage, held by implicit spring-dampers.

    Returns:
        The slide that carries the sensor.
    """
    instance = plant.AddModelInstance("mount")
    parent = carriage
    for name, axis in (("mount_x", [1.0, 0.0, 0.0]), ("mount_y", [0.0, 1.0, 0.0])):
        inertia = SpatialInertia(MOUNT_MASS, np.zeros(3), UnitInertia.SolidSphere(0.02))
        body = plant.AddRigidBody(name, instance, inertia)
        joint = plant.AddJoint(PrismaticJoint(name, parent.body_frame(), body.body_frame(), axis))
        spring = plant.AddJointActuator(name, joint)
        spring.set_controller_gains(PdControllerGains(p=scenario.rig.mount_stiffness, d=scenario.rig.mount_damping))
        parent = body
    return parent


def AddHydroelasticPlant(builder: DiagramBuilder, scenario: Scenario) -> tuple[MultibodyPlant, SceneGraph]:
    """Adds an empty plant with the scenario's contact model; returns it and its scene graph."""
    # The default model falls back to point contact, which replaces the bore by its convex hull.
    config = MultibodyPlantConfig(
        time_step=scenario.contact.time_step,
        contact_model="hydroelastic",
        discrete_contact_approximation=scenario.contact.approximation,
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    return plant, scene_graph


def _cylinder_inertia(density: float, radius: float, bottom: float, top: float) -> SpatialInertia:
    """Returns the spatial inertia of a solid cylinder along z, from ``bottom`` to ``top``, about the body's origin."""
    length = top - bottom
    mass = density * math.pi * radius**2 * length
    centre = np.array([0.0, 0.0, 0.5 * (bottom + top)])
    central = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidCylinder(radius, length, [0, 0, 1]))
    return central.Shift(-centre)


def _peg_inertia(g: Geometry) -> SpatialInertia:
    """Returns the spatial inertia of the peg: the mass of its prisms, turning like a cylinder of the same radius.

    The rig turns the hole and not the peg, so that only its mass and its centre matter.
    """
    mass = STEEL * g.assembly.volume
    cylinder = _cylinder_inertia(STEEL, g.peg_radius, 0.0, g.peg_length)
    return SpatialInertia(mass, cylinder.get_com(), cylinder.get_unit_inertia())


def _block_inertia(g: Geometry) -> SpatialInertia:
    """Returns the spatial inertia of the block; the bore is not subtracted."""
    return _cylinder_inertia(ALUMINIUM, g.block_radius, -g.hole_depth - g.floor, 0.0)


def finish_contact_plant(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    scenario: Scenario,
    peg: RigidBody,
    block: RigidBody,
) -> None:
    """Adds the collision and visual shapes of peg and block, and finalises the plant.

    Args:
        plant: Plant without the shapes.
        scene_graph: Scene graph of the plant.
        scenario: Geometry and contact of the bodies.
        peg: Body of the peg; its origin is the centre of the tip.
        block: Body of the block; its frame is H.
    """
    g, contact = scenario.geometry, scenario.contact
    friction = _friction(scenario)
    X_PC, shape = peg_shape(g)
    plant.RegisterVisualGeometry(peg, X_PC, shape, "peg_picture", PEG_COLOUR)
    plant.RegisterVisualGeometry(block, RigidTransform(), block_picture(g), "block_picture", BLOCK_COLOUR)
    if g.mates:  # only the exact engine, which has its own contact, takes several
        plant.Finalize()
        return

    rigid = ProximityProperties()
    AddRigidHydroelasticProperties(rigid)
    AddContactMaterial(friction=friction, properties=rigid)
    # In the other fixtures the peg cannot leave the hole's axis.
    bore = make_hole(
        section=g.assembly.fits[0].hole,
        depth=g.hole_depth,
        chamfer=g.chamfer,
        facets=g.facets,
        block_radius=g.block_radius,
        floor=g.floor,
        edge=BrokenEdge.of(radius=g.hole_radius, clearance=g.clearance, chamfer=g.chamfer),
        inside=scenario.fixture != FREE_FIXTURE,
    )
    plant.RegisterCollisionGeometry(block, RigidTransform(), _in_memory(bore.to_obj(), ".obj"), "bore", rigid)

    compliant = ProximityProperties()
    # Drake divides a cylinder into ceil(2 pi r / hint) facets; the factor prevents rounding up to one facet more.
    hint = 2.0 * math.pi * g.peg_radius / g.facets * (1.0 + 1e-6)
    AddCompliantHydroelasticProperties(resolution_hint=hint, hydroelastic_modulus=contact.modulus, properties=compliant)
    AddContactMaterial(dissipation=contact.dissipation, friction=friction, properties=compliant)
    solid = shape
    if not g.is_round:
        solid = _in_memory(make_peg(g.assembly.fits[0].peg, g.peg_length, g.facets).to_vtk(), ".vtk")
    plant.RegisterCollisionGeometry(peg, X_PC, solid, "peg", compliant)

    plant.Finalize()


def peg_shape(g: Geometry, scale: float = 1.0) -> tuple[RigidTransform, Shape]:
    """Returns the shape of the peg for pictures, and its pose in P; ``scale`` multiplies its sizes about its centre."""
    middle = 0.5 * g.peg_length
    if g.is_round:
        return RigidTransform([0.0, 0.0, middle]), Cylinder(scale * g.peg_radius, scale * g.peg_length)
    mesh = g.assembly.peg_mesh(g.facets)
    scaled = TriangleMesh(scale * mesh.vertices, mesh.triangles)
    return RigidTransform([0.0, 0.0, (1.0 - scale) * middle]), _in_memory(scaled.to_faceted_obj(), ".obj")


def block_picture(g: Geometry) -> Mesh:
    """Returns the block for pictures, cut open, in H."""
    cutaway = g.assembly.block_mesh(g.facets, block_radius=g.block_radius, floor=g.floor)
    return _in_memory(cutaway.to_obj(), ".obj")


def _in_memory(text: str, extension: str) -> Mesh:
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(text, extension, f"body{extension}")))
