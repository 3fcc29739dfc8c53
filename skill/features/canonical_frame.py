"""The canonical frame of a measured wrench: the peg frame turned about z until the lateral force points along +x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skill.arrays import Array


@dataclass(frozen=True)
class CanonicalFrame:
    """The frame P turned about its z axis by the angle phi of the lateral force.

    A lateral force below the floor has no reliable direction, yet it occurs under load: the two contacts of a wedged
    peg can balance to a pure couple. The frame then follows a blend with the direction of the lateral moment,

        f + max(0, floor - |f|) e,    e = -z x m / sqrt(|m|^2 + (r floor)^2),

    with f and m the lateral force and moment. The quarter turn makes e agree with f for a single contact at the mouth,
    above the tip, where m points along z x f. The blend is continuous, turns with the wrench like f itself, and leaves
    phi equal to atan2(fy, fx) above the floor. Where the moment is below its noise too, phi is arbitrary. That is
    harmless: every component that phi turns is then small, and averages over arbitrary phi make the learnt lateral
    actions vanish, as symmetry demands without a lateral wrench.

    Attributes:
        peg_radius: r, m.
        force_floor: N; the size below which a lateral force counts as noise.
    """

    peg_radius: float
    force_floor: float

    def angle(self, measured: Array) -> Array:
        """Angle phi from P to the canonical frame about z, rad, in [-pi, pi], (n,), of measurements (n, 7)."""
        fx, fy, _, mx, my, _, _ = measured.T
        missing = np.maximum(0.0, self.force_floor - np.hypot(fx, fy))
        size = np.hypot(np.hypot(mx, my), self.peg_radius * self.force_floor)
        x = fx + missing * my / size
        y = fy - missing * mx / size
        return np.asarray(np.arctan2(y, x), dtype=np.float64)

    def to_frame(self, measured: Array) -> Array:
        """Measurements (n, 7), expressed in P, with force and moment expressed in the canonical frame."""
        phi = self.angle(measured)
        turned = measured.copy()
        turned[:, 0:2] = turn(measured, -phi)
        turned[:, 3:5] = turn(measured[:, 3:], -phi)
        return turned


def turn(vectors: Array, angle: Array) -> Array:
    """The first two components of vectors (n, 2 or more), turned by angles (n,), rad; shape (n, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[:, 0], vectors[:, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=1)
