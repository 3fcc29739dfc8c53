"""A peg with three planar freedoms and nothing else, to measure contact against theory.

The peg slides along x and z and turns about y, all at the centre of its tip, under prescribed loads; the bore is
fixed. The bore's polygon is turned so that a corner of it, and one of the peg's, lies in the plane of motion.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import HydroelasticContactRepresentation
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from models.scenario import Scenario
from systems.plant.contact_plant import add_hydroelastic_plant, finish_contact_plant

AXES = ("x", "z", "tilt")
"""Of the probe's loads and velocities: N, N, N m and m/s, m/s, rad/s."""

STAGE_MASS = 1e-3
"""kg, of each of the two slides that the peg's mass does not ride on."""


@dataclass(frozen=True)
class PlanarPose:
    """Of the peg: the centre of its tip in H, and its tilt about y."""

    x: float  # in units of m
    z: float  # in units of m
    tilt: float  # in units of rad


class ContactProbe:
    """A simulated peg that is moved or loaded by hand, one time step after another.

    Args:
        scenario: geometry and contact of the bodies. ``geometry.hole_radius`` is that of the true bore: see
            ``matched``.
        matched: whether the bore's polygon has its corners on the true circle, like the peg's, as `make_bore` has
            them, so that both shrink by the same factor cos(pi/n); otherwise its sides lie on it.
        mass: kg, of the peg; gravity is off.
        inertia: kg m^2, about the tip.
        damping: N s/m, N s/m and N m s/rad on x, z and tilt.
        stiction_tolerance: m/s, at which friction is fully mobilised: a stuck contact creeps at up to this speed.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        matched: bool = True,
        mass: float = 0.5,
        inertia: float = 1e-4,
        damping: ArrayLike = (0.0, 0.0, 0.0),
        stiction_tolerance: float = 1e-6,
    ) -> None:
        scenario = copy.deepcopy(scenario)
        if not matched:
            scenario.geometry.hole_radius /= np.cos(np.pi / scenario.geometry.facets)
        builder = DiagramBuilder()
        plant, scene_graph = add_hydroelastic_plant(builder, scenario)
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
        contact = finish_contact_plant(plant, scene_graph, scenario, stages[3], block)
        self.plant: MultibodyPlant = contact.plant
        self.plant.set_stiction_tolerance(stiction_tolerance)
        self.time_step = scenario.contact.time_step
        self.facets = scenario.geometry.facets
        self._simulator = Simulator(builder.Build())
        self._own = self.plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        self._steps = 0
        self._instance = instance
        self.load(0.0, 0.0, 0.0)

    def place(self, pose: PlanarPose) -> None:
        """Puts the peg there, at rest, and begins a new run."""
        self._simulator.get_mutable_context().SetTime(0.0)
        self._steps = 0
        state = np.array([pose.x, pose.z, pose.tilt, 0.0, 0.0, 0.0])
        self.plant.SetPositionsAndVelocities(self._own, state)
        self._simulator.Initialize()

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """Force on the tip's centre, N, and moment about it and y, N m, from now on."""
        port = self.plant.get_applied_generalized_force_input_port()
        port.FixValue(self._own, np.array([force_x, force_z, moment]))

    def hold(self, *names: str) -> None:
        """Locks these of `AXES` and frees the others."""
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
        """Where the peg is."""
        return PlanarPose(*(float(v) for v in self.plant.GetPositions(self._own)))

    def velocity(self) -> NDArray[np.float64]:
        """(3,) along `AXES`."""
        return np.array(self.plant.GetVelocities(self._own))

    def contact_load(self) -> NDArray[np.float64]:
        """(3,) force x, z and moment y of contact about the tip's centre, as in the last step."""
        return np.array(self.plant.get_generalized_contact_forces_output_port(self._instance).Eval(self._own))

    def touches(self) -> bool:
        """Whether the meshes overlap at this pose, from geometry alone."""
        query = self.plant.get_geometry_query_input_port().Eval(self._own)
        return bool(query.ComputeContactSurfaces(HydroelasticContactRepresentation.kPolygon))
