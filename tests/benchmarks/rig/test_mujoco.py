"""The comparison of the engines in trials of the rig."""

import pytest

pytest.importorskip("mujoco", reason="needs the extra [peers]")

from benchmarks.rig.mujoco import agreement, compare, show, summary
from experiments.trial import trial_scenario
from systems.plant.mujoco_model import MujocoContact


def row(**changes):
    values = {"inserted": True, "reason": "inserted", "time_s": 2.0, "depth_mm": 25.0, "peak_load_n": 10.0}
    return values | {"peak_contact_n": 8.0, "mean_load_n": 5.0, "penetration_um": 15.0} | changes


def test_agreement_counts_outcomes_and_compares_insertions():
    trials = [
        {"a": row(), "b": row(time_s=2.5)},
        {"a": row(), "b": row(inserted=False, reason="jammed", depth_mm=5.0)},
    ]
    found = agreement(trials, "a", "b")
    assert (found["agreed"], found["same_reason"], found["trials"]) == (1, 1, 2)
    assert found["median_difference"]["time_s"] == pytest.approx(0.5)
    assert found["largest_depth_difference_mm"] == pytest.approx(20.0)


@pytest.mark.slow
def test_a_trial_is_performed_in_both_engines(quick_scenario, skill, capsys):
    quick_scenario.start.tilt = [0.04, -0.035]
    quick_scenario.trial.time_limit = 0.4
    trial = compare(trial_scenario(quick_scenario, number=1000), skill, MujocoContact(), 1000)
    show("skill", summary([trial]))
    text = capsys.readouterr().out
    assert "same outcome in 1 of 1 trials" in text
    for column in ("drake", "mujoco", "again"):
        assert trial[column]["cpu_s"] > 0.0
        assert trial[column]["peak_contact_n"] > 1.0
        assert 0.0 < trial[column]["time_s"] <= 0.4
    assert trial["mujoco"]["physics_ms"] > 0.0
