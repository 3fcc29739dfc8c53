"""The wrench that a policy receives in place of the measured one, to see whether it uses force."""

from __future__ import annotations

import numpy as np

from models.control import wrench_factor
from skill.arrays import Array
from skill.features.measurement import contact_load

TOUCH_LOAD = 3.0
"""Load from which a frozen wrench stays as it is, N: the first touch. The reading before it is almost zero."""

SHUFFLED = 500
"""Number of readings that a shuffled wrench is drawn from, at most: those of 10 s."""

# The state: how many readings there have been, then the readings (n, 6) that are kept.
READINGS = {"frozen": 1, "shuffled": SHUFFLED}


def initial_state(use: str) -> Array:
    """Returns the state (1 + 6 n,) before the first reading; ``use`` is `ControllerParameters.wrench`."""
    return np.zeros(1 + 6 * READINGS.get(use, 0))


def policy_wrench(use: str, state: Array, wrench: Array, chance: float) -> Array:
    """Returns the wrench (6,) that the policy receives, N and N m.

    * ``zero``: nothing.
    * ``frozen``: as measured until the first touch, and from then on as it was there.
    * ``shuffled``: any of the readings so far, each with the same probability, so that they are distributed as the
      measured ones and say nothing about the present.
    * ``scaled:F``: the measured one times F.

    Args:
        use: `ControllerParameters.wrench`, but not ``true``.
        state: before this reading.
        wrench: (6,), measured.
        chance: uniform in [0, 1), which chooses a reading.
    """
    if use == "zero":
        return np.zeros(6)
    if use not in READINGS:
        return wrench_factor(use) * wrench
    kept = min(int(state[0]), READINGS[use])
    return state[1:].reshape(-1, 6)[int(chance * kept)].copy() if kept else wrench.copy()


def policy_wrench_step(use: str, state: Array, wrench: Array, chance: float, lever: float) -> Array:
    """Returns the next state.

    If all places for a shuffled wrench are taken, reading n replaces one of them with the probability places / n, so
    that each reading so far is as likely to be kept (Vitter, "Random sampling with a reservoir", 1985).

    Args:
        use: see `policy_wrench`, as are the others.
        state: likewise.
        wrench: likewise.
        chance: uniform in [0, 1), which chooses the place.
        lever: of the moments in the load, m.
    """
    found = state.copy()
    number, places = int(state[0]), READINGS.get(use, 0)
    if use == "frozen" and (number > 0 or contact_load(wrench, lever) < TOUCH_LOAD):
        return found
    found[0] += 1.0
    place = number if number < places else int(chance * (number + 1))
    if place < places:
        found[1:].reshape(-1, 6)[place] = wrench
    return found
