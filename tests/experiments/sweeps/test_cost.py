"""The estimated cost of a sweep."""

import pytest

from experiments.sweeps import cost as costs
from experiments.sweeps.cost import (
    DEMONSTRATION_CPU,
    LOOP,
    POLICY_CPU,
    REFERENCE_SPEED,
    TRIAL_CPU,
    TrialKind,
    cost_of,
    duration,
)
from experiments.sweeps.result_blocks import blocks_of, hold
from tests.experiments.sweeps.made_up_rows import made_up_row


@pytest.fixture(autouse=True)
def slow_machine(monkeypatch):
    """A machine of half the speed of the one with the stated CPU times."""
    monkeypatch.setattr(costs, "machine_speed", lambda: 2 * REFERENCE_SPEED)


def test_without_results_the_cost_follows_from_the_speed_of_the_machine(tmp_path):
    trials = {
        TrialKind("skill", "drake", compiled=True): 10,
        TrialKind("skill", "exact", compiled=True): 5,
        TrialKind("law", "exact", compiled=False): 3,
    }
    cost = cost_of(tmp_path, trials=trials, demonstrations={"exact": 20, "drake": 10}, policies=2)
    expected = 10 * TRIAL_CPU["drake"] + 5 * TRIAL_CPU[LOOP] + 3 * TRIAL_CPU["exact"] + 2 * POLICY_CPU
    expected += 20 * DEMONSTRATION_CPU["exact"] + 10 * DEMONSTRATION_CPU["drake"]
    assert cost.cpu == pytest.approx(2 * expected)
    assert "to do: 18 trials, 30 demonstrations, 2 policies; about" in cost.text(2)
    assert "(from the speed of this machine)" in cost.text(2)


def test_what_functions_make_is_not_estimated(tmp_path):
    known = {"trials": {TrialKind("p", "drake", compiled=False): 10}, "demonstrations": {}}
    cost = cost_of(tmp_path, **known, policies=3, unknown=2)
    assert cost.cpu == pytest.approx(2 * (10 * TRIAL_CPU["drake"] + POLICY_CPU))
    assert cost.text(1).endswith(", without the making of 2 policies by functions")
    assert "by functions" not in cost_of(tmp_path, **known, policies=3).text(1)


def test_with_results_a_trial_costs_what_trials_of_this_policy_and_engine_have_cost(tmp_path):
    for policy, engine, cpu in (("a b", "drake", 3.0), ("a b", "exact", 100.0), ("c", "drake", 50.0)):
        (block,) = blocks_of(tmp_path, "a" * 16, range(4), policy=policy, trial_set="usual", engine=engine)
        held = hold(block)
        for number in range(4):
            held.add(made_up_row(number, cpu_s=cpu + number))
        held.write()
    kind = TrialKind("a b", "drake", compiled=True)
    cost = cost_of(tmp_path, trials={kind: 2000}, demonstrations={}, policies=0)
    assert cost.cpu == pytest.approx(2000 * 4.5)
    assert cost.text(3) == (
        "to do: 2,000 trials; about 2.5 h of CPU, 50.1 min with 3 idle cores"
        " (trials cost what they did in these results)"
    )


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0 s"), (119.0, "119 s"), (120.0, "2.0 min"), (7200.0, "2.0 h"), (1.7e5, "47.2 h"), (2e5, "2.3 days")],
)
def test_durations_have_a_readable_unit(seconds, text):
    assert duration(seconds) == text
