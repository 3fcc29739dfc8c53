"""The rewards against values worked by hand."""

import pytest

from interfaces.gym.rewards import DenseReward, Transition, sparse_reward
from models.scenario import Scenario
from skill.data.outcome import Outcome


def transition(*, depth=0.0, load=0.0, outcome=None, remaining=5.0):
    return Transition(
        depth_before=0.001, depth=0.001 + depth, load=load, duration=0.02, remaining=remaining, outcome=outcome
    )


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        (transition(), -0.02 * 0.02),
        (transition(depth=0.00277), 0.1 - 0.0004),  # the way is 24.7 mm + 3 mm
        (transition(depth=-0.00277), -0.1 - 0.0004),
        (transition(load=10.0), -0.0004),
        (transition(load=30.0), -0.0004 - 0.02 * 0.01 * 20.0),
        (transition(outcome=Outcome.INSERTED), 1.0 - 0.0004),
        (transition(outcome=Outcome.JAMMED), -0.0004 - 0.1),
        (transition(outcome=Outcome.FAULT), -0.0004 - 1.1),
        (transition(outcome=Outcome.DIVERGED, remaining=0.0), -0.0004 - 1.0),
    ],
)
def test_the_dense_reward_follows_its_formula(step, expected):
    assert DenseReward(Scenario())(step) == pytest.approx(expected)


@pytest.mark.parametrize(("outcome", "expected"), [(None, 0.0), (Outcome.INSERTED, 1.0), (Outcome.FAULT, 0.0)])
def test_the_sparse_reward_is_the_insertion(outcome, expected):
    assert sparse_reward(transition(depth=0.01, outcome=outcome)) == expected
