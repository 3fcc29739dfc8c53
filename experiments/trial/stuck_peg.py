"""The definitions of a jammed peg, for demonstrations and rig trials, and of a wedged one, from single contacts.

A peg is wedged if two contacts squeeze it and friction can hold it so without any other load. Two contacts can do so
exactly if the line between them lies in both friction cones: then forces along the line balance each other (D. E.
Whitney, "Quasi-static assembly of compliantly supported rigid parts", J. Dyn. Syst. Meas. Control 104, 1982, where the
tilt of two-point contact exceeds c/mu; S. N. Simunovic, "An information approach to parts mating", PhD thesis, MIT,
1979). More push only squeezes harder: the peg comes free when it is turned or drawn out. A jammed peg, in contrast, is
stopped by the direction of the load alone (`is_jammed`).

`models.contact_theory.exact_wedging_tilt` is the same condition for a tilted peg in a round hole.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from compiled import compiled
from skill.arrays import Array
from systems.plant.contact_forces import FORCE, NORMAL, POINT

WEDGE_FORCE = 3.0  # in units of N; both contacts of a wedge carry at least this normal force, as in a jam
WEDGE_TIME = 0.1  # in units of s; a shorter squeeze, such as in an impact, is no wedge

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


@compiled
def wedged_samples(seen: NDArray[np.int64], contacts: Array, friction: float) -> NDArray[np.bool_]:
    """Returns whether two contacts wedge the peg at n samples.

    Each carries a normal force of at least `WEDGE_FORCE`, and the line from one to the other is within atan(friction)
    of both normals. The normal is that of the sum of a contact's forces, the point their centre.

    Args:
        seen: (n,), numbers of contacts.
        contacts: (n, 5, 8), see `systems.plant.contact_forces.join_contacts`.
        friction: coefficient mu of both bodies.
    """
    found = np.zeros(len(seen), np.bool_)
    least = 1.0 / math.hypot(1.0, friction)  # cosine of the friction angle
    for i in range(len(seen)):
        for a in range(seen[i]):
            one = contacts[i, a]
            for b in range(a):
                other = contacts[i, b]
                if min(one[FORCE], other[FORCE]) < WEDGE_FORCE:
                    continue
                line = other[POINT] - one[POINT]
                length = math.sqrt((line**2).sum())
                along = min((line * one[NORMAL]).sum(), -(line * other[NORMAL]).sum())
                found[i] = found[i] or (length > 0.0 and along >= least * length)
    return found


def wedged_time(wedged: NDArray[np.bool_], period: float) -> float:
    """Returns the time (s) in wedges that last `WEDGE_TIME` or longer; a sample (n,) stands for one period (s)."""
    changes = np.flatnonzero(np.diff(wedged, prepend=False, append=False))
    durations = period * (changes[1::2] - changes[::2])
    return float(durations[durations >= WEDGE_TIME * (1.0 - 1e-9)].sum())
