"""Trials of the comparisons that need no simulation."""

import pytest

from benchmarks.rig import trials
from benchmarks.rig.control_laws import StraightPush
from benchmarks.rig.trials import FIRST_TRIAL, Setting


@pytest.fixture
def performed(monkeypatch):
    """The numbers of the performed trials; none is simulated. A slower law is later; the second trial fails."""
    numbers = []

    def attempt(scenario, arm, policy, number):
        numbers.append(number)
        good = number != FIRST_TRIAL + 1
        return {
            "seed": number,
            "inserted": good,
            "reason": "inserted" if good else "time over",
            "time_s": 0.05 / policy.speed,
            "peak_load_n": 10.0,
            "cpu_s": 0.5,
        }

    monkeypatch.setattr(trials, "attempt", attempt)
    return numbers


@pytest.fixture
def setting(quick_scenario, demonstrations, tmp_path):
    return Setting(
        quick_scenario, [demonstrations, demonstrations], tmp_path / "results", trials=4, jobs=1, candidates=8
    )


@pytest.fixture
def push():
    """The training of a straight push, faster in each set."""
    return lambda setting, record, advance, number: StraightPush(speed=0.01 * (1 + number))


@pytest.fixture
def no_progress():
    return lambda note: None
