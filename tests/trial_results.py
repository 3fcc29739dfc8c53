"""The result of a plain insertion, from which tests derive others with `dataclasses.replace`."""

import math

from skill.data.outcome import Outcome
from systems.runs.trial_result import TrialResult

PLAIN = TrialResult(
    seed=0,
    tilt=(math.radians(1.0), math.radians(-2.0)),
    outcome=Outcome.INSERTED,
    time=2.5,
    depth=0.0247,
    peak_axial_force=6.0,
    peak_lateral_force=12.0,
    peak_moment=0.1,
    penetration=20e-6,
    steps=20,
    lost_steps=0,
    back_offs=0,
    unknown_time=0.1,
    unsupported_time=0.0,
    states=(0, 1, 2, 3),
)
