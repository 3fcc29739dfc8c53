"""A simulated peg with three planar freedoms, for measurements of contact against theory.

The peg slides along x and z and turns about y, at the centre of its tip, under prescribed loads; the bore is fixed.
One corner of the bore's polygon and one of the peg's lie in the plane of motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import HydroelasticContactRepresentation
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from models.scenario import Scenario
from skill.arrays import Array
from systems.plant.contact_plant import AddHydroelasticPlant, finish_contact_plant

AXES = ("x", "z", "tilt")
"""Names of the freedoms, in the order of loads (N, N, N m) and velocities (m/s, m/s, rad/s)."""

STAGE_MASS = 1e-3
"""Mass of each of the two slides between the bore and the peg, kg."""


@dataclass(frozen=True)
class PlanarPose:
    """Pose of the peg: the centre of its tip in H, and its tilt about y."""

    x: float  # in units of m
    z: float  # in units of m
    tilt: float  # in units of rad


class PlanarProbe(Protocol):
    """The interface of a probe in any engine; `ContactProbe` implements it with Drake.

    Attributes:
        time_step: of the simulation, s.
        scale: size of its bodies over that of the round ones, in the plane of motion.
    """

    time_step: float
    scale: float

    def place(self, pose: PlanarPose) -> None:
        """Puts the peg at a pose, at rest, and starts a new simulation."""

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """Sets the force on the tip's centre, N, and the moment about y at the tip's centre, N m."""

    def hold(self, *names: str) -> None:
        """Locks the named freedoms of `AXES` and frees the others."""

    def step(self, count: int = 1) -> None:
        """Takes ``count`` time steps."""

    def pose(self) -> PlanarPose:
        """The pose of the peg."""

    def velocity(self) -> Array:
        """The velocities (3,) of `AXES`, m/s, m/s and rad/s."""

    def contact_load(self) -> Array:
        """The contact force along x and z, N, and moment about y at the tip's centre, N m, of the last step: (3,)."""


class ContactProbe:
    """A peg in Drake that is placed, loaded and simulated step by step, without gravity.

    Args:
        scenario: geometry and contact of the bodies.
        mass: of the peg, kg.
        inertia: of the peg about its tip, kg m^2.
        damping: of x, z and tilt, N s/m, N s/m and N m s/rad.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        mass: float = 0.5,
        inertia: float = 1e-4,
        damping: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        builder = DiagramBuilder()
        plant, scene_graph = AddHydroelasticPlant(builder, scenario)
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        hole = plant.AddModelInstance("hole")
        unit = UnitInertia.SolidSphere(0.01)
        block = plant.AddRigidBody("block", hole, SpatialInertia(1.0, np.zeros(3), unit))
        plant.WeldFrames(plant.world_frame(), block.body_frame())
        instance = plant.AddModelInstance("peg")
        stages = [plant.world_body()]
        for name in ("stage_x", "stage_z"):
            stages.append(plant.AddRigidBody(name, instance, SpatialInertia(STAGE_MASS, np.zeros(3), unit)))
        spread = float(np.sqrt(2.5 * inertia / mass))
        own = SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(spread))
        stages.append(plant.AddRigidBody("peg", instance, own))
        drag = np.asarray(damping, dtype=float)
        for k, (name, axis) in enumerate(zip(AXES, ([1, 0, 0], [0, 0, 1], [0, 1, 0]), strict=True)):
            kind = RevoluteJoint if name == "tilt" else PrismaticJoint
            frames = stages[k].body_frame(), stages[k + 1].body_frame()
            joint = plant.AddJoint(kind(name, *frames, np.array(axis, dtype=float)))
            joint.set_default_damping(float(drag[k]))
        finish_contact_plant(plant, scene_graph, scenario, stages[3], block)
        self.plant = plant
        self.plant.set_stiction_tolerance(1e-6)  # m/s; a stuck contact creeps at up to this speed
        self.time_step = scenario.contact.time_step
        # Where two contacts of the wedge lie: between the corners of the polygons that stand for circles.
        self.scale = float(np.cos(np.pi / scenario.geometry.facets)) if scenario.geometry.is_round else 1.0
        self._simulator = Simulator(builder.Build())
        self._own = self.plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        self._steps = 0
        self._instance = instance
        self.load(0.0, 0.0, 0.0)

    def place(self, pose: PlanarPose) -> None:
        """Puts the peg at a pose, at rest, and starts a new simulation."""
        self._simulator.get_mutable_context().SetTime(0.0)
        self._steps = 0
        state = np.array([pose.x, pose.z, pose.tilt, 0.0, 0.0, 0.0])
        self.plant.SetPositionsAndVelocities(self._own, state)
        self._simulator.Initialize()

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """Sets the force on the tip's centre, N, and the moment about y at the tip's centre, N m."""
        port = self.plant.get_applied_generalized_force_input_port()
        port.FixValue(self._own, np.array([force_x, force_z, moment]))

    def hold(self, *names: str) -> None:
        """Locks the named freedoms of `AXES` and frees the others."""
        for name in AXES:
            joint = self.plant.GetJointByName(name)
            if name in names:
                joint.Lock(self._own)
            else:
                joint.Unlock(self._own)

    def step(self, count: int = 1) -> None:
        """Takes ``count`` time steps."""
        self._steps += count
        self._simulator.AdvanceTo(self._steps * self.time_step)

    def pose(self) -> PlanarPose:
        """The pose of the peg."""
        return PlanarPose(*(float(v) for v in self.plant.GetPositions(self._own)))

    def velocity(self) -> Array:
        """See `PlanarProbe`."""
        return np.array(self.plant.GetVelocities(self._own))

    def contact_load(self) -> Array:
        """The contact force along x and z, N, and moment about y at the tip's centre, N m, of the last step: (3,)."""
        return np.array(self.plant.get_generalized_contact_forces_output_port(self._instance).Eval(self._own))

    def touches(self) -> bool:
        """Whether the meshes overlap at the present pose."""
        query = self.plant.get_geometry_query_input_port().Eval(self._own)
        return bool(query.ComputeContactSurfaces(HydroelasticContactRepresentation.kPolygon))
