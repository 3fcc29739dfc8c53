"""When a peg counts as jammed: one definition, for demonstrations and for the rig."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

JAMMED_TIME = 1.0  # in units of s at the end of a run, in which ...
JAMMED_GAIN = 0.5e-3  # ... the peg came less than this deeper than ever before, in units of m, ...
JAMMED_FORCE = 3.0  # ... although it was pressed by more than this on average, in units of N


def is_jammed(time: NDArray[np.float64], depth: NDArray[np.float64], force: NDArray[np.float64]) -> bool:
    """Whether the end of a run brought no depth although something was pressed against.

    What counts is the greatest depth so far, not the depth: drawing back and falling to the old place is no progress.

    Args:
        time: (n,), s, increasing.
        depth: (n,), of the tip below the mouth, m.
        force: (n, 3), contact force on the peg, N.
    """
    last = time > time[-1] - JAMMED_TIME
    if last.all():
        return False
    gain = depth[last].max() - depth[~last].max()
    return bool(gain < JAMMED_GAIN and np.linalg.norm(force[last], axis=1).mean() > JAMMED_FORCE)
