"""Which trials of a scenario are performed, and what a trial draws."""

from __future__ import annotations

import copy
import math
from enum import StrEnum

import numpy as np

from models.clearance import relative_entry_tilt
from models.scenario import HARD_STREAM, TRIAL_STREAM, Scenario, resolve_scenario


class TrialSet(StrEnum):
    """Which trials of a scenario are performed."""

    USUAL = "usual"
    """All that its ranges contain."""
    HARD = "hard"
    """The hard ones: a tilt above `hard_tilt`, a pivot further than `HARD_PIVOT` from the mouth, on either side,
    and a friction within `HARD_FRICTION`."""


HARD_TILT = math.radians(3.2)
HARD_PIVOT = 1.2e-3  # in units of m
HARD_FRICTION = (0.15, 0.3)


def hard_tilt(scenario: Scenario) -> float:
    """Returns the tilt above which a trial may be of `TrialSet.HARD`, rad.

    It is `HARD_TILT`. Below the nominal clearance it keeps its part of the largest tilt that enters the hole.
    """
    return HARD_TILT * min(1.0, relative_entry_tilt(scenario))


def trial_scenario(scenario: Scenario, *, number: int, trial_set: TrialSet = TrialSet.USUAL) -> Scenario:
    """Returns the resolved scenario of a trial; it shares no random draw with any demonstration.

    Raises:
        ValueError: if the ranges of the scenario contain no such trial.
    """
    chosen = scenario if trial_set is TrialSet.USUAL else _hard_scenario(scenario, number)
    return resolve_scenario(chosen, seed=number, stream=TRIAL_STREAM)


def _hard_scenario(scenario: Scenario, number: int) -> Scenario:
    """Returns a copy with the tilt, the pivot and the friction of a trial of `TrialSet.HARD`."""
    largest, furthest, least = scenario.start.tilt_range, scenario.rig.pivot_range, hard_tilt(scenario)
    if not (math.sqrt(2.0) * largest > 1.05 * least and furthest > HARD_PIVOT):
        raise ValueError(
            f"start.tilt_range is {math.degrees(largest):.3g} deg and rig.pivot_range {1e3 * furthest:.3g} mm; expected"
            f" at least {math.degrees(0.75 * least):.2g} deg and more than {1e3 * HARD_PIVOT:g} mm, or no trial is"
            " a hard one"
        )
    rng = np.random.default_rng([HARD_STREAM, number])
    tilt = np.zeros(2)
    while math.hypot(*tilt) <= least:
        tilt = rng.uniform(-largest, largest, 2)
    hard = copy.deepcopy(scenario)
    hard.start.tilt = [float(angle) for angle in tilt]
    hard.rig.pivot_height = float(rng.choice([-1.0, 1.0]) * rng.uniform(HARD_PIVOT, furthest))
    hard.contact.friction, hard.contact.friction_spread = float(rng.uniform(*HARD_FRICTION)), 0.0
    return hard
