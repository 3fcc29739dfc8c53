"""Every fault, injected into a whole trial: the trial ends safely, and reports and records the fault.

The tests replace hardware or skill by a faulty one (`tests.systems.faulty_hardware`), or lock the feed.
"""

import numpy as np
import pytest

from experiments.trial.run_trial import run_trial, run_trials
from experiments.trial.trial_set import trial_scenario
from models.scenario import validate_scenario
from skill.data.outcome import Outcome
from skill.manipulation_skill import ManipulationSkill
from systems import rig as rig_module
from systems.law.depth_encoder import DepthEncoder
from systems.law.faults import FEED_NUMBERS, Fault, error_summary
from tests.systems.faulty_hardware import KINDS, injected

BEGIN = 0.12  # in units of s; the peg touches the chamfer by then
SAFE_FORCE = 48.0  # in units of N; 1.2 times the limit of the guard
RUNAWAY_FORCE = 100.0  # in units of N; a drive at its current limit is faster than any guard


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.start.tilt = [0.04, -0.035]
    quick_scenario.start.height = 2e-4
    quick_scenario.trial.time_limit = 2.5
    return trial_scenario(quick_scenario, number=7)


class RaisingSkill(ManipulationSkill):
    """Raises an exception when the peg is deeper than the mouth."""

    def act(self, measured, estimate=None):
        if measured[-1] < 1e-4:
            raise ZeroDivisionError("no such state\nand a second line")
        return super().act(measured, estimate)


def check_safe_ending(result, run, fault, *, retracts=True, within=2.0):
    """Checks that this fault ended the trial in time, without large forces, and with the peg retracted or at rest.

    A feed drive at fault is switched off: the carriage sinks onto the contact.
    """
    assert not result.inserted
    assert result.outcome is Outcome.FAULT
    assert result.fault is fault
    assert result.reason.startswith(fault.label)
    assert result.time < within
    limit = RUNAWAY_FORCE if fault in FEED_NUMBERS else SAFE_FORCE
    assert max(result.peak_axial_force, result.peak_lateral_force) < limit
    s = run.samples
    assert np.isfinite(s.to_numpy()).all()
    detected = s["fault"].to_numpy() == fault
    assert detected[-1]
    assert (s.loc[~detected, "fault"] == 0).all()
    after = s[detected]
    assert (after["feed_speed"] >= 0).all()  # never into the hole again
    # The hole turns no more, except where the force guard lets it yield.
    assert np.ptp(after[["target_pitch", "target_yaw"]].to_numpy(), axis=0).max() < np.radians(0.1)
    assert after["tip_z"].iloc[-1] >= after["tip_z"].iloc[0] - 5e-4 or not retracts
    assert run.result["reason"] == result.reason
    return after


NAMED_AT_ONCE = {  # kind: time from its beginning to its name, s
    **dict.fromkeys(("sensor stuck", "sensor saturated", "sensor disconnected"), 0.1),
    **dict.fromkeys(("encoder jumped by 4 mm", "encoder disconnected"), 0.05),
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "within"), NAMED_AT_ONCE.items(), ids=NAMED_AT_ONCE)
def test_a_sensor_that_fails_in_contact_is_named_at_once_and_the_peg_retracted(scenario, skill, name, within):
    with injected(name, onset=BEGIN):
        result, run = run_trial(scenario, skill, seed=7)
    (fault,) = KINDS[name].named
    after = check_safe_ending(result, run, fault)
    assert after["time"].iloc[0] - BEGIN < within
    assert after["tip_z"].iloc[-1] > after["tip_z"].iloc[0] + 1e-3


SOUND_SENSORS = {  # section, values
    "measures once in ten steps": ("sensor", {"period": 0.02, "delay": 0.02}),
    "has no noise": ("sensor", {"force_noise": [0.0] * 3, "torque_noise": [0.0] * 3, "force_drift": 0.0}),
    "is an encoder with coarse counts": ("rig", {"encoder_resolution": 0.5e-3}),
}


