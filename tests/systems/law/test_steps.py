"""The steps as functions: hand-worked values, and arguments that they leave as they are."""

import math

import numpy as np
import pytest

from models.scenario import Scenario
from systems.law import dc_motor, drive_monitor, force_guard, sensor_monitor, stepper_motor, watchdog
from systems.law.dc_motor import Drive, carriage_force, counted_travel, dc_motor_step
from systems.law.drive_monitor import drive_monitor_step
from systems.law.faults import Fault
from systems.law.force_guard import GuardLimits, StoppingModel, force_guard_step
from systems.law.limits import drive_limits, retract_limits, sensor_limits
from systems.law.sensor_monitor import sensor_monitor_step, sound_depth, sound_wrench
from systems.law.stepper_motor import Axis, equilibrium_angle, shaft_angles, stepper_step
from systems.law.watchdog import FEED, PITCH_RATE, is_blind, is_stopped, passed_command, watchdog_step
from systems.law.wrench_sensor import Sensor, wrench_at_tip, wrench_sensor_step

S = Scenario()
WRENCH, REST = np.array([1.0, -2.0, 3.0, 0.01, 0.02, -0.03]), np.zeros((3, 2))
DRIVE, AXIS, SENSOR = Drive.of(S.feed, period=2e-3), Axis.of(S.stepper, period=2e-3), Sensor.of(S.sensor)
GUARD = GuardLimits.of(S)
STOPPING = StoppingModel(period=1e-3, delay=7e-3, deceleration=9.0, feed_impact=1000.0, turn_impact=200.0)
STEPS = {
    "guard": lambda x: force_guard_step(GUARD, STOPPING, x, WRENCH, 0.01, 0.1, -0.1, 0.0, -0.01, False, False),
    "monitor": lambda x: sensor_monitor_step(sensor_limits(S), x, WRENCH, 0.001, 0.1),
    "drive": lambda x: drive_monitor_step(drive_limits(S), x, -0.01, WRENCH, 0.001, 0.4, 0.08),
    "watchdog": lambda x: watchdog_step(retract_limits(S), x, np.array([0.0, 9.0]), False, REST),
    "motor": lambda x: dc_motor_step(DRIVE, x, -0.01, 0.0, True),
    "stepper": lambda x: stepper_step(AXIS, x, 0.05, 0.0),
    "sensor": lambda x: wrench_sensor_step(SENSOR, x, WRENCH, np.zeros(6), np.zeros(12)),
}
SIZES = {
    "guard": force_guard.SIZE, "monitor": sensor_monitor.SIZE, "drive": drive_monitor.SIZE,
    "watchdog": watchdog.SIZE, "motor": dc_motor.SIZE, "stepper": stepper_motor.SIZE,
    "sensor": len(SENSOR.initial_state()),
}  # fmt: skip


@pytest.mark.parametrize("name", STEPS)
def test_a_step_returns_a_new_state_and_leaves_the_old_one(name):
    state = np.zeros(SIZES[name])
    found = STEPS[name](state)
    assert found.shape == state.shape
    assert not state.any()
    assert found.any()
    np.testing.assert_array_equal(STEPS[name](state), found)


def test_the_guard_by_hand():
    """At a load of 12.5 N, that has grown within a period, half of the commanded feed would be left, but for the look
    ahead; at rest before, with a = 9 m/s^2 and t = 7 ms."""
    limits, state = GUARD, np.zeros(force_guard.SIZE)
    wrench = np.array([0.0, 0.0, 11.0, 0.0, 0.0, 0.0])
    state[force_guard.LOAD] = 11.0
    found = force_guard_step(limits, STOPPING, state, wrench, 0.0, 0.0, 0.0, 0.0, -0.01, False, False)
    middle = 0.5 * (limits.soft_force + limits.hold_force)
    share = min((middle - 11.0) / (middle - limits.soft_force), (limits.force_limit - 11.0) / 10.0)
    assert found[force_guard.FEED_SPEED] == pytest.approx(-0.01 * share)
    assert found[force_guard.PEAK] == 11.0


def test_the_motor_by_hand():
    p, w = S.feed, S.feed.ratio * 0.01
    state = dc_motor_step(DRIVE, np.array([0.1, 0.0]), 0.0, 0.01, False)
    decay = math.exp(-p.resistance * 2e-3 / p.inductance)
    assert state[0] == pytest.approx(0.1 * decay - p.torque_constant * w / p.resistance * (1 - decay))
    friction = p.viscous_friction * w + p.coulomb_friction * math.tanh(w / dc_motor.FRICTION_SPEED)
    expected = p.ratio * (p.screw_efficiency * p.torque_constant * 0.2 - friction)
    assert carriage_force(DRIVE, 0.2, 0.01) == pytest.approx(expected)
    count = p.screw_lead / p.encoder_counts
    assert counted_travel(DRIVE, 7.4 * count) == pytest.approx(7 * count)


def test_the_stepper_by_hand():
    state = np.array([1.0, 0.0, 4.0, 8.0, 32.0])
    step = S.stepper.step_angle
    assert equilibrium_angle(AXIS, state) == pytest.approx(5 * step)
    resolution = S.stepper.encoder_resolution
    np.testing.assert_allclose(shaft_angles(AXIS, state, 3.4 * resolution), [step, 3 * resolution])
    np.testing.assert_array_equal(stepper_step(AXIS, state, step, 5 * step), state)  # at its target


def test_the_sensor_by_hand():
    state = SENSOR.initial_state()
    held = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = wrench_sensor_step(SENSOR, state, held, np.zeros(6), np.zeros(12))
    assert found[0] == pytest.approx(-S.sensor.blend)
    assert found[12] == pytest.approx(round(-S.sensor.blend * 16) / 16)
    np.testing.assert_allclose(wrench_at_tip(WRENCH, 0.08), [1.0, -2.0, 3.0, 0.01 + 0.16, 0.02 + 0.08, -0.03])


def test_what_goes_on_after_a_fault():
    limits, state = retract_limits(S), np.zeros(watchdog.SIZE)
    assert passed_command(limits, state, FEED, -0.01) == -0.01
    faults, shaft = np.array([float(Fault.SENSOR_STUCK), 0.0]), np.zeros((2, 2))
    state = watchdog_step(limits, state, faults, False, shaft)
    assert is_blind(state)
    assert passed_command(limits, state, FEED, -0.01) == limits.retract_speed
    assert passed_command(limits, state, PITCH_RATE, 0.1) == 0.0
    state[watchdog.SINCE] = limits.retract_time
    assert is_stopped(limits, state)
    assert passed_command(limits, state, FEED, -0.01) == 0.0
    state = np.zeros(watchdog.SIZE)
    state[watchdog.FAULT] = Fault.FEED_DEAD
    assert not is_blind(state)
    assert passed_command(limits, state, FEED, -0.01) == 0.0


def test_a_reading_that_is_not_finite_is_replaced_by_the_last_sound_one():
    limits = sensor_limits(S)
    state = sensor_monitor_step(limits, np.zeros(sensor_monitor.SIZE), WRENCH, 0.002, 0.1)
    lost = np.full(6, math.nan)
    np.testing.assert_array_equal(sound_wrench(limits, state, lost), WRENCH)
    assert sound_depth(state, math.nan) == 0.002
    assert sensor_monitor_step(limits, state, lost, 0.002, 0.1)[sensor_monitor.FAULT] == Fault.SENSOR_DISCONNECTED
