"""A planar probe in MuJoCo, with the bodies of the rig."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.physics.contact_probe import AXES, PlanarPose
from models.scenario import Scenario
from skill.arrays import Array
from systems.plant.mujoco_model import MujocoContact, bore, document, peg


class MujocoProbe:
    """A `benchmarks.physics.contact_probe.PlanarProbe` in MuJoCo; the middle of a box lies in the plane of motion.

    Args:
        scenario: geometry of the bodies and friction.
        contact: parameters of the contact.
        mass: of the peg, kg.
        inertia: of the peg about its tip, kg m^2.
        damping: of x, z and tilt, N s/m, N s/m and N m s/rad.
    """

    scale = 1.0

    def __init__(
        self,
        scenario: Scenario,
        contact: MujocoContact,
        *,
        mass: float = 0.5,
        inertia: float = 1e-4,
        damping: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self.time_step = contact.time_step
        g = scenario.geometry
        kinds = ('type="slide" axis="1 0 0"', 'type="slide" axis="0 0 1"', 'type="hinge" axis="0 1 0"')
        drag = np.asarray(damping, dtype=float)
        joints = "".join(
            f'<joint name="{name}" {kind} damping="{d}"/>' for name, kind, d in zip(AXES, kinds, drag, strict=True)
        )
        own = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
        bodies = f"{bore(g, contact.boxes)}<body>{joints}{own}{peg(g)}</body>"
        self.model = mujoco.MjModel.from_xml_string(document(contact, scenario.contact.friction, 0.0, bodies))
        self.data = mujoco.MjData(self.model)
        self._damping = copy.deepcopy(self.model.dof_damping)

    def place(self, pose: PlanarPose) -> None:
        """See `PlanarProbe`."""
        load = self.data.qfrc_applied.copy()
        mujoco.mj_resetData(self.model, self.data)
        self.data.qfrc_applied[:] = load
        self.data.qpos[:] = [pose.x, pose.z, pose.tilt]

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """See `PlanarProbe`."""
        self.data.qfrc_applied[:] = [force_x, force_z, moment]

    def hold(self, *names: str) -> None:
        """Locks the named freedoms of `AXES` by a very large inertia and damping, and frees the others."""
        held = np.array([name in names for name in AXES])
        self.model.dof_armature[:] = np.where(held, 1e6, 0.0)
        self.model.dof_damping[:] = np.where(held, 1e9, self._damping)
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def step(self, count: int = 1) -> None:
        """See `PlanarProbe`."""
        mujoco.mj_step(self.model, self.data, nstep=count)

    def pose(self) -> PlanarPose:
        """See `PlanarProbe`."""
        return PlanarPose(*(float(v) for v in self.data.qpos))

    def velocity(self) -> Array:
        """See `PlanarProbe`."""
        return np.array(self.data.qvel)

    def contact_load(self) -> Array:
        """See `PlanarProbe`."""
        return np.array(self.data.qfrc_constraint)