@pytest.mark.slow
@pytest.mark.parametrize(("section", "values"), SOUND_SENSORS.values(), ids=SOUND_SENSORS)
def test_a_sound_sensor_of_any_setting_raises_no_alarm(scenario, skill, section, values):
    for name, value in values.items():
        setattr(getattr(scenario, section), name, value)
    validate_scenario(scenario)
    scenario.start.height = 0.003  # in free motion first, at full speed
    scenario.trial.time_limit = 0.5
    _, run = run_trial(scenario, skill, seed=7)
    assert run.samples["depth"].iloc[-1] > 0.0  # in contact
    assert (run.samples["fault"] == Fault.NONE).all()


WHOLE_TRIALS = {  # when each begins, s
    **dict.fromkeys(("sensor bias 15 N, 1 N m", "sensor noise 5 N, 0.1 N m"), 0.0),
    **dict.fromkeys(("sensor spikes, ten a second", "sensor frozen, with noise", "encoder drift 2 mm/s"), 0.1),
    **dict.fromkeys(("encoder stuck", "feed runs away into the hole", "feed runs away upwards"), 0.1),
    **dict.fromkeys(("feed dead", "pitch blocked"), 0.1),
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "onset"), WHOLE_TRIALS.items(), ids=WHOLE_TRIALS)
def test_a_fault_of_each_kind_is_named_and_ends_a_trial_at_a_small_load(scenario, skill, name, onset):
    """Each begins before the peg is in the hole: a feed that runs away in there cannot be caught (docs/rig.md)."""
    scenario.start.height, scenario.trial.time_limit = 0.003, 4.0
    with injected(name, onset):
        result, run = run_trial(scenario, skill, seed=7)
    assert result.fault in KINDS[name].named
    # A dead drive lets the weight press the peg on, as the policy wants; only the first retraction shows it.
    within = 3.5 if name == "feed dead" else 2.0
    check_safe_ending(result, run, result.fault, retracts=result.fault not in FEED_NUMBERS, within=within)


@pytest.mark.slow
def test_one_spike_does_not_end_a_trial(scenario, skill):
    with injected("sensor, one spike", onset=0.3):
        _, run = run_trial(scenario, skill, seed=7)
    assert (run.samples["fault"] == Fault.NONE).all()


def test_an_exception_in_the_skill_ends_one_trial_and_not_the_batch(quick_scenario, skill_file):
    raising = RaisingSkill.load(skill_file)
    quick_scenario.start.tilt = [0.0, 0.0]
    quick_scenario.trial.time_limit = 2.0
    results = list(run_trials(quick_scenario, raising, [0, 1], jobs=1))
    for result, run in results:
        check_safe_ending(result, run, Fault.CONTROLLER_FAILED)
        assert result.reason == "controller failed: ZeroDivisionError: no such state"


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (KeyError("count"), "failed: KeyError: 'count'"),
        (RuntimeError(), "diverged: RuntimeError"),
    ],
)
def test_an_exception_in_the_simulation_ends_one_trial_and_not_the_batch(
    quick_scenario, skill, monkeypatch, error, reason
):
    class Broken(DepthEncoder):
        def _calc(self, context, output):
            super()._calc(context, output)
            if context.get_time() > 0.05:
                raise error

    monkeypatch.setattr(rig_module, "DepthEncoder", Broken)
    for result, run in run_trials(quick_scenario, skill, [0, 1], jobs=1):
        assert result.reason == run.result["reason"] == reason
        assert result.record()["time_s"] == pytest.approx(0.05, abs=2e-3)
        assert len(run.samples) >= 3


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (RuntimeError(), "RuntimeError"),
        (RuntimeError("\n  two\nthree"), "RuntimeError: two"),
        (ValueError("x" * 500), "ValueError: " + "x" * 120),
    ],
)
def test_an_exception_is_shortened_to_one_line(error, line):
    assert error_summary(error) == line
