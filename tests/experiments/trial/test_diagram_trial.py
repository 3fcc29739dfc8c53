import json
import math
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import (
    HARD_FRICTION,
    HARD_PIVOT,
    HARD_TILT,
    TRIAL_STREAM,
    TrialSet,
    hard_tilt,
    trial_scenario,
)
from models.clearance import start_of_clearance
from models.scenario import Scenario, parse_scenario, resolve_scenario
from skill.features.measurement import contact_loads


@pytest.fixture(scope="module")
def inserted(skill):
    """One whole trial from a tilt of three degrees: scenario, result and run."""
    from tests.quick_scenario import make_quick_scenario

    scenario = make_quick_scenario()
    scenario.start.tilt = [0.04, -0.035]
    scenario.trial.time_limit = 8.0
    resolved = trial_scenario(scenario, number=1000)
    return resolved, *run_trial(resolved, skill, seed=1000)


def test_a_skill_trained_with_five_demonstrations_inserts(inserted):
    scenario, result, _ = inserted
    assert result.inserted
    assert result.reason == "inserted"
    assert result.depth == pytest.approx(scenario.full_depth, abs=1e-4)
    assert 0 < result.time < scenario.trial.time_limit
    assert result.seed == 1000
    assert result.tilt == tuple(scenario.start.tilt)


def test_the_result_agrees_with_the_recorded_samples(inserted):
    scenario, result, run = inserted
    s = run.samples
    last = s.iloc[-1]
    assert result.steps == last["pitch_taken"] + last["yaw_taken"]
    assert result.lost_steps == last["pitch_lost"] + last["yaw_lost"]
    assert result.lost_steps == 0
    assert (s["fault"] == 0).all()
    assert result.unsupported_time == pytest.approx(scenario.controller.period * (s["support"] < 1).sum())
    visited = [int(v) for v in s["state"]]
    assert list(result.states) == [v for k, v in enumerate(visited) if k == 0 or visited[k - 1] != v]
    # Peaks are those of the true contact at every step. The filtered and sampled sensor shows slightly lower ones.
    lateral = np.hypot(s["fx"], s["fy"]).max()
    noise = 5 * (scenario.sensor.force_bias + max(scenario.sensor.force_noise)) + scenario.sensor.force_quantum
    assert lateral - noise <= result.peak_lateral_force
    assert result.peak_lateral_force < 3 * lateral + 5
    loads = contact_loads(s[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(), scenario.geometry.peg_radius)
    assert loads.max() <= result.peak_measured_load < 2 * loads.max()  # the sensor is faster than the samples
    assert result.peak_load == pytest.approx(result.peak_measured_load, rel=0.5, abs=5.0)
    assert 1.0 < result.mean_load < result.peak_load
    assert result.trusted is (result.penetration <= 0.25 * scenario.geometry.clearance)
    assert run.result == result.record()


@pytest.mark.slow
def test_a_stuck_peg_is_jammed_when_the_time_runs_out(quick_scenario, skill):
    """The hole does not turn, so the peg stays wedged."""
    quick_scenario.controller.gain = 1e-9
    quick_scenario.start.tilt = [0.05, 0.0]
    quick_scenario.start.height = 1e-4
    quick_scenario.trial.time_limit = 1.6
    result, run = run_trial(trial_scenario(quick_scenario, number=0), skill, seed=0)
    assert (result.inserted, result.reason) == (False, "jammed")
    assert result.time == pytest.approx(1.6)
    assert run.result["reason"] == "jammed"


def test_the_record_suffices_to_repeat_the_trial(inserted, skill):
    scenario, _, run = inserted
    assert json.loads(json.dumps(run.metadata)) == run.metadata
    again = parse_scenario(run.metadata["scenario"], "record")
    assert again == scenario
    assert run.metadata["geometry"] == asdict(scenario.geometry)
    assert len(run.metadata["state_names"]) == skill.n_states
    assert {"drake", "numpy", "haptic-skill", "python"} <= set(run.metadata["versions"])
    assert scenario.seed == resolve_scenario(scenario, seed=1000, stream=TRIAL_STREAM).seed


def test_a_simulation_that_diverges_ends_its_trial(quick_scenario, skill):
    """The peg is so stiff that its contact forces are close to overflow."""
    quick_scenario.contact.modulus = 1e300
    quick_scenario.trial.time_limit = 0.5
    quick_scenario.start.height = 1e-4
    result, run = run_trial(trial_scenario(quick_scenario, number=0), skill, seed=0)
    assert not result.inserted
    assert result.reason.startswith("diverged")
    json.dumps(result.record(), allow_nan=False)
    assert np.isfinite(run.samples.to_numpy()).all()


@given(number=st.integers(0, 10**6))
def test_a_trial_of_the_hard_set_is_hard_and_one_of_the_scenario(number):
    scenario = Scenario()
    hard = trial_scenario(scenario, number=number, trial_set=TrialSet.HARD)
    assert math.hypot(*hard.start.tilt) > HARD_TILT
    assert max(map(abs, hard.start.tilt)) <= scenario.start.tilt_range
    assert HARD_PIVOT <= abs(hard.rig.pivot_height) <= scenario.rig.pivot_range
    assert HARD_FRICTION[0] <= hard.contact.friction <= HARD_FRICTION[1]
    assert trial_scenario(scenario, number=number, trial_set=TrialSet.HARD) == hard


def test_the_tilts_of_the_hard_set_follow_a_narrow_entrance():
    narrow, wide = Scenario(), Scenario()
    narrow.geometry.hole_radius, wide.geometry.hole_radius = 0.010025, 0.0102
    ratio = math.acos(0.010 / 0.010025) / math.acos(0.010 / 0.01005)
    assert hard_tilt(narrow) == pytest.approx(ratio * HARD_TILT)
    assert hard_tilt(Scenario()) == hard_tilt(wide) == HARD_TILT
    hard = trial_scenario(start_of_clearance(narrow), number=84001, trial_set=TrialSet.HARD)
    assert ratio * HARD_TILT < math.hypot(*hard.start.tilt) < math.acos(0.010 / 0.010025)


def test_the_hard_set_has_pivots_on_both_sides_and_all_directions_of_tilt():
    hard = [trial_scenario(Scenario(), number=n, trial_set=TrialSet.HARD) for n in range(40)]
    assert {np.sign(s.rig.pivot_height) for s in hard} == {-1.0, 1.0}
    assert {(s.start.tilt[0] > 0, s.start.tilt[1] > 0) for s in hard} == {(a, b) for a in (0, 1) for b in (0, 1)}


@pytest.mark.parametrize(("part", "name", "value"), [("start", "tilt_range", 0.04), ("rig", "pivot_range", 0.001)])
def test_a_scenario_without_hard_trials_has_no_hard_set(part, name, value):
    scenario = Scenario()
    setattr(getattr(scenario, part), name, value)
    with pytest.raises(ValueError, match="or no trial is a hard one"):
        trial_scenario(scenario, number=0, trial_set=TrialSet.HARD)
