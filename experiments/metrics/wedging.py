"""The definition of a wedged peg, from the single contacts between peg and block.

A peg is wedged if two contacts squeeze it and friction can hold it so without any other load. Two contacts can do so
exactly if the line between them lies in both friction cones: then forces along the line balance each other (D. E.
Whitney, "Quasi-static assembly of compliantly supported rigid parts", J. Dyn. Syst. Meas. Control 104, 1982, where the
tilt of two-point contact exceeds c/mu; S. N. Simunovic, "An information approach to parts mating", PhD thesis, MIT,
1979). More push only squeezes harder: the peg comes free when it is turned or drawn out. A jammed peg, in contrast, is
stopped by the direction of the load alone (`experiments.metrics.jamming`).

`models.contact_theory.exact_wedging_tilt` is the same condition for a tilted peg in a round hole.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from systems.plant.contact_forces import Contact

WEDGE_FORCE = 3.0  # in units of N; both contacts of a wedge carry at least this normal force, as in a jam
WEDGE_TIME = 0.1  # in units of s; a shorter squeeze, such as in an impact, is no wedge


def is_wedged(contacts: Sequence[Contact], friction: float) -> bool:
    """Returns whether two of the contacts wedge the peg.

    Each carries a normal force of at least `WEDGE_FORCE`, and the line from one to the other is within atan(friction)
    of both normals. The normal is that of the sum of a contact's forces, the point their centre.

    Args:
        contacts: the single contacts between peg and block at one time.
        friction: coefficient mu of both bodies.
    """
    strong = [contact for contact in contacts if contact.force >= WEDGE_FORCE]
    least = 1.0 / math.hypot(1.0, friction)  # cosine of the friction angle
    for one, other in itertools.combinations(strong, 2):
        line = other.point - one.point
        length = math.sqrt(line @ line)
        if min(line @ one.normal, -(line @ other.normal)) >= least * length > 0.0:
            return True
    return False


@dataclass
class WedgeMetrics:
    """The wedges of a trial so far.

    Attributes:
        friction: coefficient mu.
        period: between two samples, s.
    """

    friction: float
    period: float
    _wedged: list[bool] = field(default_factory=list)

    def add_row(self, contacts: Sequence[Contact]) -> None:
        """Adds the single contacts at the next sample of the run."""
        self._wedged.append(is_wedged(contacts, self.friction))

    def wedged_time(self) -> float:
        """Returns the time (s) in wedges that last `WEDGE_TIME` or longer; a sample stands for one period."""
        changes = np.flatnonzero(np.diff([False, *self._wedged, False]))
        durations = self.period * (changes[1::2] - changes[::2])
        return float(durations[durations >= WEDGE_TIME * (1.0 - 1e-9)].sum())
