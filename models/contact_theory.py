"""Closed-form laws of a rigid peg in a rigid hole, in the plane of the tilt.

Sources: D. E. Whitney, "Quasi-static assembly of compliantly supported rigid parts", J. Dyn. Syst. Meas. Control 104
(1982), for the jamming diagram, wedging and the two-point force balance, all for small tilts; the exact forms are
plane trigonometry. d = 2r and D = 2R are the diameters, c = (D - d)/D the clearance ratio, l the vertical depth of
the tip's centre below the mouth, i.e. below the inner edge of a chamfer. SI units.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from models.arrays import Array


def two_point_depth(tilt: ArrayLike, *, peg_radius: float, hole_radius: float) -> Array:
    """Depth h of the tip's centre at which two-point contact begins: (D - r (cos + 1/cos)) / tan, exact.

    Args:
        tilt: rad, positive.
        peg_radius: r, m.
        hole_radius: R, m.
    """
    t = np.asarray(tilt, dtype=np.float64)
    return np.asarray((2.0 * hole_radius - peg_radius * (np.cos(t) + 1.0 / np.cos(t))) / np.tan(t))


def two_point_tilt(depth: float, *, peg_radius: float, hole_radius: float) -> float:
    """Tilt, rad, at which two-point contact begins at a depth, m: the inverse of `two_point_depth`, by bisection."""
    low, high = 1e-9, largest_entry_tilt(peg_radius=peg_radius, hole_radius=hole_radius)
    for _ in range(100):
        middle = 0.5 * (low + high)
        deeper = float(two_point_depth(middle, peg_radius=peg_radius, hole_radius=hole_radius)) > depth
        low, high = (middle, high) if deeper else (low, middle)
    return 0.5 * (low + high)


def largest_entry_tilt(*, peg_radius: float, hole_radius: float) -> float:
    """Largest tilt, rad, at which the peg's tip passes the mouth: cos(theta) = d / D."""
    return math.acos(peg_radius / hole_radius)


def slenderness(depth: ArrayLike, *, peg_radius: float, friction: float) -> Any:
    """Whitney's lambda = l / (2 r mu)."""
    return np.asarray(depth, dtype=np.float64) / (2.0 * peg_radius * friction)


def jamming_load(force: ArrayLike, moment: ArrayLike, *, slenderness: float, friction: float) -> Array:
    """How far out in the jamming diagram a load lies: below 1 it slides, above 1 it jams, 1 on the edges.

    Args:
        force: F_x / F_z, lateral over axial force at the tip.
        moment: M / (r F_z), about the tip.
        slenderness: lambda.
        friction: mu.
    """
    x, m = np.asarray(force, dtype=np.float64), np.asarray(moment, dtype=np.float64)
    two_point = np.abs(m + friction * (1.0 + slenderness) * x) / slenderness
    return np.asarray(np.maximum(two_point, friction * np.abs(x)))


def jamming_vertices(*, slenderness: float, friction: float) -> Array:
    """The parallelogram's corners (4, 2): F_x / F_z and M / (r F_z)."""
    a, b = (1.0 / friction, -1.0), (-1.0 / friction, 2.0 * slenderness + 1.0)
    return np.array([a, b, (-a[0], -a[1]), (-b[0], -b[1])])


def two_point_axial_force(
    lateral: ArrayLike, moment: ArrayLike, *, depth: ArrayLike, peg_radius: float, friction: float
) -> Array:
    """F_z, N, that just slides a peg in two-point contact: 2 mu M / l + mu (1 + mu d / l) F_x.

    Args:
        lateral: F_x, N.
        moment: M about the tip, N m, of the sense in which it presses both contacts.
        depth: l, m.
        peg_radius: r, m.
        friction: mu.
    """
    F, M, length = (np.asarray(v, dtype=np.float64) for v in (lateral, moment, depth))
    return np.asarray(2.0 * friction * M / length + friction * (1.0 + 2.0 * friction * peg_radius / length) * F)


def two_point_push_moment(
    force: float, tilt: float, *, peg_radius: float, hole_radius: float, friction: float
) -> float:
    """Moment of the contacts about the tip, N m, on a peg whose held tilt is pushed into two-point contact by F_z.

    With N at the tip, horizontal, and N' at the mouth, square to the peg, both slipping upwards,

        N = N' (cos - mu sin),   F_z = mu N + N' (sin + mu cos):

    the least squeeze that carries the push. Where the tilt is below the friction angle the peg, which is held, is a
    wedge that locks itself: friction at rest may be anything less, and the moment more.

    Args:
        force: F_z, N.
        tilt: rad, positive about y.
        peg_radius: r, m.
        hole_radius: R, m.
        friction: mu.
    """
    c, s, mu = math.cos(tilt), math.sin(tilt), friction
    h = float(two_point_depth(tilt, peg_radius=peg_radius, hole_radius=hole_radius))
    mouth = force / (mu * (c - mu * s) + s + mu * c)
    tip = mouth * (c - mu * s)
    at_tip = peg_radius * (s + mu * c) * tip
    return at_tip - (h * (c - mu * s) + (2.0 * hole_radius - peg_radius * c) * (s + mu * c)) * mouth


def wedging_tilt(*, peg_radius: float, hole_radius: float, friction: float) -> float:
    """Whitney's smallest tilt, rad, of two-point contact that can wedge: c / mu."""
    return (hole_radius - peg_radius) / hole_radius / friction


def exact_wedging_tilt(*, peg_radius: float, hole_radius: float, friction: float) -> float:
    """Smallest tilt, rad, at which the line between the contacts lies in both friction cones; NaN if none does.

    The contacts are D apart and the tip's lies h - r sin(theta) below the mouth's. The normal at the tip is
    horizontal, the one at the mouth is square to the peg and leans away from the line by theta, so the angle
    atan((h - r sin theta) / D) + theta has to fit into the cone. Whitney's c / mu leaves out the last theta.
    """
    tilts = np.linspace(1e-4, largest_entry_tilt(peg_radius=peg_radius, hole_radius=hole_radius), 200_001)
    h = two_point_depth(tilts, peg_radius=peg_radius, hole_radius=hole_radius)
    line = np.arctan2(h - peg_radius * np.sin(tilts), 2.0 * hole_radius)
    inside = line + tilts <= math.atan(friction)
    return float(tilts[inside.argmax()]) if inside.any() else float("nan")
