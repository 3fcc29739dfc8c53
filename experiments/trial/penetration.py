"""The overlap of the simulated bodies, which a compliant contact model permits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from models.assembly import Assembly

if TYPE_CHECKING:  # a scenario needs Drake, which training must not import
    from models.scenario import Geometry

MIN_UPRIGHT = math.cos(math.radians(44.9))  # the exact gap is not defined for a tilt beyond 45 degrees


def deepest_overlap(geometry: Geometry, p_HP: ArrayLike, R_HP: ArrayLike) -> float:
    """Returns the deepest overlap of the exact bodies over n poses, m; 0 if they never overlap.

    Ignores the NaN poses of a diverged run, and poses that are tilted by more than 44.9 degrees.

    Args:
        geometry: sizes of peg and hole.
        p_HP: (n, 3), centre of the tip, m.
        R_HP: (n, 3, 3), rotations of the peg.
    """
    p, R = np.asarray(p_HP), np.asarray(R_HP)
    valid = np.isfinite(p).all(axis=1) & (R[:, 2, 2] > MIN_UPRIGHT)
    if not valid.any():
        return 0.0
    return max(0.0, -float(Assembly.of(geometry).gap(p[valid], R[valid]).min()))
