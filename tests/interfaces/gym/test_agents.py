"""Episodes against the trials of `run_trial`."""

import numpy as np
import pytest

from benchmarks.rig.control_laws import StraightPush
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.gym.agents import PolicyAgent, run_episode
from systems.law.faults import Fault

TRIAL = 88000


@pytest.mark.slow
def test_the_skill_gives_the_record_of_its_trial(make, quick_scenario, skill):
    quick_scenario.trial.time_limit = 8.0
    env, agent = make(policy=skill, labels=False), PolicyAgent(skill)
    _, info = run_episode(env, agent, trial=TRIAL)
    result, _ = run_trial(trial_scenario(quick_scenario, number=TRIAL), skill, seed=TRIAL)
    assert info["trial"] == result.record()
    assert info["is_success"] is result.inserted


@pytest.mark.slow
def test_a_push_gives_the_records_of_its_trials_with_back_offs(make, quick_scenario):
    quick_scenario.trial.time_limit = 1.6
    push = StraightPush(0.03)
    env, agent = make("PegInHole-Hard-v0", policy=push, labels=False), PolicyAgent(push)
    _, info = run_episode(env, agent, trial=TRIAL)
    result, _ = run_trial(trial_scenario(quick_scenario, number=TRIAL, trial_set=TrialSet.HARD), push, seed=TRIAL)
    assert info["trial"] == result.record()
    assert result.back_offs > 0


def test_a_trial_that_runs_out_of_time_is_truncated(make, quick_scenario, skill):
    quick_scenario.trial.time_limit = 0.09  # no multiple of the period
    env, agent = make(policy=skill), PolicyAgent(skill)
    observation, _ = env.reset(options={"trial": TRIAL})
    ends = []
    for _ in range(5):
        observation, _, terminated, truncated, info = env.step(agent.act(observation))
        ends.append((terminated, truncated))
    assert ends == [(False, False)] * 4 + [(False, True)]
    result, _ = run_trial(trial_scenario(quick_scenario, number=TRIAL), skill, seed=TRIAL)
    assert info["trial"] == result.record()
    assert info["time"] == 0.09


@pytest.mark.slow
def test_a_fault_ends_the_episode_as_it_ends_a_trial(make, quick_scenario):
    class Away(StraightPush):
        """Drives to the upper travel limit."""

        def act(self, measured, estimate=None):
            action = super().act(measured, estimate)
            return type(action)(np.zeros(2), 0.03 * self.period_)

    away = Away(0.01)
    env, agent = make(policy=away, labels=False), PolicyAgent(away)
    reward, info = run_episode(env, agent, trial=88001)
    result, _ = run_trial(trial_scenario(quick_scenario, number=88001), away, seed=88001)
    assert result.fault is Fault.UPPER_TRAVEL_LIMIT
    assert info["trial"] == result.record()
    assert reward < -1.0
    with pytest.raises(Exception, match="call reset"):
        env.step(np.zeros(4))


def test_an_error_in_the_simulation_is_the_outcome_failed(make, monkeypatch):
    env = make()
    env.reset(options={"trial": TRIAL})

    def fail(self, context):
        raise IndexError("no such row")

    monkeypatch.setattr("experiments.trial.diagram_trial.TrialMonitor._ending_of_step", fail)
    _, reward, terminated, _, info = env.step(np.zeros(3))
    assert terminated
    assert info["trial"]["reason"].startswith("failed")
    assert (info["contact_label"], info["contact"]) == (-1, "")
    assert np.isnan(info["load"])
    assert reward < -1.0


def test_an_agent_receives_what_a_policy_receives_of_the_wrench_and_is_judged_by_the_measured_one(make, quick_scenario):
    rewards, given = {}, {}
    for use in ("true", "zero"):
        quick_scenario.controller.wrench = use
        env = make(scenario=quick_scenario, labels=False)
        env.reset(options={"trial": TRIAL})
        steps = [env.step(np.array([0.0, 0.0, -0.02])) for _ in range(25)]
        rewards[use] = [step[1] for step in steps]
        given[use] = max(np.abs(step[0]["wrench"]).max() for step in steps)
        assert max(step[-1]["load"] for step in steps) > 1.0
    assert given["true"] > 1.0 > given["zero"]
    assert rewards["true"] == rewards["zero"]
