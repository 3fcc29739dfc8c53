import numpy as np
import pytest

from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import trial_scenario
from skill.policy.rig_policy import Action
from skill.states.estimate import Estimate
from systems.law.control_law import ControlLaw

SPEED, STEP = 0.018, 5e-4  # so slow that the force guard does not reduce them


class TurnInTheHole(ControlLaw):
    """Waits until the peg is 1 mm deep, then turns about x in two of three phases."""

    def state_names(self):
        return ["approach", "one", "two", "three"]

    def estimator(self):
        return self

    def initial(self):
        return Estimate.of_phase(0, 4)

    def step(self, memory, observation):
        phase = int(min(memory[0] + 1, 3)) if memory[0] > 0 or observation[6] < -1e-3 else 0
        return Estimate.of_phase(phase, 4)

    def act(self, measured, estimate):
        turn = np.array([STEP if estimate.state in (1, 2) else 0.0, 0.0])
        return Action(turn=turn, feed=-SPEED * self.period_)


def run(scenario, law, time_limit):
    scenario.start.tilt = [0.0, 0.0]
    scenario.trial.time_limit = time_limit
    return run_trial(trial_scenario(scenario, number=5), law, seed=5)


def test_the_phases_of_a_law_are_performed_and_recorded(quick_scenario):
    result, record = run(quick_scenario, TurnInTheHole(), 0.3)
    assert result.states == (0, 1, 2, 3)
    samples = record.samples
    first = samples["state"].to_numpy().argmax() - 2
    assert samples["depth"].iloc[first] > 1e-3 >= samples["depth"].iloc[first - 1]
    # The hole turns in the opposite sense, once in each of two phases.
    assert samples["target_pitch"].iloc[-1] == pytest.approx(-2 * quick_scenario.controller.gain * STEP)
    assert (samples["known"] == 1).all()
