"""Reinforcement learning beside the skill: the wrapped environment, the table and the figure."""

import numpy as np
import pytest

from benchmarks.rig import reinforcement

ROW = {"trials": 4, "inserted": 1, "reward": 0.5, "depth_mm": 9.0}
ROW |= {"peak_measured_load_n": 14.0, "reasons": ["inserted", "jammed", "jammed", "time over"]}


def test_observations_and_actions_are_scaled_for_the_networks():
    env = reinforcement.learning_environment("nominal")
    assert env.action_space.low.tolist() == [-1.0] * 3
    assert env.action_space.high.tolist() == [1.0] * 3
    observation, _ = env.reset(seed=88000)
    assert observation in env.observation_space
    # The order is that of the flat observation: angles, control, depth, feed, wrench.
    assert observation[4] == pytest.approx(-0.3, abs=1e-3)  # 3 mm above the mouth, over 10 mm
    for _ in range(2):
        observation, *_ = env.step(np.array([0.0, 0.0, -0.5]))
    assert observation[5] == pytest.approx(-0.5, abs=1e-6)  # half the largest feed


def test_evaluations_have_trials_of_their_own(monkeypatch):
    numbers = []

    def episode(env, agent, *, trial):
        numbers.append(trial)
        record = {"inserted": trial == 89000, "reason": "inserted"}
        return 0.5, {"trial": record | dict.fromkeys(("depth_mm", "peak_measured_load_n"), 1.0)}

    monkeypatch.setattr(reinforcement, "run_episode", episode)
    row = reinforcement.evaluate(None, None, 3)
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
    rows = list(reinforcement.learn(quick_scenario, steps=20, every=20, trials=1, seed=0))
    assert [row["steps"] for row in rows] == [0, 20]
    assert rows[1]["train_cpu_s"] > 0.0
    assert rows[0]["reasons"] == ["time over"]
