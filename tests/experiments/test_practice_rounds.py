import pytest

from experiments.practice_results import Check
from experiments.practice_rounds import Practice, improve, trial_names
from models.scenario import CHECK_STREAM, PRACTICE_STREAM, TRIAL_STREAM, resolve_scenario
from skill.manipulation_skill import ManipulationSkill

SHORT = Practice(rounds=1, starts=1, checks=1)


def perform_here(tasks):
    return [task() for task in tasks.values()]


@pytest.fixture
def brief(quick_scenario):
    """The peg starts level with the mouth, almost upright, and has half a second."""
    quick_scenario.start.height, quick_scenario.start.tilt = 1e-4, [0.01, -0.01]
    quick_scenario.trial.time_limit = 0.5
    return quick_scenario


def test_practice_checks_and_trials_start_from_different_tilts(quick_scenario):
    starts = {
        (stream, number): tuple(resolve_scenario(quick_scenario, seed=number, stream=stream).start.tilt)
        for stream in (CHECK_STREAM, PRACTICE_STREAM, TRIAL_STREAM)
        for number in range(40)
    }
    assert len(set(starts.values())) == len(starts)


@pytest.mark.slow
def test_a_round_keeps_the_new_skill_only_if_it_beats_the_check(brief, skill):
    performed = []

    def perform(tasks):
        performed.extend(tasks)
        return perform_here(tasks)

    first, second = improve(brief, skill, SHORT, perform=perform)
    assert performed == trial_names(SHORT)
    assert len(performed) == SHORT.n_trials == 4
    assert (first.skill, first.kept, first.practised) == (skill, True, [])
    assert [r.seed for r in second.practised] == [0, 0]
    assert second.kept == second.check.beats(first.check)
    assert (second.skill is not skill) == second.kept
    assert isinstance(second.skill, ManipulationSkill)


class Result:
    """The part of a `TrialResult` that a check needs."""

    def __init__(self, inserted):
        self.inserted = inserted


def test_a_check_is_beaten_by_lower_costs_with_at_least_as_many_insertions():
    good, worse = Check([Result(True), Result(True)], [3.0, 3.0]), Check([Result(True), Result(True)], [3.0, 4.0])
    cheap_with_failure = Check([Result(True), Result(False)], [1.0, 1.0])
    assert good.beats(worse)
    assert not worse.beats(good)
    assert not good.beats(good)
    assert not cheap_with_failure.beats(good)
