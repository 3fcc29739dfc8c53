"""Accumulates the forces of a trial and reduces them to the figures of its result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from compiled import compiled
from skill.arrays import Array
from skill.features.measurement import contact_loads, load_of_components
from systems.plant.contact_forces import FORCE, NORMAL, PLACE, POINT, Contact, needs_contacts

TOUCH_LOAD = 1.0  # in units of N; a smaller load is no contact: the inertial force of the peg is a part of a newton
HIGH_LOAD = 20.0  # in units of N
FIRST_TOUCH_TIME = 0.050  # in units of s


@dataclass(frozen=True)
class ForceFigures:
    """The forces of a trial. All but the measured load are those of the true contact.

    Attributes:
        peak_axial_force: largest net contact force along the peg, N.
        peak_lateral_force: largest net contact force across the peg, N. Opposite forces of a wedge cancel in it.
        peak_moment: largest net contact moment about the tip, N m.
        peak_load: largest load of the net contact wrench, N (`skill.features.measurement.contact_loads`).
        mean_load: mean of the load over the time in which it is at least `TOUCH_LOAD`, N; 0 if it never is.
        time_above_20n: time in which the load is above `HIGH_LOAD`, s.
        force_above_20n: time in which the size of the net contact force is above `HIGH_LOAD`, s.
        first_touch: integral of the size of the net contact force over `FIRST_TOUCH_TIME` from the first load of
            `TOUCH_LOAD` on, N s; over the rest of the trial if that is shorter.
        peak_contact_force: largest normal force of any single contact, N.
        peak_measured_load: largest load of the wrench that the sensor monitor passes on, N.
    """

    peak_axial_force: float
    peak_lateral_force: float
    peak_moment: float
    peak_load: float
    mean_load: float
    time_above_20n: float
    force_above_20n: float
    first_touch: float
    peak_contact_force: float
    peak_measured_load: float


@dataclass
class ForceMetrics:
    """The forces of a trial so far.

    Attributes:
        lever: of the moments in the load, m.
        step: time step of the plant, s.
    """

    lever: float
    step: float
    _wrenches: list[Array] = field(default_factory=list)
    _largest_load: float = 0.0
    _largest_extent: float = 0.0
    _peak_contact: float = 0.0

    def add_step(self, wrench: Array) -> None:
        """Adds the true contact wrench (6,) of a plant step: force (N), then moment about the tip (N m), in P."""
        self._wrenches.append(wrench)

    def needs_contacts(self, wrench: Array, extent: float) -> bool:
        """Returns whether the single contacts of this plant step should be read, as `needs_contacts` says.

        Args:
            wrench: true contact wrench (6,), as for `add_step`.
            extent: see `PegCarrier.contact_extent`.
        """
        fx, fy, fz, mx, my, mz = wrench
        load = load_of_components(fx, fy, fz, mx, my, mz, self.lever)
        needed = needs_contacts(load, extent, self._largest_load, self._largest_extent)
        if needed:
            self._largest_load = max(load, self._largest_load)
            self._largest_extent = max(extent, self._largest_extent)
        return needed

    def add_contacts(self, contacts: Sequence[Contact]) -> None:
        """Adds the single contacts of a plant step."""
        self._peak_contact = max([self._peak_contact, *(contact.force for contact in contacts)])

    def figures(self, peak_measured_load: float) -> ForceFigures:
        """Returns the figures of all that was added, with the largest measured load (N)."""
        wrenches = np.reshape(self._wrenches, (-1, 6))
        return force_figures(wrenches, self.lever, self.step, self._peak_contact, peak_measured_load)


def force_figures(
    wrenches: Array, lever: float, step: float, peak_contact: float, peak_measured_load: float
) -> ForceFigures:
    """Returns the figures of a trial.

    Args:
        wrenches: (n, 6), true contact wrenches of the steps of the plant, N and N m.
        lever: of the moments in the load, m.
        step: time step of the plant, s.
        peak_contact: largest force of a single contact, N.
        peak_measured_load: N.
    """
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
