"""The cost of the environment, measured in a short trial."""

import json

import pytest

from benchmarks.rig import gym_cost


@pytest.mark.slow
def test_costs_are_positive(monkeypatch, tmp_path, quick_scenario, skill_file):
    out = tmp_path / "cost.json"
    quick_scenario.trial.time_limit = 0.1
    make = gym_cost.gymnasium.make
    monkeypatch.setattr(gym_cost, "load_scenario", lambda: quick_scenario)
    monkeypatch.setattr(gym_cost.gymnasium, "make", lambda name, **k: make(name, scenario=quick_scenario, **k))
    gym_cost.main(skill=skill_file, trials=1, resets=2, json=out)
    found = json.loads(out.read_text())
    assert set(found) == {*("reset_ms", "picture_ms", "trial_s", "ratio", "ratio_labels", "step_ms", "machine_speed")}
    assert min(found.values()) > 0.0
