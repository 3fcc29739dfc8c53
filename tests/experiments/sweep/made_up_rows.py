"""Rows of trials that were not simulated."""

import numpy as np

from experiments.sweep.trial_files import COUNTS, MEASURED_NUMBERS


def made_up_row(number, **known):
    """The row of a trial, with numbers that depend on its own only; without its key."""
    rng = np.random.default_rng(number)
    inserted = bool(rng.random() < 0.8)
    return {
        **{"trial": number, "factors": "{}", "inserted": inserted, "outcome": "inserted" if inserted else "jammed"},
        **{"fault": "", "reason": "inserted" if inserted else "jammed", "trusted": True},
        **{name: float(rng.uniform(0.1, 20.0)) for name in MEASURED_NUMBERS},
        **{name: int(rng.integers(0, 9)) for name in COUNTS},
        **{"skill": "5" * 16, "states": 5, "demonstration_set": 1, "demonstrations": 30, "train_s": 4.0},
        **{"query_ms": 0.5, "cpu_s": 1.2, "friction": 0.2, "pivot_mm": 0.1, "peg_radius_mm": 10.0},
        **{"hole_radius_mm": 10.05, "clearance": 0.005, "force_limit_n": 40.0, "time_limit_s": 10.0},
        **{"scenario": "{}", "versions": "{}", "code": "c" * 16, "began": "2026-01-01T00:00:00+00:00"},
        **known,
    }
