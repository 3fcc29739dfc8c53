"""A planar probe in the exact engine."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.physics.contact_probe import AXES, PlanarPose
from models.contact_bodies import Bodies
from models.scenario import Scenario
from skill.arrays import Array
from systems.plant.exact_contact import STEPS
from systems.plant.exact_peg import advance_peg

PLANE = [3, 5, 1]
"""Numbers of `AXES` among the freedoms of `systems.plant.exact_peg.advance_peg`."""


class ExactProbe:
    """A `benchmarks.physics.contact_probe.PlanarProbe` of rigid round bodies.

    Args:
        scenario: geometry and contact of the bodies.
        time_step: s; None for that of the plant.
        mass: of the peg, kg.
        inertia: of the peg about its tip, kg m^2.
        damping: of x, z and tilt, N s/m, N s/m and N m s/rad.
    """

    scale = 1.0

    def __init__(
        self,
        scenario: Scenario,
        *,
        time_step: float | None = None,
        mass: float = 0.5,
        inertia: float = 1e-4,
        damping: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self.time_step = time_step or scenario.contact.time_step / STEPS
        self._bodies = Bodies.of(scenario)
        self._inertia = np.repeat([inertia, mass], 3)
        self._damping, self._wrench, self._free = np.zeros(6), np.zeros(6), np.zeros(6)
        self._damping[PLANE] = np.asarray(damping, dtype=float)
        self.hold()
        self.place(PlanarPose(0.0, 0.01, 0.0))

    def place(self, pose: PlanarPose) -> None:
        """See `PlanarProbe`."""
        half = 0.5 * pose.tilt
        self._q = np.array([math.cos(half), 0.0, math.sin(half), 0.0, pose.x, 0.0, pose.z])
        self._v, self._contact = np.zeros(6), np.zeros(6)

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """See `PlanarProbe`."""
        self._wrench[PLANE] = force_x, force_z, moment

    def hold(self, *names: str) -> None:
        """See `PlanarProbe`."""
        self._free[PLANE] = [float(name not in names) for name in AXES]

    def step(self, count: int = 1) -> None:
        """See `PlanarProbe`."""
        self._contact = advance_peg(
            self._bodies,
            self._inertia,
            self._damping,
            self._free,
            self._q,
            self._v,
            self._wrench,
            self.time_step,
            count,
        )[0]

    def pose(self) -> PlanarPose:
        """See `PlanarProbe`."""
        return PlanarPose(float(self._q[4]), float(self._q[6]), 2.0 * math.atan2(self._q[2], self._q[0]))

    def velocity(self) -> Array:
        """See `PlanarProbe`."""
        return self._v[PLANE]

    def contact_load(self) -> Array:
        """See `PlanarProbe`."""
        return self._contact[PLANE]
