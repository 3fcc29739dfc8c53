"""Requests and seeds of sets of demonstrations; the recordings themselves are in `tests/scripts`."""

import pytest

from experiments import demonstration_set
from experiments.demonstration_set import (
    MAX_ATTEMPTS,
    OPERATORS,
    SUBSTITUTE,
    Request,
    attempt_seed,
    demonstrate,
    requests,
)
from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
from skill.data.outcome import Outcome


def test_the_habits_take_turns_and_the_bad_ones_come_last():
    found = requests(3, 5)
    assert [r.number for r in found] == list(range(8))
    assert [r.good for r in found] == [True] * 3 + [False] * 5
    habits = ["expert", "novice", "expert", "blind", "slams", "gives_up", "overcorrects", "blind"]
    assert [r.habit for r in found] == habits


def test_the_seed_of_an_attempt_is_that_of_a_worked_example():
    """A set has 10,000 demonstrations of 50 attempts, so set 2 begins at 1,000,000."""
    assert attempt_seed(0, 0, 0) == 0
    assert attempt_seed(0, 0, 49) == 49
    assert attempt_seed(0, 1, 0) == 50
    assert attempt_seed(2, 0, 0) == 1_000_000
    assert attempt_seed(2, 34, 5) == 1_000_000 + 1700 + 5


class Recorded:
    """The part of a demonstration that `demonstrate` judges."""

    def __init__(self, outcome, *, good):
        self.outcome, self.good, self.reason, self.metadata = outcome, good, outcome.text(""), {}


@pytest.fixture
def record(monkeypatch):
    """Replaces the simulation: `record(*outcomes)` sets what the attempts end with and returns their scenarios."""

    def prepare(*outcomes):
        left, scenarios = list(outcomes), []

        def run(scenario):
            scenarios.append(scenario)
            outcome = left.pop(0) if len(left) > 1 else left[0]
            if isinstance(outcome, ValueError):
                raise outcome
            return Recorded(outcome, good=outcome is Outcome.INSERTED)

        monkeypatch.setattr(demonstration_set, "run_demonstration", run)
        return scenarios

    return prepare


def test_a_demonstration_is_repeated_until_it_is_as_requested(quick_scenario, record):
    scenarios = record(Outcome.JAMMED, Outcome.TIME_OVER, Outcome.INSERTED)
    found = demonstrate(quick_scenario, Request(13, "novice", True), seed=2)
    assert found.outcome is Outcome.INSERTED
    assert found.metadata == {"number": 1_000_000 + 13 * 50 + 2, "operator": 2 * OPERATORS + 3, "attempts": 3}
    seeds = [
        resolve_scenario(quick_scenario, seed=n, stream=DEMONSTRATION_STREAM).seed for n in range(1000650, 1000653)
    ]
    assert [s.seed for s in scenarios] == seeds
    assert [s.operator.habit for s in scenarios] == ["novice"] * 3
    assert len({tuple(s.start.tilt) for s in scenarios}) == 3  # another start each time


def test_a_bad_demonstration_must_be_bad_but_not_diverged(quick_scenario, record):
    record(Outcome.DIVERGED, Outcome.INSERTED, Outcome.JAMMED)
    found = demonstrate(quick_scenario, Request(0, "blind", False), seed=0)
    assert (found.outcome, found.metadata["attempts"]) == (Outcome.JAMMED, 3)


def test_a_demonstration_that_no_file_may_hold_is_repeated(quick_scenario, record):
    record(ValueError("moments look like N mm"), Outcome.JAMMED)
    found = demonstrate(quick_scenario, Request(0, "overcorrects", False), seed=0)
    assert (found.outcome, found.metadata["attempts"]) == (Outcome.JAMMED, 2)


def test_after_eight_equal_outcomes_another_person_tries(quick_scenario, record):
    scenarios = record(*[Outcome.JAMMED] * 8, Outcome.INSERTED)
    found = demonstrate(quick_scenario, Request(3, "novice", True), seed=2)
    assert found.metadata["operator"] == 2 * OPERATORS + 3 + SUBSTITUTE
    people = [(s.operator.habit, s.operator.align_gain) for s in scenarios]
    assert [person == people[0] for person in people] == [True] * 8 + [False]
    assert people[8][0] == "novice"


def test_where_a_bad_habit_does_no_harm_the_others_are_tried(quick_scenario, record):
    scenarios = record(*[Outcome.INSERTED] * 32, Outcome.JAMMED)
    found = demonstrate(quick_scenario, Request(5, "slams", False), seed=2)
    assert [s.operator.habit for s in scenarios] == ["slams"] * 16 + ["blind"] * 16 + ["gives_up"]
    assert (found.metadata["operator"], found.metadata["attempts"]) == (2 * OPERATORS + 5, 1)


GOOD, SLAMS = Request(0, "expert", True), Request(5, "slams", False)


@pytest.mark.parametrize(
    ("outcomes", "asked", "attempts", "message"),
    [
        ([Outcome.JAMMED], GOOD, 16, r"no good example in 16 attempts \(outcomes: \['jammed'\]\)"),
        ([Outcome.TIME_OVER, Outcome.JAMMED], GOOD, MAX_ATTEMPTS, "no good example in 50 attempts"),
        ([Outcome.INSERTED], SLAMS, 64, r"'slams' gave no bad example in 64 .*no bad ones \(--bad 0\)$"),
    ],
)
def test_attempts_end_after_sixteen_equal_outcomes_of_a_habit_or_fifty_in_all(
    quick_scenario, record, outcomes, asked, attempts, message
):
    scenarios = record(*outcomes)
    with pytest.raises(ValueError, match=message):
        demonstrate(quick_scenario, asked, seed=2)
    assert len(scenarios) == attempts
