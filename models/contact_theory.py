"""Closed-form contact laws of a rigid peg in a rigid hole, in the plane of the tilt.

The jamming diagram, wedging and the two-point force balance are from D. E. Whitney, "Quasi-static assembly of
compliantly supported rigid parts", J. Dyn. Syst. Meas. Control 104 (1982), and hold for small tilts. The exact forms
are plane trigonometry.

Symbols: d = 2r and D = 2R are the diameters, c = (D - d)/D is the clearance ratio, and l is the vertical depth of the
tip's centre below the mouth, that is, below the inner edge of the chamfer. All quantities are in SI units.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from models import Array


def two_point_depth(tilt: ArrayLike, *, peg_radius: float, hole_radius: float) -> Array:
    """Returns the depth h (m) of the tip's centre at which two-point contact begins.

    The exact form is h = (D - r (cos(theta) + 1/cos(theta))) / tan(theta).

    Args:
        tilt: Tilt theta, rad, positive.
        peg_radius: Radius r, m.
        hole_radius: Radius R, m.
    """
    t = np.asarray(tilt, dtype=np.float64)
    return np.asarray((2.0 * hole_radius - peg_radius * (np.cos(t) + 1.0 / np.cos(t))) / np.tan(t))


def two_point_tilt(depth: float, *, peg_radius: float, hole_radius: float) -> float:
    """Returns the tilt (rad) at which two-point contact begins at a depth (m).

    This is the inverse of `two_point_depth`, found by bisection.
    """
    low, high = 1e-9, largest_entry_tilt(peg_radius=peg_radius, hole_radius=hole_radius)
    for _ in range(100):
        middle = 0.5 * (low + high)
        deeper = float(two_point_depth(middle, peg_radius=peg_radius, hole_radius=hole_radius)) > depth
        low, high = (middle, high) if deeper else (low, middle)
    return 0.5 * (low + high)


def largest_entry_tilt(*, peg_radius: float, hole_radius: float) -> float:
    """Returns the largest tilt (rad) at which the peg's tip passes the mouth: cos(theta) = d / D."""
    return math.acos(peg_radius / hole_radius)


def slenderness(depth: ArrayLike, *, peg_radius: float, friction: float) -> Any:
    """Returns Whitney's slenderness lambda = l / (2 r mu) for a depth l (m)."""
    return np.asarray(depth, dtype=np.float64) / (2.0 * peg_radius * friction)


def jamming_load(force: ArrayLike, moment: ArrayLike, *, slenderness: float, friction: float) -> Array:
    """Returns the position of a load in the jamming diagram: below 1 the peg slides, above 1 it jams.

    The value is 1 on the edges of the diagram.

    Args:
        force: Lateral over axial force at the tip, F_x / F_z.
        moment: Moment about the tip, M / (r F_z).
        slenderness: Whitney's lambda.
        friction: Coefficient mu.
    """
    x, m = np.asarray(force, dtype=np.float64), np.asarray(moment, dtype=np.float64)
    two_point = np.abs(m + friction * (1.0 + slenderness) * x) / slenderness
    return np.asarray(np.maximum(two_point, friction * np.abs(x)))


def two_point_axial_force(
    lateral: ArrayLike, moment: ArrayLike, *, depth: ArrayLike, peg_radius: float, friction: float
) -> Array:
    """Returns the minimum axial force F_z (N) that slides a peg in two-point contact.

    F_z = 2 mu M / l + mu (1 + mu d / l) F_x.

    Args:
        lateral: Lateral force F_x, N.
        moment: Moment M about the tip, N m; positive if it presses on both contacts.
        depth: Depth l, m.
        peg_radius: Radius r, m.
        friction: Coefficient mu.
    """
    F, M, length = (np.asarray(v, dtype=np.float64) for v in (lateral, moment, depth))
    return np.asarray(2.0 * friction * M / length + friction * (1.0 + 2.0 * friction * peg_radius / length) * F)


def wedging_tilt(*, peg_radius: float, hole_radius: float, friction: float) -> float:
    """Returns Whitney's smallest tilt (rad) of two-point contact that can wedge: c / mu."""
    return (hole_radius - peg_radius) / hole_radius / friction


def exact_wedging_tilt(*, peg_radius: float, hole_radius: float, friction: float) -> float:
    """Returns the smallest tilt (rad) at which the line between the contacts lies in both friction cones.

    Returns NaN if there is no such tilt. The contacts are D apart, and the contact at the tip is h - r sin(theta) below
    the one at the mouth. The normal at the tip is horizontal. The normal at the mouth is normal to the peg, which adds
    theta to its angle with the line. The condition is atan((h - r sin(theta)) / D) + theta <= atan(mu). Whitney's
    c / mu leaves out the second theta.
    """
    tilts = np.linspace(1e-4, largest_entry_tilt(peg_radius=peg_radius, hole_radius=hole_radius), 200_001)
    h = two_point_depth(tilts, peg_radius=peg_radius, hole_radius=hole_radius)
    line = np.arctan2(h - peg_radius * np.sin(tilts), 2.0 * hole_radius)
    inside = line + tilts <= math.atan(friction)
    return float(tilts[inside.argmax()]) if inside.any() else float("nan")
