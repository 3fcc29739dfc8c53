"""Every fault that the rig may have, injected into a whole trial: it ends safely, is named, and is recorded.

The faults are put in from outside: a sensor, encoder or skill of the test's own takes the place of the sound one, or a
joint of the plant is locked.
"""

import math

import numpy as np
import pytest

from skill.data.outcome import Outcome
from skill.manipulation_skill import ManipulationSkill
from systems import rig as rig_module
from systems.control.faults import Fault
from systems.hardware.depth_encoder import DepthEncoder
from systems.hardware.wrench_sensor import WrenchSensor
from systems.runs import trial as trial_module
from systems.runs.trial import TrialMonitor, run_trial, run_trials, trial_scenario

BEGIN = 0.12  # in units of s; the peg touches the chamfer by then
SAFE_FORCE = 60.0  # in units of N; the guard is at 50 N of load


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.start.tilt = [0.04, -0.035]
    quick_scenario.start.height = 2e-4
    quick_scenario.trial.time_limit = 2.5
    return trial_scenario(quick_scenario, number=7)


def faulty_sensor(change):
    """A `WrenchSensor` whose output is ``change`` of (the sound wrench, a dictionary) from `BEGIN` on."""

    class FaultySensor(WrenchSensor):
        def __init__(self, **arguments):
            super().__init__(**arguments)
            self.memory = {}

        def _calc_wrench(self, context, output):
            super()._calc_wrench(context, output)
            if context.get_time() >= BEGIN:
                output.SetFromVector(change(output.value().copy(), self.memory))

    return FaultySensor


def faulty_encoder(change):
    """The same of a `DepthEncoder`."""

    class FaultyEncoder(DepthEncoder):
        def __init__(self, **arguments):
            super().__init__(**arguments)
            self.memory = {}

        def _calc(self, context, output):
            super()._calc(context, output)
            if context.get_time() >= BEGIN:
                output[0] = change(output[0], self.memory)

    return FaultyEncoder


def stuck(reading, memory):
    return memory.setdefault("reading", reading)


def saturated(wrench, _):
    return np.array([*wrench[:2], 290.0, *wrench[3:]])


def disconnected(wrench, _):
    return np.full(6, math.nan)


def half_disconnected(wrench, _):
    return np.array([wrench[0], math.nan, *wrench[2:]])


class LockedMonitor(TrialMonitor):
    """Locks a joint at `BEGIN`: what it carries does not move any more."""

    joint = "feed"

    def __call__(self, context):
        if context.get_time() >= BEGIN - 1e-9:
            plant = self._rig.contact.plant
            joint = plant.GetJointByName(self.joint)
            own = plant.GetMyMutableContextFromRoot(context)
            if not joint.is_locked(own):
                joint.Lock(own)
        return super().__call__(context)


class Clumsy(ManipulationSkill):
    """Raises once the peg is deeper than the mouth."""

    def act(self, measured, probabilities=None):
        if measured[-1] < 1e-4:
            raise ZeroDivisionError("no such state\nand a second line")
        return super().act(measured, probabilities)


