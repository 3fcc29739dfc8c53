"""The rewards against values worked by hand."""

import numpy as np
import pytest

from interfaces.gym.environment import InsertionEnv
from models.scenario import Scenario
from skill.data.outcome import Outcome


def reward_of(kind, *, progress=0.0, load=0.0, outcome=Outcome.TIME_OVER, remaining=5.0):
    env = InsertionEnv(Scenario(), reward=kind)
    env._wrench = np.array([0.0, 0.0, load, 0.0, 0.0, 0.0])
    return env._reward(outcome, progress=progress, duration=0.02, remaining=remaining)


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        ({}, -0.02 * 0.02),
        ({"progress": 0.00277}, 0.1 - 0.0004),  # the way is 24.7 mm + 3 mm
        ({"progress": -0.00277}, -0.1 - 0.0004),
        ({"load": 10.0}, -0.0004),
        ({"load": 30.0}, -0.0004 - 0.02 * 0.01 * 20.0),
        ({"outcome": Outcome.INSERTED}, 1.0 - 0.0004),
        ({"outcome": Outcome.JAMMED}, -0.0004 - 0.1),
        ({"outcome": Outcome.FAULT}, -0.0004 - 1.1),
        ({"outcome": Outcome.DIVERGED, "remaining": 0.0}, -0.0004 - 1.0),
    ],
)
def test_the_dense_reward_follows_its_formula(step, expected):
    assert reward_of("dense", **step) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("outcome", "expected"), [(Outcome.TIME_OVER, 0.0), (Outcome.INSERTED, 1.0), (Outcome.FAULT, 0.0)]
)
def test_the_sparse_reward_is_the_insertion(outcome, expected):
    assert reward_of("sparse", progress=0.01, outcome=outcome) == expected
