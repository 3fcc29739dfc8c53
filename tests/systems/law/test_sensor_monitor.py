import math

import numpy as np
import pytest

from models.hardware import WrenchSensorParameters
from models.scenario import Scenario, load_scenario
from systems.law.faults import Fault
from systems.law.sensor_monitor import SensorLimits, SensorMonitor, repeats_of_a_stuck_sensor
from systems.law.wrench_sensor import wrench_at_tip
from tests.stepping import fixed_context, update

SENSOR = WrenchSensorParameters()
TOP_SPEED, RESOLUTION = Scenario().feed.no_load_speed, 5e-6
SIGNED = [(channel, (-1.0) ** channel) for channel in range(6)]


@pytest.fixture
def dut():
    return make_monitor()


def make_monitor(sensor=SENSOR, depth_period=SENSOR.period, free_depth=-math.inf):
    scenario = Scenario(sensor=sensor)
    scenario.contact.time_step, scenario.controller.guard.force_limit = depth_period, 50.0
    limits = SensorLimits.of(scenario)._replace(free_depth=free_depth)
    return SensorMonitor(limits=limits, period=sensor.period)


def sample(k):
    """Returns a wrench that differs from sample to sample."""
    return np.array([0.1 * math.sin(k), 0.2, -1.0 + 0.01 * k, 0.0, 0.01, 0.0])


def sample_once(dut, context, wrench, depth=0.001):
    """Performs one sample; returns wrench and depth before the update, and the fault after it."""
    dut.GetInputPort("raw_wrench").FixValue(context, wrench)
    dut.GetInputPort("raw_depth").FixValue(context, [depth])
    passed = dut.GetOutputPort("wrench").Eval(context).copy(), dut.GetOutputPort("depth").Eval(context)[0]
    update(dut, context, period=SENSOR.period)
    return *passed, dut.GetOutputPort("fault").Eval(context)[0]


def started(dut):
    context = fixed_context(dut)
    for k in range(5):
        sample_once(dut, context, sample(k))
    return context


def test_sound_measurements_are_passed_on_at_once(dut):
    context = fixed_context(dut)
    for k in range(50):
        wrench, depth, fault = sample_once(dut, context, sample(k), 0.001 + 1e-4 * k)
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
def test_a_fault_is_reported_and_the_last_sound_measurement_is_held(dut, wrench, depth, fault):
    context = started(dut)
    passed, passed_depth, found = sample_once(dut, context, wrench, depth)
    assert found == fault
    assert np.isfinite([*passed, passed_depth]).all()
    held, held_depth, still = sample_once(dut, context, sample(10), 0.0011)
    assert still == fault  # it stays
    if fault != Fault.NONE:
        np.testing.assert_array_equal(held, sample(4))
        assert held_depth == 0.001


@pytest.mark.parametrize(("channel", "sign"), SIGNED)
def test_each_channel_saturates_at_the_end_of_its_range(channel, sign):
    """The range applies to the reading at the mount; the monitor receives the wrench about the tip."""
    ends = np.array([*SENSOR.force_range, *SENSOR.torque_range])
    quanta = np.repeat([SENSOR.force_quantum, SENSOR.torque_quantum], 3)
    for steps, fault in ((0, Fault.SENSOR_SATURATED), (1, Fault.NONE)):
        dut = make_monitor()
        reading = np.zeros(6)
        reading[channel] = sign * (np.floor(ends[channel] / quanta[channel]) - steps) * quanta[channel]
        assert sample_once(dut, started(dut), wrench_at_tip(reading, SENSOR.height))[2] == fault


def test_a_sensor_that_repeats_its_reading_too_often_is_stuck(dut):
    maximum = repeats_of_a_stuck_sensor(SENSOR)
    context = started(dut)
    for k in range(maximum + 1):
        assert sample_once(dut, context, sample(9))[2] == Fault.NONE, k
    assert sample_once(dut, context, sample(9))[2] == Fault.SENSOR_STUCK


