"""A run and its result agree, or the file is refused."""

import numpy as np
import pytest

from skill.data.rig_run import RigRun, read_rig_run, write_rig_run
from tests.crafted_files import rewrite
from tests.trajectories import make_rig_run

RESULT = {
    **{"seed": 3, "inserted": True, "reason": "inserted", "time_s": 2.4, "depth_mm": 24.7},
    **{"peak_axial_n": 3.0, "peak_lateral_n": 3.0, "peak_moment_nm": 0.1, "penetration_um": 1.0},
    **{"lost_steps": 0, "back_offs": 1, "unknown_s": 0.0, "unsupported_s": 0.0},
}


@pytest.fixture
def path(tmp_path):
    run = make_rig_run()
    last = run.samples.iloc[-1]
    steps = int(last["pitch_taken"] + last["yaw_taken"])
    path = tmp_path / "run.parquet"
    write_rig_run(RigRun(run.samples, {**RESULT, "steps": steps, "states": [0, 1, 3, 2, 3]}, run.metadata), path)
    return path


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"time_s": 2.5}, "'time_s' of the result is 2.5, but the samples show 2.38 to 2.4"),
        ({"time_s": 2.3}, "'time_s' of the result is 2.3, but"),
        ({"depth_mm": 20.0}, "'depth_mm' of the result is 20, but the samples show 23.6033 to 25.7967"),
        ({"depth_mm": 0.0247}, "'depth_mm' of the result is 0.0247, but"),
        ({"steps": 1}, "'steps' of the result is 1, but the samples show"),
        ({"lost_steps": 1}, "'lost_steps' of the result is 1, but the samples show 0"),
        ({"back_offs": 0}, "'back_offs' of the result is 0, but the samples show 1"),
        ({"unknown_s": 0.02}, "'unknown_s' of the result is 0.02, but the samples show 0"),
        ({"unsupported_s": 0.1}, "'unsupported_s' of the result is 0.1, but the samples show 0"),
        ({"states": [0, 1, 3]}, "'states' of the result is [0, 1, 3], but the samples show [0, 1, 3, 2, 3]"),
        ({"inserted": False}, "'inserted' of the result is False, but the reason is 'inserted'"),
        ({"reason": "jammed"}, "'inserted' of the result is True, but the reason is 'jammed'"),
        ({"reason": 3}, "'reason' of the result is 3, expected a text"),
        ({"inserted": "false"}, "'inserted' of the result is 'false', expected true or false"),
        ({"time_s": "2.4"}, "'time_s' of the result is '2.4', expected a number"),
        ({"steps": True}, "'steps' of the result is True, expected a number"),
        ({"peak_axial_n": None}, "'peak_axial_n' of the result is None, expected a number"),
        ({"depth_mm": float("nan")}, "'depth_mm' of the result is nan, expected a finite number"),
    ],
)
def test_a_result_that_contradicts_the_samples_is_refused(path, entry, message):
    result = {**read_rig_run(path).result, **entry}
    with pytest.raises(ValueError, match=r"run\.parquet: ") as caught:
        read_rig_run(rewrite(path, "rig_run", result=result))
    assert message in str(caught.value)


def test_samples_that_were_cut_off_contradict_the_result(path):
    with pytest.raises(ValueError, match=r"'time_s' of the result is 2\.4, but"):
        read_rig_run(rewrite(path, "rig_run", lambda s: s.head(100)))


def test_rounding_and_the_time_to_the_next_sample_are_allowed(path):
    for time in (2.38, 2.391, 2.4):
        read_rig_run(rewrite(path, "rig_run", result={**read_rig_run(path).result, "time_s": time}))


@pytest.mark.parametrize("outcome", ["a fault", "diverged", "none", "no sample"])
def test_runs_that_end_early_agree_with_their_results(skill, tmp_path, outcome, monkeypatch):
    from experiments.trial.run_trial import run_trial
    from models.scenario import TRIAL_STREAM, resolve_scenario
    from tests.quick_scenario import make_quick_scenario

    scenario = make_quick_scenario()
    scenario.trial.time_limit = 0.3
    if outcome == "a fault":  # every reading is beyond the range of the sensor
        scenario.sensor.force_range, scenario.sensor.force_quantum = [1e-3, 1e-3, 1e-3], 1e-5
    elif outcome == "diverged":
        monkeypatch.setattr("experiments.trial.diagram_trial.DIVERGENCE_FORCE", 0.5)
    elif outcome == "no sample":
        scenario.trial.time_limit = 1e-3
    result, run = run_trial(resolve_scenario(scenario, seed=0, stream=TRIAL_STREAM), skill, seed=0)
    write_rig_run(run, tmp_path / "run.parquet")
    assert read_rig_run(tmp_path / "run.parquet").result == result.record()
    expected = {"a fault": "sensor saturated", "diverged": "diverged: a contact force of", "none": "time over"}
    assert result.reason.startswith(expected.get(outcome, "time over"))
    assert len(run.samples) == 1 or outcome != "no sample"
    assert np.isfinite(run.samples.to_numpy()).all()
