"""Which trials of a scenario are performed, and what a trial draws."""

from __future__ import annotations

import copy
import math
from enum import StrEnum

import numpy as np

from models.clearance import relative_entry_tilt
from models.scenario import STRESS_STREAM, TRIAL_STREAM, Scenario, resolve_scenario


class Arm(StrEnum):
    """Which trials of a scenario are performed."""

    DEFAULT = "default"
    """All that its ranges contain."""
    STRESS = "stress"
    """The hard ones: a tilt above `stress_tilt`, a pivot further than `STRESS_PIVOT` from the mouth, on either side,
    and a friction within `STRESS_FRICTION`."""


STRESS_TILT = math.radians(3.2)
STRESS_PIVOT = 1.2e-3  # in units of m
STRESS_FRICTION = (0.15, 0.3)


def stress_tilt(scenario: Scenario) -> float:
    """Returns the tilt above which a trial may be one of the arm `Arm.STRESS`, rad.

    It is `STRESS_TILT`. Below the nominal clearance it keeps its part of the largest tilt that enters the hole.
    """
    return STRESS_TILT * min(1.0, relative_entry_tilt(scenario))


def trial_scenario(scenario: Scenario, *, number: int, arm: Arm = Arm.DEFAULT) -> Scenario:
    """Returns the resolved scenario of a trial; it shares no random draw with any demonstration.

    Raises:
        ValueError: if the ranges of the scenario contain no trial of the arm.
    """
    chosen = scenario if arm is Arm.DEFAULT else _stress_scenario(scenario, number)
    return resolve_scenario(chosen, seed=number, stream=TRIAL_STREAM)


def _stress_scenario(scenario: Scenario, number: int) -> Scenario:
    """Returns a copy with the tilt, the pivot and the friction of a trial of the arm `Arm.STRESS`."""
    largest, furthest, least = scenario.start.tilt_range, scenario.rig.pivot_range, stress_tilt(scenario)
    if not (math.sqrt(2.0) * largest > 1.05 * least and furthest > STRESS_PIVOT):
        raise ValueError(
            f"start.tilt_range is {math.degrees(largest):.3g} deg and rig.pivot_range {1e3 * furthest:.3g} mm; expected"
            f" at least {math.degrees(0.75 * least):.2g} deg and more than {1e3 * STRESS_PIVOT:g} mm, or no trial is"
            " one of the stress arm"
        )
    rng = np.random.default_rng([STRESS_STREAM, number])
    tilt = np.zeros(2)
    while math.hypot(*tilt) <= least:
        tilt = rng.uniform(-largest, largest, 2)
    hard = copy.deepcopy(scenario)
    hard.start.tilt = [float(angle) for angle in tilt]
    hard.rig.pivot_height = float(rng.choice([-1.0, 1.0]) * rng.uniform(STRESS_PIVOT, furthest))
    hard.contact.friction, hard.contact.friction_spread = float(rng.uniform(*STRESS_FRICTION)), 0.0
    return hard