DELAYS = [0, 20]  # in units of the sensor's period


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("reading", [np.zeros(6), sample(9)], ids=["zero", "not zero"])
def test_a_sensor_that_is_stuck_from_its_first_reading_on_is_noticed(delay, reading):
    """A sensor that always reads zero cannot be told from the delay line before the delay is over."""
    dut = make_monitor(WrenchSensorParameters(delay=delay * SENSOR.period))
    context = fixed_context(dut)
    faults = [sample_once(dut, context, np.zeros(6))[2] for _ in range(delay + 1)]
    permitted = repeats_of_a_stuck_sensor(SENSOR)
    faults += [sample_once(dut, context, reading)[2] for _ in range(permitted + 2)]
    assert faults == [Fault.NONE] * (delay + 1 + permitted + 1) + [Fault.SENSOR_STUCK]


def test_a_depth_that_changes_less_often_than_the_sensor_measures_may_change_more_at_once():
    largest = TOP_SPEED * 4 * SENSOR.period + RESOLUTION
    for change, fault in ((0.99 * largest, Fault.NONE), (1.01 * largest, Fault.ENCODER_JUMPED)):
        dut = make_monitor(depth_period=4 * SENSOR.period)
        assert sample_once(dut, started(dut), sample(9), 0.001 + change)[2] == fault


def test_a_sensor_without_noise_may_repeat_its_reading_for_ever():
    quiet = WrenchSensorParameters(force_noise=[0.0] * 3, torque_noise=[0.0] * 3)
    assert repeats_of_a_stuck_sensor(quiet) == math.inf


@pytest.mark.parametrize(("forces", "torques", "repeats"), [(1, 0, 30), (1, 1, 15), (2, 1, 10), (1, 3, 8)])
def test_channels_that_repeat_half_of_the_time_may_repeat_until_one_in_a_billion(forces, torques, repeats):
    """A normal variable is within 0.6745 sigma of its mean with probability 1/2, and 1e9 is 2^29.9."""
    sensor = WrenchSensorParameters(force_quantum=2 * 0.67449 * 0.02, torque_quantum=2 * 0.67449 * 5e-4)
    sensor.force_noise = [0.02] * forces + [0.0] * (3 - forces)
    sensor.torque_noise = [5e-4] * torques + [0.0] * (3 - torques)
    assert repeats_of_a_stuck_sensor(sensor) == repeats


def test_the_outputs_are_zero_before_the_first_sound_sample(dut):
    wrench, depth, fault = sample_once(dut, fixed_context(dut), np.full(6, math.nan), math.nan)
    np.testing.assert_array_equal(wrench, np.zeros(6))
    assert (depth, fault) == (0.0, Fault.SENSOR_DISCONNECTED)


def with_spike(channel, size, k=9):
    spike = sample(k)
    spike[channel] += size
    return spike


@pytest.mark.parametrize(("channel", "sign"), SIGNED)
def test_one_spike_is_replaced_by_the_last_sound_reading(channel, sign):
    """A low-pass of 100 Hz passes 1 - exp(-0.2 pi) = 0.467 of a step within 1 ms: 46.7 N or 0.467 N m of 100 N."""
    size = sign * (60.0 if channel < 3 else 2.0)
    dut = make_monitor()
    context = started(dut)
    passed, _, fault = sample_once(dut, context, with_spike(channel, size))
    np.testing.assert_array_equal(passed, sample(4))
    assert fault == Fault.NONE
    passed, _, fault = sample_once(dut, context, sample(5))
    np.testing.assert_array_equal(passed, sample(5))
    assert fault == Fault.NONE


@pytest.mark.parametrize(("channel", "size"), [(2, -45.0), (4, 0.9)])
def test_a_change_that_the_low_pass_permits_is_no_spike(channel, size):
    dut = make_monitor()
    passed, _, _ = sample_once(dut, started(dut), with_spike(channel, size))
    np.testing.assert_array_equal(passed, with_spike(channel, size))


