"""The result of a plain insertion, from which tests derive others with `dataclasses.replace`."""

import math

from experiments.trial.trial_result import TrialResult
from skill.data.outcome import Outcome

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
    peak_contact_force=15.0,
    peak_load=16.0,
    mean_load=8.0,
    time_above_20n=0.25,
    first_touch=0.125,
    peak_measured_load=15.5,
    force_above_20n=0.125,
    wedged_time=0.16,
    path_length=0.02775,
    mean_jerk=4.5,
    field_score=99.25,
    trusted=True,
)
