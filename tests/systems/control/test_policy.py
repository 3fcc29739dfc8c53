import numpy as np
import pytest

from experiments.trial import run_trial, trial_scenario
from skill.policy import Action
from systems.control.policy import ControlLaw

SPEED, STEP = 0.018, 5e-4  # so slow that the force guard does not reduce them


class Push(ControlLaw):
    """Pushes without turning."""

    def act(self, measured, probabilities=None, contexts=None):
        return Action(turn=np.zeros(2), feed=-SPEED * self.period_, probabilities=np.ones(1))


class TurnInTheHole(ControlLaw):
    """Waits until the peg is 1 mm deep, then turns about x in two of three phases."""

    phases = ("approach", "one", "two", "three")

    def follow(self, phase, measured):
        return min(phase + 1, 3) if phase > 0 or measured[6] < -1e-3 else 0

    def act(self, measured, probabilities=None, contexts=None):
        phase = 0 if probabilities is None else int(np.argmax(probabilities))
        turn = np.array([STEP if phase in (1, 2) else 0.0, 0.0])
        return Action(turn=turn, feed=-SPEED * self.period_, probabilities=np.eye(4)[phase])


def run(scenario, law, time_limit):
    scenario.start.tilt = [0.0, 0.0]
    scenario.trial.time_limit = time_limit
    return run_trial(trial_scenario(scenario, number=5), law, seed=5)


@pytest.mark.slow
def test_a_law_without_memory_pushes_an_aligned_peg_in(quick_scenario):
    result, record = run(quick_scenario, Push(), 2.0)
    assert result.inserted
    assert result.states == (0,)
    assert result.steps == 0
    assert record.metadata["state_names"] == ["acting"]
    assert record.samples["feed_speed"].iloc[5] == pytest.approx(-SPEED)


def test_the_phases_of_a_law_are_performed_and_recorded(quick_scenario):
    result, record = run(quick_scenario, TurnInTheHole(), 0.3)
    assert result.states == (0, 1, 2, 3)
    samples = record.samples
    first = samples["state"].to_numpy().argmax() - 2
    assert samples["depth"].iloc[first] > 1e-3 >= samples["depth"].iloc[first - 1]
    # The hole turns in the opposite sense, once in each of two phases.
    assert samples["target_pitch"].iloc[-1] == pytest.approx(-2 * quick_scenario.controller.gain * STEP)
    assert (samples["known"] == 1).all()


def test_two_runs_of_one_law_are_independent():
    law = TurnInTheHole()
    one, other = law.state_filter(), law.state_filter()
    deep, high = np.array([0, 0, 0, 0, 0, 0, -2e-3]), np.zeros(7)
    started = one.step(one.initial_log_belief(), deep)
    np.testing.assert_array_equal(started.probabilities, [0, 1, 0, 0])
    np.testing.assert_array_equal(other.step(other.initial_log_belief(), high).probabilities, [1, 0, 0, 0])
    np.testing.assert_array_equal(one.step(started.log_belief, high).probabilities, [0, 0, 1, 0])


def test_a_phase_that_does_not_exist_is_an_error():
    law = TurnInTheHole()
    law.follow = lambda phase, measured: 4
    follower = law.state_filter()
    with pytest.raises(ValueError, match=r"TurnInTheHole.follow returned phase 4; expected 0 to 3"):
        follower.step(follower.initial_log_belief(), np.zeros(7))
