"""The overlap of the simulated bodies, which a compliant contact model permits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from models.contact_geometry import PegInHole
from skill.data.geometry import PegHoleGeometry

if TYPE_CHECKING:  # a scenario needs Drake, which training must not import
    from models.scenario import Geometry

MIN_UPRIGHT = math.cos(math.radians(44.9))  # the exact gap is not defined for a tilt beyond 45 degrees


def round_bodies(geometry: Geometry | PegHoleGeometry) -> PegInHole:
    """Returns the exact round peg and hole, which the simulated meshes approximate."""
    return PegInHole(geometry.peg_radius, geometry.hole_radius, geometry.hole_depth, geometry.chamfer)


def deepest_overlap(geometry: Geometry, p_HP: ArrayLike, axis_H: ArrayLike) -> float:
    """Returns the deepest overlap of the round bodies over n poses, m; 0 if they never overlap.

    Ignores the NaN poses of a diverged run, and poses that are tilted by more than 44.9 degrees.

    Args:
        geometry: sizes of peg and hole.
        p_HP: (n, 3), centre of the tip, m.
        axis_H: (n, 3), unit vector along the peg, away from the tip.
    """
    p, axis = np.atleast_2d(p_HP), np.atleast_2d(axis_H)
    valid = np.isfinite(p).all(axis=1) & (axis[:, 2] > MIN_UPRIGHT)
    if not valid.any():
        return 0.0
    return max(0.0, -float(round_bodies(geometry).gap(p[valid], axis[valid]).min()))
