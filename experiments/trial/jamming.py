"""The definition of a jammed peg, for demonstrations and rig trials."""

from __future__ import annotations

import numpy as np

from skill.arrays import Array

JAMMED_TIME = 1.0  # in units of s; length of the last part of a run that is examined
JAMMED_GAIN = 0.5e-3  # in units of m; a jammed peg gains less than this on its greatest depth before that part
JAMMED_FORCE = 3.0  # in units of N; the mean contact force on a jammed peg is larger than this


def is_jammed(time: Array, depth: Array, force: Array) -> bool:
    """Returns whether the last part of a run gained no depth although the peg was pressed against something.

    The gain refers to the greatest depth before the last part. Moving out and back in to the same depth is no gain.

    Args:
        time: (n,), s, increasing.
        depth: (n,), depth of the tip below the mouth, m.
        force: (n, 3), contact force on the peg, N.
    """
    last = time > time[-1] - JAMMED_TIME
    if last.all():
        return False
    gain = depth[last].max() - depth[~last].max()
    return bool(gain < JAMMED_GAIN and np.linalg.norm(force[last], axis=1).mean() > JAMMED_FORCE)
