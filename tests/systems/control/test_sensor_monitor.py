import math

import numpy as np
import pytest

from models.hardware import WrenchSensorParameters
from systems.control.faults import FALSE_ALARM, Fault, repeats_of_a_stuck_sensor
from systems.control.sensor_monitor import SensorMonitor
from systems.hardware.wrench_sensor import wrench_at_tip
from tests.stepping import fixed_context, update

SENSOR = WrenchSensorParameters()
TOP_SPEED, RESOLUTION = 0.4, 5e-6


@pytest.fixture
def dut():
    return SensorMonitor(sensor=SENSOR, top_speed=TOP_SPEED, resolution=RESOLUTION)


def sample(k):
    """A sound sensor is never twice the same for long."""
    return np.array([0.1 * math.sin(k), 0.2, -1.0 + 0.01 * k, 0.0, 0.01, 0.0])


def show(dut, context, wrench, depth=0.001):
    """One sample; returns what is passed on before the update, and the fault after it."""
    dut.GetInputPort("raw_wrench").FixValue(context, wrench)
    dut.GetInputPort("raw_depth").FixValue(context, [depth])
    passed = dut.GetOutputPort("wrench").Eval(context).copy(), dut.GetOutputPort("depth").Eval(context)[0]
    update(dut, context, period=SENSOR.period)
    return *passed, dut.GetOutputPort("fault").Eval(context)[0]


def started(dut):
    context = fixed_context(dut)
    for k in range(5):
        show(dut, context, sample(k))
    return context


def test_what_is_sound_is_passed_on_at_once(dut):
    context = fixed_context(dut)
    for k in range(50):
        wrench, depth, fault = show(dut, context, sample(k), 0.001 + 1e-4 * k)
        np.testing.assert_array_equal(wrench, sample(k))
        assert (depth, fault) == (0.001 + 1e-4 * k, Fault.NONE)


@pytest.mark.parametrize(
    ("wrench", "depth", "fault"),
    [
        (np.full(6, math.nan), 0.001, Fault.SENSOR_DISCONNECTED),
        ([0, 0, math.inf, 0, 0, 0], 0.001, Fault.SENSOR_DISCONNECTED),
        (sample(9), math.nan, Fault.ENCODER_DISCONNECTED),
        (sample(9), 0.001 + 1.01 * (TOP_SPEED * SENSOR.period + RESOLUTION), Fault.ENCODER_JUMPED),
        (sample(9), 0.001 - 1.01 * (TOP_SPEED * SENSOR.period + RESOLUTION), Fault.ENCODER_JUMPED),
        (sample(9), 0.001 + 0.99 * (TOP_SPEED * SENSOR.period + RESOLUTION), Fault.NONE),
    ],
)
def test_what_is_not_is_named_and_the_last_sound_measurement_is_held(dut, wrench, depth, fault):
    context = started(dut)
    passed, passed_depth, found = show(dut, context, wrench, depth)
    assert found == fault
    assert np.isfinite([*passed, passed_depth]).all()
    held, held_depth, still = show(dut, context, sample(10), 0.0011)
    assert still == fault  # it stays, whatever comes
    if fault != Fault.NONE:
        np.testing.assert_array_equal(held, sample(4))
        assert held_depth == 0.001


@pytest.mark.parametrize("channel", range(6))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_channel_of_the_sensor_has_its_end(channel, sign):
    """The reading is that at the mount; what is passed on is moved to the tip, where a force has a lever."""
    ends = np.array([*SENSOR.force_range, *SENSOR.torque_range])
    quanta = np.repeat([SENSOR.force_quantum, SENSOR.torque_quantum], 3)
    for steps, fault in ((0, Fault.SENSOR_SATURATED), (1, Fault.NONE)):
        dut = SensorMonitor(sensor=SENSOR, top_speed=TOP_SPEED, resolution=RESOLUTION)
        reading = np.zeros(6)
        reading[channel] = sign * (np.floor(ends[channel] / quanta[channel]) - steps) * quanta[channel]
        assert show(dut, started(dut), wrench_at_tip(reading, SENSOR.height))[2] == fault


def test_a_sensor_that_repeats_itself_longer_than_its_noise_allows_is_stuck(dut):
    maximum = repeats_of_a_stuck_sensor(SENSOR)
    context = started(dut)
    for k in range(maximum + 1):
        assert show(dut, context, sample(9))[2] == Fault.NONE, k
    assert show(dut, context, sample(9))[2] == Fault.SENSOR_STUCK


def test_how_long_that_is_follows_from_noise_and_quantum():
    assert 5 <= repeats_of_a_stuck_sensor(SENSOR) <= 30
    fine = WrenchSensorParameters(force_quantum=1e-6)
    assert repeats_of_a_stuck_sensor(fine) <= 2
    quiet = WrenchSensorParameters(force_noise=[0.0] * 3, torque_noise=[0.0] * 3)
    assert repeats_of_a_stuck_sensor(quiet) == math.inf  # it may repeat itself for ever


def test_a_real_sensor_at_rest_repeats_itself_no_more_often_than_the_bound_says():
    """The worst place of the true value, the middle of a quantum, on every channel: runs of n repeats."""
    rng = np.random.default_rng(3)
    sigma = np.array([*SENSOR.force_noise, *SENSOR.torque_noise])
    quantum = np.repeat([SENSOR.force_quantum, SENSOR.torque_quantum], 3)
    readings = np.round(sigma * rng.standard_normal((200_000, 6)) / quantum)
    same = (np.diff(readings, axis=0) == 0).all(axis=1)
    bound = math.exp(math.log(FALSE_ALARM) / (repeats_of_a_stuck_sensor(SENSOR) - 1))
    for n in (1, 2, 3):
        runs = np.lib.stride_tricks.sliding_window_view(same, n).all(axis=1).mean()
        assert 0 < runs <= 1.3 * bound**n
