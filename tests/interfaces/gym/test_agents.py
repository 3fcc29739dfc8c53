"""Episodes against the trials of `run_trial`."""

import numpy as np
import pytest

from benchmarks.rig.control_laws import StraightPush
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.gym.agents import PolicyAgent, run_episode
from skill.policy.rig_policy import Action
from systems.law.faults import Fault

TRIAL = 88000


class Away(StraightPush):
    """Drives to the upper travel limit."""

    def act(self, measured, estimate=None):
        return Action(np.zeros(2), 0.03 * self.period_)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "number", "trial_set", "time_limit", "shows"),
    [
        (None, TRIAL, TrialSet.USUAL, 8.0, lambda result: result.time > 0.1),
        (StraightPush(0.03), TRIAL, TrialSet.HARD, 1.6, lambda result: result.back_offs > 0),
        (StraightPush(0.03), TRIAL, TrialSet.USUAL, 0.09, lambda result: result.time == 0.09),  # no multiple of 0.02 s
        (Away(0.01), TRIAL + 1, TrialSet.USUAL, 8.0, lambda result: result.fault is Fault.UPPER_TRAVEL_LIMIT),
    ],
    ids=["the skill", "a push that backs off", "a time limit within a period", "a fault"],
)
def test_an_episode_gives_the_record_of_its_trial(
    make, quick_scenario, skill, law, number, trial_set, time_limit, shows
):
    quick_scenario.trial.time_limit, policy = time_limit, law or skill
    env = make(scenario=quick_scenario, trial_set=trial_set, policy=policy, labels=False)
    _, info = run_episode(env, PolicyAgent(policy), trial=number)
    trial = trial_scenario(quick_scenario, number=number, trial_set=trial_set)
    result, _ = run_trial(trial, policy, seed=number)
    assert info["trial"] == result.record()
    assert info["is_success"] is result.inserted
    assert shows(result)
    with pytest.raises(Exception, match="call reset"):
        env.step(np.zeros(4))


def test_a_trial_that_runs_out_of_time_is_truncated(make, quick_scenario):
    quick_scenario.trial.time_limit = 0.09
    env = make()
    env.reset(options={"trial": TRIAL})
    ends = [env.step(np.zeros(3))[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(False, True)]


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