def ends_safely(result, run, fault):
    """The trial was ended by this fault, in time, without force, with the peg drawn back or at rest."""
    assert not result.inserted
    assert result.outcome is Outcome.FAULT
    assert result.fault is fault
    assert result.reason.startswith(fault.label)
    assert result.time < 2.0
    assert max(result.peak_axial_force, result.peak_lateral_force) < SAFE_FORCE
    s = run.samples
    assert np.isfinite(s.to_numpy()).all()
    noticed = s["fault"].to_numpy() == fault
    assert noticed[-1]
    assert (s.loc[~noticed, "fault"] == 0).all()
    after = s[noticed]
    assert (after["feed_speed"] >= 0).all()  # never into the hole again
    assert after["target_pitch"].nunique() == after["target_yaw"].nunique() == 1
    assert after["tip_z"].iloc[-1] >= after["tip_z"].iloc[0] - 5e-4
    assert run.result["reason"] == result.reason
    return after


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (stuck, Fault.SENSOR_STUCK),
        (saturated, Fault.SENSOR_SATURATED),
        (disconnected, Fault.SENSOR_DISCONNECTED),
        (half_disconnected, Fault.SENSOR_DISCONNECTED),
    ],
)
def test_a_faulty_sensor(scenario, skill, monkeypatch, change, fault):
    monkeypatch.setattr(rig_module, "WrenchSensor", faulty_sensor(change))
    result, run = run_trial(scenario, skill, seed=7)
    after = ends_safely(result, run, fault)
    assert after["time"].iloc[0] - BEGIN < 0.1
    assert after["tip_z"].iloc[-1] > after["tip_z"].iloc[0] + 1e-3  # drawn back


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (lambda depth, _: depth + 0.004, Fault.ENCODER_JUMPED),
        (lambda depth, _: depth - 0.004, Fault.ENCODER_JUMPED),
        (lambda depth, _: math.nan, Fault.ENCODER_DISCONNECTED),
    ],
)
def test_a_faulty_depth_encoder(scenario, skill, monkeypatch, change, fault):
    monkeypatch.setattr(rig_module, "DepthEncoder", faulty_encoder(change))
    result, run = run_trial(scenario, skill, seed=7)
    after = ends_safely(result, run, fault)
    assert after["time"].iloc[0] - BEGIN < 0.05
    assert after["tip_z"].iloc[-1] > after["tip_z"].iloc[0] + 1e-3


def test_a_depth_encoder_that_stands_still(scenario, skill, monkeypatch):
    scenario.start.height = 0.02  # in free motion
    monkeypatch.setattr(rig_module, "DepthEncoder", faulty_encoder(stuck))
    result, run = run_trial(scenario, skill, seed=7)
    ends_safely(result, run, Fault.ENCODER_STUCK)


@pytest.mark.parametrize("height", [2e-4, 0.01])
def test_a_stalled_motor(scenario, skill, monkeypatch, height):
    scenario.start.height = height
    monkeypatch.setattr(trial_module, "TrialMonitor", LockedMonitor)
    result, run = run_trial(scenario, skill, seed=7)
    after = ends_safely(result, run, Fault.MOTOR_STALLED)
    assert np.ptp(after["tip_z"]) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("joint", "fault"), [("pitch", Fault.PITCH_STEPS_LOST), ("yaw", Fault.YAW_STEPS_LOST)])
def test_a_blocked_stepper(scenario, skill, monkeypatch, joint, fault):
    monkeypatch.setattr(LockedMonitor, "joint", joint)
    monkeypatch.setattr(trial_module, "TrialMonitor", LockedMonitor)
    result, run = run_trial(scenario, skill, seed=7)
    ends_safely(result, run, fault)
    assert result.lost_steps >= 4


def test_a_skill_that_raises_ends_its_own_trial_and_not_the_batch(quick_scenario, skill_file):
    clumsy = Clumsy.load(skill_file)
    quick_scenario.start.tilt = [0.0, 0.0]
    quick_scenario.trial.time_limit = 2.0
    results = list(run_trials(quick_scenario, clumsy, [0, 1], jobs=1))
    for result, run in results:
        ends_safely(result, run, Fault.CONTROLLER_FAILED)
        assert result.reason == "controller failed: ZeroDivisionError: no such state"


def test_a_simulation_that_fails_ends_its_own_trial_and_not_the_batch(quick_scenario, skill, monkeypatch):
    class Broken(DepthEncoder):
        def _calc(self, context, output):
            super()._calc(context, output)
            if context.get_time() > 0.05:
                raise KeyError("count")

    monkeypatch.setattr(rig_module, "DepthEncoder", Broken)
    for result, run in run_trials(quick_scenario, skill, [0, 1], jobs=1):
        assert result.reason == "failed: KeyError: 'count'"
        assert result.record()["time_s"] == pytest.approx(0.05, abs=2e-3)
        assert len(run.samples) >= 3


def test_the_fault_is_named_even_if_the_time_runs_out_first(scenario, skill, monkeypatch):
    monkeypatch.setattr(rig_module, "WrenchSensor", faulty_sensor(disconnected))
    scenario.trial.time_limit = BEGIN + 0.1
    result, _ = run_trial(scenario, skill, seed=7)
    assert result.reason == "sensor disconnected"
