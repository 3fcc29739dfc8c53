import numpy as np
import pytest

from experiments import practice_rounds
from experiments.practice_results import Check
from experiments.practice_rounds import Practice, improve, trial_names
from experiments.trial.run_trial import run_trial
from models.scenario import CHECK_STREAM, PRACTICE_STREAM, TRIAL_STREAM, resolve_scenario
from skill.manipulation_skill import ManipulationSkill
from skill.practice import rollout_of
from skill.states.estimate import Estimate

SHORT = Practice(rounds=1, starts=1, checks=1)


def perform_here(tasks):
    return [task() for task in tasks.values()]


@pytest.fixture
def brief(quick_scenario):
    """The peg starts level with the mouth, almost upright, and has half a second."""
    quick_scenario.start.height, quick_scenario.start.tilt = 1e-4, [0.01, -0.01]
    quick_scenario.trial.time_limit = 0.5
    return quick_scenario


@pytest.mark.slow
def test_the_recorded_feed_is_that_of_the_perturbed_skill(brief, skill):
    """Where neither limits nor the guard act, the recorded feed is the feed that the row before asked for."""
    brief.controller.guard.force_limit = 1e4  # no impact load reaches it
    (number, perturbed), (same, opposite) = practice_rounds._opposite_trials(skill, SHORT, brief, 3)
    assert number == same == 3
    np.testing.assert_allclose(perturbed.perturbation.turn, -opposite.perturbation.turn)
    scenario = resolve_scenario(brief, seed=number, stream=PRACTICE_STREAM)
    _, run = run_trial(scenario, perturbed, seed=number)
    rollout, samples = rollout_of(run, perturbed), run.samples
    sure = rollout.memberships.max(axis=1) > 0.51  # elsewhere rounding decides between two states
    assert sure.mean() > 0.8
    assert rollout.memberships.argmax(axis=1)[sure].tolist() == samples["state"][sure].tolist()
    free = (samples["known"] == 1) & (samples[["fx", "fy", "fz"]].abs().sum(axis=1) < 1.0)
    rows = [k for k in samples.index[free] if k + 1 < len(samples) and free[k + 1]]
    assert len(rows) > 3
    for k in rows:
        wrench = samples.loc[k, ["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy()
        action = skill.act(np.array([*wrench, -samples["depth"][k]]), Estimate(rollout.memberships[k]))
        feed_speed = action.feed * np.exp(rollout.log_factors[k, 1]) / skill.period_
        limited = action.support * max(feed_speed, -scenario.controller.max_feed_speed)
        assert samples["feed_speed"][k + 1] == pytest.approx(limited, rel=0.05)


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
