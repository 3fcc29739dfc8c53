"""How far the simulated bodies overlap: what a compliant contact model leaves of "solid"."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from models.contact_geometry import PegInHole
from models.scenario import Geometry

MIN_UPRIGHT = math.cos(math.radians(44.9))  # beyond 45 degrees the exact gap is not defined


def round_bodies(geometry: Geometry) -> PegInHole:
    """The round peg and hole that the scenario's meshes stand for."""
    return PegInHole(geometry.peg_radius, geometry.hole_radius, geometry.hole_depth, geometry.chamfer)


def deepest_overlap(geometry: Geometry, p_HP: ArrayLike, axis_H: ArrayLike) -> float:
    """Deepest overlap, m, of the round bodies over some poses; 0 where they never touch.

    A pose that is none, of a run that has diverged, does not count.

    Args:
        geometry: of peg and hole.
        p_HP: (n, 3), centre of the tip, m.
        axis_H: (n, 3), unit, the peg's axis away from the tip.
    """
    p, axis = np.reshape(p_HP, (-1, 3)), np.reshape(axis_H, (-1, 3))
    real = np.isfinite(p).all(axis=1) & (axis[:, 2] > MIN_UPRIGHT)
    if not real.any():
        return 0.0
    return max(0.0, -float(round_bodies(geometry).gap(p[real], axis[real]).min()))
