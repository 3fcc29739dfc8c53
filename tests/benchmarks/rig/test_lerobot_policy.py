"""Policies of LeRobot: what they are trained on, and that they act as control laws."""

import numpy as np
import pytest

from skill.policy import Action
from tests.trajectories import make_demonstration

pytest.importorskip("lerobot", reason="needs the extra [lerobot]")

pytestmark = [pytest.mark.nightly, pytest.mark.slow]


@pytest.fixture
def lerobot_policy(monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    from benchmarks.rig import lerobot_policy

    return lerobot_policy


@pytest.fixture
def folder(tmp_path, lerobot_policy):
    demonstrations = [make_demonstration(direction=0.5 * k) for k in range(3)]
    lerobot_policy.write_training_set(demonstrations, tmp_path, copies=2, seed=0)
    return tmp_path


def test_copies_are_turned_and_noisy(folder, lerobot_policy):
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    data = LeRobotDataset("local/x", root=folder)
    assert data.num_episodes == 6
    wrench, action, state = (
        np.stack([item[key].numpy() for item in data]).reshape(6, 120, -1)
        for key in ("observation.environment_state", "action", "observation.state")
    )
    samples = make_demonstration().samples
    following = samples[["rx", "ry", "uz"]].to_numpy()[1:]
    first = make_demonstration(direction=0.0).samples
    np.testing.assert_allclose(action[0, :-1], first[["rx", "ry", "uz"]].to_numpy()[1:], atol=1e-9)
    np.testing.assert_allclose(
        np.linalg.norm(action[1, :-1, :2], axis=1), np.linalg.norm(following[:, :2], axis=1), atol=1e-8
    )
    np.testing.assert_array_equal(state[0, :, 0], state[1, :, 0])
    difference = wrench[0] - first[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy()
    assert 0.05 < difference[:, :3].std() < 0.07
    assert 4e-3 < difference[:, 3:].std() < 6e-3


@pytest.mark.parametrize("name", ["act", "diffusion"])
def test_a_trained_policy_acts_and_forgets_a_trial(folder, lerobot_policy, name):
    law = lerobot_policy.train(name, folder, seconds=1.0, seed=0)
    measured = np.array([1.0, 2.0, 3.0, 0.01, 0.02, 0.0, -0.005])
    estimator = law.estimator()
    estimate = estimator.step(estimator.initial().memory, np.array([*measured, 0.01, -0.02]))
    np.testing.assert_array_equal(estimate.memory, [0.01, -0.02, 1.0])
    action = law.act(measured, estimate)
    assert isinstance(action, Action)
    assert action.turn.shape == (2,)
    assert np.isfinite([*action.turn, action.feed]).all()
    forgotten = []
    law._policy.reset = lambda: forgotten.append(1)
    later = estimator.step(estimate.memory, np.array([*measured, 0.01, -0.02]))
    law.act(measured, later)
    assert not forgotten
    law.act(measured, estimate)
    assert forgotten
