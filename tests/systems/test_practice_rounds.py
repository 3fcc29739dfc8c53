import numpy as np
import pytest

import systems.runs.practice_rounds
from models.scenario import CHECK_STREAM, PRACTICE_STREAM, TRIAL_STREAM, resolve_scenario
from skill.practice.exploration import PerturbedPolicy, rollout_of
from systems.runs.practice_rounds import Check, Practice, practise
from systems.runs.trial import run_trial

SHORT = Practice(rounds=1, starts=1, checks=1)


@pytest.fixture
def brief(quick_scenario):
    """The peg starts level with the mouth, almost upright, and has half a second."""
    quick_scenario.start.height, quick_scenario.start.tilt = 1e-4, [0.01, -0.01]
    quick_scenario.trial.time_limit = 0.5
    return quick_scenario


def test_a_varied_run_is_what_the_varied_skill_wanted(brief, skill):
    """Where nothing holds it back, the feed on record is that which the varied skill wanted a row before."""
    (number, varied), (same, other) = systems.runs.practice_rounds._both_ways(skill, SHORT, brief, 3)
    assert number == same == 3
    np.testing.assert_allclose(varied.perturbation.turn, -other.perturbation.turn)
    scenario = resolve_scenario(brief, seed=number, stream=PRACTICE_STREAM)
    _, run = run_trial(scenario, varied, seed=number)
    e, samples = rollout_of(run, varied, SHORT.cost), run.samples
    assert e.memberships.argmax(axis=1).tolist() == samples["state"].tolist()
    loose = (samples["known"] == 1) & (samples[["fx", "fy", "fz"]].abs().sum(axis=1) < 1.0)
    rows = [k for k in samples.index[loose] if k + 1 < len(samples)]
    assert len(rows) > 3
    for k in rows:
        measured = samples.loc[k, ["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy()
        plain = skill.act(np.array([*measured, -samples["depth"][k]]), e.memberships[k])
        wanted = plain.feed * np.exp(e.tried[k, 1]) / skill.period_
        limited = max(wanted, -scenario.controller.max_feed_speed)
        assert samples["feed_speed"][k + 1] == pytest.approx(limited, rel=0.05)


def test_practice_checks_and_trials_start_from_different_places(quick_scenario):
    starts = {
        (stream, number): tuple(resolve_scenario(quick_scenario, seed=number, stream=stream).start.tilt)
        for stream in (CHECK_STREAM, PRACTICE_STREAM, TRIAL_STREAM)
        for number in range(40)
    }
    assert len(set(starts.values())) == len(starts)


def test_a_round_of_practice_keeps_what_beats_the_check_and_nothing_else(brief, skill):
    notes = []
    first, second = practise(brief, skill, SHORT, jobs=1, advance=notes.append)
    assert len(notes) == SHORT.n_trials == 4
    assert (first.skill, first.kept, first.practised) == (skill, True, [])
    assert [r.seed for r in second.practised] == [0, 0]
    assert second.kept == second.check.beats(first.check)
    assert (second.skill is not skill) == second.kept
    assert not isinstance(second.skill, PerturbedPolicy)


def test_a_skill_that_has_learnt_to_stand_still_is_discarded(brief, skill, monkeypatch):
    class Idle(PerturbedPolicy):
        def act(self, measured, probabilities=None):
            action = super().act(measured, probabilities)
            return type(action)(turn=0 * action.turn, feed=0.0, probabilities=action.probabilities)

    idle = Idle.of(skill, SHORT.exploration.draw(np.random.default_rng(0), 0.01))
    monkeypatch.setattr(systems.runs.practice_rounds, "remember", lambda *_: idle)
    rounds = list(practise(brief, skill, Practice(rounds=1, starts=1, checks=1), jobs=1))
    assert not rounds[1].check.results[0].inserted
    assert not rounds[1].kept
    assert rounds[1].skill is skill


class Result:
    def __init__(self, inserted):
        self.inserted = inserted


def test_a_check_is_beaten_by_less_cost_without_fewer_insertions():
    good, worse = Check([Result(True), Result(True)], [3.0, 3.0]), Check([Result(True), Result(True)], [3.0, 4.0])
    cheap_but_fails = Check([Result(True), Result(False)], [1.0, 1.0])
    assert good.beats(worse)
    assert not worse.beats(good)
    assert not good.beats(good)
    assert not cheap_but_fails.beats(good)
