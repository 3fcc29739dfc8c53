"""Reinforcement learning beside the skill: the wrapped environment, the table and the figure."""

import pickle

import numpy as np
import pytest

from benchmarks.rig import reinforcement
from benchmarks.rig.control_laws import StraightPush
from skill.states.estimate import Estimate

ROW = {"trials": 4, "inserted": 1, "reward": 0.5, "depth_mm": 9.0}
ROW |= {"peak_measured_load_n": 14.0, "reasons": ["inserted", "jammed", "jammed", "time over"]}


def test_networks_see_a_scaled_measurement_and_act_within_one():
    env = reinforcement.learning_environment("nominal")
    assert env.action_space.low.tolist() == [-1.0] * 3
    assert env.action_space.high.tolist() == [1.0] * 3
    observation, _ = env.reset(seed=88000)
    assert observation in env.observation_space
    assert observation[6] == pytest.approx(0.3, abs=1e-3)  # 3 mm above the mouth, over 10 mm
    for _ in range(2):
        env.step(np.array([0.0, 0.0, -0.5]))
    assert env.unwrapped.action_space.high[2] == 0.030


def test_a_law_turns_shares_of_the_largest_rates_into_turns_of_a_period():
    class Networks:
        def predict(self, observation, deterministic):
            assert deterministic
            assert observation == pytest.approx([1.0, 0.0, 0.0, 0.0, 2.0, 0.0, -0.5])
            return np.array([1.0, -0.5, -1.0]), None

    law = reinforcement.LearntLaw(Networks(), np.array([0.21, 0.21, 0.030]))
    action = law.act([10.0, 0.0, 0.0, 0.0, 0.2, 0.0, -0.005], Estimate())
    assert action.turn == pytest.approx([0.0042, -0.0021])  # in 20 ms
    assert action.feed == pytest.approx(-0.0006)


def test_evaluations_have_trials_of_their_own(monkeypatch):
    numbers = []

    def episode(env, agent, *, trial):
        numbers.append(trial)
        record = {"inserted": trial == 89000, "reason": "inserted"}
        return 0.5, {"trial": record | dict.fromkeys(("depth_mm", "peak_measured_load_n"), 1.0)}

    monkeypatch.setattr(reinforcement, "run_episode", episode)
    row = reinforcement.evaluate("nominal", StraightPush(0.01), 3)
    assert numbers == [89000, 89001, 89002]
    assert (row["inserted"], row["reward"]) == (1, 0.5)


def test_the_table_and_the_figure_show_the_curve_and_the_references(tmp_path, capsys):
    curve = [{"steps": 0, **ROW}, {"steps": 100, **ROW, "inserted": 2}]
    reinforcement.show(curve, {"skill": ROW | {"inserted": 4}})
    text = capsys.readouterr().out
    assert "skill" in text
    assert "100" in text
    path = tmp_path / "curve.svg"
    reinforcement.draw(curve, {"skill": ROW}, path)
    assert path.read_text().startswith("<?xml")


@pytest.mark.slow
def test_a_short_training_yields_a_row_before_and_after(quick_scenario):
    pytest.importorskip("stable_baselines3", reason="needs the extra [rl]")
    quick_scenario.trial.time_limit = 0.1
    rows = list(reinforcement.learn(quick_scenario, steps=20, every=20, seed=0))
    assert [steps for _, steps, _ in rows] == [0, 20]
    assert rows[1][2] > 0.0
    law = pickle.loads(pickle.dumps(rows[1][0]))  # as a sweep stores it
    assert reinforcement.evaluate(quick_scenario, law, trials=1)["reasons"] == ["time over"]
