"""The steps as functions: hand-worked values, and arguments that they leave as they are."""

import numpy as np
import pytest

from models.scenario import Scenario
from systems.law import dc_motor, drive_monitor, force_guard, sensor_monitor, stepper_motor, watchdog
from systems.law.dc_motor import Drive, dc_motor_step
from systems.law.drive_monitor import drive_monitor_step
from systems.law.force_guard import GuardLimits, StoppingModel, force_guard_step
from systems.law.limits import drive_limits, retract_limits, sensor_limits
from systems.law.sensor_monitor import sensor_monitor_step
from systems.law.stepper_motor import Axis, stepper_step
from systems.law.watchdog import watchdog_step
from systems.law.wrench_sensor import Sensor, wrench_sensor_step

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
