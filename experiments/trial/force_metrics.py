"""Reduces the forces of a trial to the figures of its result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from compiled import compiled
from experiments.trial.trial_result import ForceFigures
from skill.arrays import Array
from skill.features.measurement import contact_loads
from systems.plant.contact_forces import FORCE, NORMAL, PLACE, POINT

TOUCH_LOAD = 1.0  # in units of N; a smaller load is no contact: the inertial force of the peg is a part of a newton
HIGH_LOAD = 20.0  # in units of N
FIRST_TOUCH_TIME = 0.050  # in units of s


def force_figures(
    wrenches: Sequence[Array] | Array, lever: float, step: float, peak_contact: float, peak_measured_load: float
) -> ForceFigures:
    """Returns the figures of a trial.

    Args:
        wrenches: (n, 6), true contact wrenches of the steps of the plant, N and N m.
        lever: of the moments in the load, m.
        step: time step of the plant, s.
        peak_contact: largest force of a single contact, N.
        peak_measured_load: N.
    """
    wrenches = np.reshape(wrenches, (-1, 6))
    forces, loads = np.linalg.norm(wrenches[:, :3], axis=1), contact_loads(wrenches, lever)
    touching = loads >= TOUCH_LOAD
    first = int(touching.argmax()) if touching.any() else len(loads)
    touch = forces[first : first + round(FIRST_TOUCH_TIME / step)]
    return ForceFigures(
        peak_axial_force=_largest(np.abs(wrenches[:, 2])),
        peak_lateral_force=_largest(np.hypot(wrenches[:, 0], wrenches[:, 1])),
        peak_moment=_largest(np.linalg.norm(wrenches[:, 3:], axis=1)),
        peak_load=_largest(loads),
        mean_load=float(loads[touching].mean()) if touching.any() else 0.0,
        time_above_20n=step * float((loads > HIGH_LOAD).sum()),
        force_above_20n=step * float((forces > HIGH_LOAD).sum()),
        first_touch=step * float(touch.sum()),
        peak_contact_force=peak_contact,
        peak_measured_load=peak_measured_load,
    )


@compiled
def contact_rows(seen: NDArray[np.int64], contacts: Array, count: int) -> Array:
    """Returns ``CONTACT_COLUMNS`` at the first ``count`` samples, (count, 18): the strongest contact at each place.

    Args:
        seen: (n,), numbers of contacts at the samples.
        contacts: (n, 5, 8), the contacts, see `systems.plant.contact_forces.join_contacts`.
        count: number of rows; those that were not looked at are zero.
    """
    rows = np.zeros((count, 18))
    for i in range(min(count, len(seen))):
        for k in range(seen[i] - 1, -1, -1):  # the strongest is the first
            place, force = int(contacts[i, k, PLACE]), contacts[i, k, FORCE]
            rows[i, 6 * place : 6 * place + 3] = contacts[i, k, POINT]
            rows[i, 6 * place + 3 : 6 * place + 6] = force * contacts[i, k, NORMAL]
    return rows


def _largest(values: Array) -> float:
    return float(values.max(initial=0.0))
