"""The cost of the environment, measured in a short trial."""

import json

import pytest

from benchmarks.rig import gym_cost


@pytest.mark.slow
def test_the_environment_repeats_the_trials_and_costs_are_positive(monkeypatch, tmp_path, quick_scenario, skill_file):
    out = tmp_path / "cost.json"
    quick_scenario.trial.time_limit = 0.1
    make = gym_cost.gymnasium.make
    monkeypatch.setattr(gym_cost, "load_scenario", lambda: quick_scenario)
    monkeypatch.setattr(gym_cost.gymnasium, "make", lambda name, **k: make(name, scenario=quick_scenario, **k))
    gym_cost.main(skill=skill_file, trials=1, resets=2, json=out)
    found = json.loads(out.read_text())
    assert set(found) == {
        *("reset_ms", "kept_mb", "reset_share", "ratio", "ratio_labels"),
        *("step_ms", "step_labels_ms", "picture_ms", "run_trial_s", "machine_speed"),
    }
    assert min(value for name, value in found.items() if name != "kept_mb") > 0.0
