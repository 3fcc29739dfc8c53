"""The steps as functions: hand-worked values, and arguments that they leave as they are."""

import numpy as np
import pytest

from models.scenario import Scenario
from systems.law import dc_motor, drive_monitor, force_guard, sensor_monitor, stepper_motor, watchdog
from systems.law.dc_motor import Drive, dc_motor_step
from systems.law.drive_monitor import DriveLimits, drive_monitor_step
from systems.law.force_guard import GuardLimits, StoppingModel, force_guard_step
from systems.law.sensor_monitor import SensorLimits, sensor_monitor_step
from systems.law.stepper_motor import Axis, stepper_step
from systems.law.watchdog import RetractLimits, watchdog_step
from systems.law.wrench_sensor import Sensor, wrench_sensor_step

S = Scenario()
WRENCH, REST = np.array([1.0, -2.0, 3.0, 0.01, 0.02, -0.03]), np.zeros((3, 2))
DRIVE, AXIS, SENSOR = Drive.of(S.feed, period=2e-3), Axis.of(S.stepper, period=2e-3), Sensor.of(S.sensor)
GUARD = GuardLimits.of(S)
STOPPING = StoppingModel(period=1e-3, delay=7e-3, deceleration=9.0, feed_impact=1000.0, turn_impact=200.0)
STEPS = {
    "guard": lambda x: force_guard_step(GUARD, STOPPING, x, WRENCH, 0.01, 0.1, -0.1, 0.0, -0.01, False, False),
    "monitor": lambda x: sensor_monitor_step(SensorLimits.of(S), x, WRENCH, 0.001, 0.1),
    "drive": lambda x: drive_monitor_step(DriveLimits.of(S), x, -0.01, WRENCH, 0.001, 0.4, 0.08),
    "watchdog": lambda x: watchdog_step(RetractLimits.of(S), x, np.array([0.0, 9.0]), False, REST),
    "motor": lambda x: dc_motor_step(DRIVE, x, -0.01, 0.0, True),
    "stepper": lambda x: stepper_step(AXIS, x, 0.05, 0.0),
    "sensor": lambda x: wrench_sensor_step(SENSOR, x, WRENCH, np.zeros(6), np.zeros(12)),
}
SIZES = {
    "guard": force_guard.SIZE, "monitor": sensor_monitor.SIZE, "drive": drive_monitor.SIZE,
    "watchdog": watchdog.SIZE, "motor": dc_motor.SIZE, "stepper": stepper_motor.SIZE,
    "sensor": len(SENSOR.initial_state()),
}  # fmt: skip


def test_the_drift_of_a_sensor_is_a_random_walk():
    """Steps of delta sqrt(T) w, with delta 0.02 N/sqrt(s) and T 1 ms; the readings are far from it."""
    drifting = SENSOR._replace(drift=0.02 * np.sqrt(1e-3) * np.ones(6), quantum=np.full(6, 1e-12))
    state, quiet = SENSOR.initial_state(), np.zeros(12)
    for w in (1.0, -3.0):
        quiet[6:] = w
        state = wrench_sensor_step(drifting, state, np.zeros(6), np.zeros(6), quiet)
    np.testing.assert_allclose(state[6:12], -2.0 * 0.02 * np.sqrt(1e-3))
    np.testing.assert_allclose(state[12:18], state[6:12])


@pytest.mark.parametrize("name", STEPS)
def test_a_step_returns_a_new_state_and_leaves_the_old_one(name):
    state = np.zeros(SIZES[name])
    found = STEPS[name](state)
    assert found.shape == state.shape
    assert not state.any()
    assert found.any()
    np.testing.assert_array_equal(STEPS[name](state), found)