@pytest.mark.parametrize("gap", [0, 200])
def test_three_spikes_within_a_second_are_a_fault(gap):
    dut = make_monitor()
    context = started(dut)
    for k in range(3):
        assert sample_once(dut, context, with_spike(2, 70.0, k))[2] == (Fault.NONE if k < 2 else Fault.SENSOR_SPIKES)
        for n in range(gap):
            sample_once(dut, context, sample(n))


def test_spikes_in_different_seconds_are_no_fault():
    dut = make_monitor()
    context = started(dut)
    for k in range(6):
        assert sample_once(dut, context, with_spike(2, 70.0, k))[2] == Fault.NONE
        for n in range(1500):
            sample_once(dut, context, sample(n))


RIM = -0.0015
DEVIATIONS = np.array([*SENSOR.force_noise, *SENSOR.torque_noise])


def read(wrench, depth, *, noise=1.0, times=200, sensor=SENSOR, seed=0):
    """Reads a wrench with noise at a depth; the mouth's rim is at `RIM`. Returns the fault."""
    rng = np.random.default_rng(seed)
    dut = make_monitor(sensor, free_depth=RIM)
    context = fixed_context(dut)
    for _ in range(times):
        reading = wrench + noise * DEVIATIONS * rng.standard_normal(6)
        fault = sample_once(dut, context, reading, depth)[2]
    return fault


@pytest.mark.parametrize(("channel", "sign"), SIGNED)
def test_a_bias_in_free_air_is_a_fault(channel, sign):
    """The bias of a force is 0.05 N; of a moment about the tip, 80 mm below, hypot(1e-3, 0.08 * 0.05) = 4.1e-3 N m."""
    unit = np.zeros(6)
    unit[channel] = sign * (0.05 if channel < 3 else 4.12e-3)
    assert read(4.0 * unit, RIM) == Fault.NONE
    assert read(20.0 * unit, RIM) == Fault.SENSOR_BIASED
    assert read(20.0 * unit, RIM + 1e-6) == Fault.NONE


@pytest.mark.parametrize("seed", range(5))
def test_only_noise_far_beyond_the_data_sheet_is_a_fault_and_only_in_free_air(seed):
    assert read(np.zeros(6), RIM, noise=3.0, seed=seed) == Fault.NONE
    assert read(np.zeros(6), RIM, noise=50.0, seed=seed) == Fault.SENSOR_NOISY
    assert read(np.zeros(6), 0.005, noise=50.0, seed=seed) == Fault.NONE  # a contact may chatter


def test_a_tare_begins_when_the_sensor_has_settled_and_takes_40_ms():
    """Five time constants of 1.6 ms and a delay of 20 ms are 28 readings."""
    late, biased = WrenchSensorParameters(delay=0.02), np.repeat([5.0, 1.0], 3)
    assert read(biased, RIM, times=28 + 39, sensor=late) == Fault.NONE
    assert read(biased, RIM, times=28 + 40, sensor=late) == Fault.SENSOR_BIASED


def test_a_tare_begins_anew_after_each_contact():
    rng, biased = np.random.default_rng(0), np.repeat([5.0, 1.0], 3)
    dut = make_monitor(free_depth=RIM)
    context = fixed_context(dut)
    for _ in range(5):
        for depth, times in ((RIM, 40), (RIM + 1e-4, 1)):
            for _ in range(times):
                noisy = biased + DEVIATIONS * rng.standard_normal(6)
                assert sample_once(dut, context, noisy, depth)[2] == Fault.NONE


def test_free_air_begins_above_the_corners_of_a_tilted_mouth():
    square = load_scenario("square")
    corner = math.sqrt(2.0) * 0.0095 + 0.00105  # corners keep their centres; clearance and chamfer add 0.55 mm
    assert SensorLimits.of(square).free_depth == pytest.approx(-corner * math.sin(square.controller.max_turn))
    assert SensorLimits.of(load_scenario("fr3")).free_depth == -math.inf
