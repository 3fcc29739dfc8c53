"""The canonical frame of a measured wrench: the peg frame turned about z until the lateral force points along +x.

It is the frame P turned about its z axis by the angle phi of the lateral force.

A lateral force below the floor has no reliable direction, yet it occurs under load: the two contacts of a wedged
peg can balance to a pure couple. The frame then follows a blend with the direction of the lateral moment,

    f + max(0, floor - |f|) e,    e = -z x m / sqrt(|m|^2 + (r floor)^2),

with f and m the lateral force and moment. The quarter turn makes e agree with f for a single contact at the mouth,
above the tip, where m points along z x f. The blend is continuous, turns with the wrench like f itself, and leaves
phi equal to atan2(fy, fx) above the floor. Where the moment is below its noise too, phi is arbitrary. That is
harmless: every component that phi turns is then small, and averages over arbitrary phi make the learnt lateral
actions vanish, as symmetry demands without a lateral wrench.
"""

from __future__ import annotations

import math

import numpy as np

from compiled import compiled
from skill.arrays import Array


@compiled
def canonical_angle(measured: Array, peg_radius: float, force_floor: float) -> float:
    """Returns the angle phi from P to the canonical frame about z, rad, in [-pi, pi].

    Args:
        measured: (6 or more,), force (N), then moment (N m).
        peg_radius: r, m.
        force_floor: the size below which a lateral force counts as noise, N.
    """
    fx, fy, mx, my = measured[0], measured[1], measured[3], measured[4]
    missing = max(0.0, force_floor - math.hypot(fx, fy))
    size = math.hypot(math.hypot(mx, my), peg_radius * force_floor)
    return math.atan2(fy - missing * mx / size, fx + missing * my / size)


@compiled
def canonical_angles(measured: Array, peg_radius: float, force_floor: float) -> Array:
    """Returns the angles (n,) of measurements (n, 6 or more); see `canonical_angle`."""
    found = np.empty(len(measured))
    for i in range(len(measured)):
        found[i] = canonical_angle(measured[i], peg_radius, force_floor)
    return found


@compiled
def turned(x: float, y: float, angle: float) -> tuple[float, float]:
    """Returns a vector turned by an angle, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return c * x - s * y, s * x + c * y


@compiled
def turned_rows(vectors: Array, angles: Array) -> Array:
    """Returns the first two components of vectors (n, 2 or more), turned by angles (n,), rad; shape (n, 2)."""
    found = np.empty((len(vectors), 2))
    for i in range(len(vectors)):
        found[i, 0], found[i, 1] = turned(vectors[i, 0], vectors[i, 1], angles[i])
    return found
