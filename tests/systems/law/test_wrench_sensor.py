import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce

from models.hardware import WrenchSensorParameters
from systems.law.wrench_sensor import WrenchSensor
from tests.stepping import update

QUIET = {
    "force_noise": [0.0] * 3,
    "torque_noise": [0.0] * 3,
    "force_bias": 0.0,
    "torque_bias": 0.0,
    "force_drift": 0.0,
    "torque_drift": 0.0,
    "delay": 0.0,
    "force_quantum": 1e-12,
    "torque_quantum": 1e-12,
    "force_range": [1e6] * 3,
    "torque_range": [1e6] * 3,
}
IMMEDIATE = {"bandwidth": 1e9}
WELD = 2


def sensor(held, *, tare=(0.0,) * 6, seed=5, **changes):
    """``held`` is the wrench of the carriage on the peg at the sensor: force, then torque."""
    p = WrenchSensorParameters(**{**QUIET, **changes})
    dut = WrenchSensor(parameters=p, seed=seed, weld=WELD, tare=np.array(tare, dtype=float))
    context = dut.CreateDefaultContext()
    hold(dut, context, held)
    return dut, context, p


def hold(dut, context, held):
    held = np.asarray(held, dtype=float)
    forces = [SpatialForce(tau=np.full(3, 7.0 + k), f=np.full(3, -9.0 - k)) for k in range(4)]
    forces[WELD] = SpatialForce(tau=held[3:], f=held[:3])
    dut.GetInputPort("reaction_forces").FixValue(context, Value[list[SpatialForce]](forces))


def read(dut, context, p, times=1):
    update(dut, context, period=p.period, times=times)
    return dut.GetOutputPort("wrench").Eval(context)


def test_the_measured_wrench_is_the_reaction_to_that_of_the_carriage():
    dut, context, p = sensor([1.0, -2.0, 3.0, 0.1, 0.2, -0.3], height=0.0, **IMMEDIATE)
    np.testing.assert_allclose(read(dut, context, p), [-1.0, 2.0, -3.0, -0.1, -0.2, 0.3], atol=1e-9)


def test_the_wrench_without_contact_is_tared():
    weight = [0.0, 0.0, 1.45, 0.0, 0.01, 0.0]
    dut, context, p = sensor(weight, tare=weight, **IMMEDIATE)
    np.testing.assert_array_equal(read(dut, context, p, times=3), np.zeros(6))


def test_a_force_above_the_tip_has_a_moment_about_the_tip():
    h, above = 0.08, 0.02
    force = np.array([5.0, 0.0, 0.0])
    at_mount = np.cross([0.0, 0.0, above - h], force)
    dut, context, p = sensor([*-force, *-at_mount], height=h, **IMMEDIATE)
    # 5 N along x, 20 mm above the tip: 0.1 N m about y
    np.testing.assert_allclose(read(dut, context, p), [5.0, 0.0, 0.0, 0.0, 0.1, 0.0], atol=1e-9)


def test_the_step_response_is_that_of_a_first_order_low_pass():
    dut, context, p = sensor([-10.0, 0.0, 0.0, 0.0, 0.0, -1.0], height=0.0, bandwidth=60.0)
    for k in range(1, 40):
        wrench = read(dut, context, p)
        share = 1.0 - math.exp(-2.0 * math.pi * 60.0 * p.period * k)
        assert wrench[0] == pytest.approx(10.0 * share, rel=1e-9)
        assert wrench[5] == pytest.approx(share, rel=1e-9)
    assert share > 0.99


def test_readings_are_multiples_of_the_quantum():
    quanta = {"force_quantum": 1 / 16, "torque_quantum": 1 / 752}
    dut, context, p = sensor([-0.30, 0.34, -12.345, 0.0, 0.0123, -0.4567], height=0.0, **quanta, **IMMEDIATE)
    expected = [
        *(round(v * 16) / 16 for v in (0.30, -0.34, 12.345)),
        *(round(v * 752) / 752 for v in (0.0, -0.0123, 0.4567)),
    ]
    np.testing.assert_allclose(read(dut, context, p), expected, rtol=1e-12)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_readings_are_clipped_to_the_range(sign):
    ranges = {"force_range": [145.0, 145.0, 290.0], "torque_range": [5.0, 4.0, 3.0]}
    dut, context, p = sensor(sign * np.array([1e3] * 3 + [1e2] * 3), height=0.0, **ranges, **IMMEDIATE)
    np.testing.assert_allclose(read(dut, context, p), -sign * np.array([145, 145, 290, 5, 4, 3]), rtol=1e-9)


def test_the_noise_of_each_channel_is_white_with_its_standard_deviation():
    """The low-pass does not filter it."""
    sigma = np.array([0.02, 0.03, 0.05, 5e-4, 6e-4, 7e-4])
    dut, context, p = sensor(
        [0.0] * 6, height=0.0, force_noise=list(sigma[:3]), torque_noise=list(sigma[3:]), bandwidth=20.0
    )
    n = 4000
    readings = np.array([read(dut, context, p).copy() for _ in range(n)])
    assert (np.abs(readings.mean(axis=0)) < 5 * sigma / math.sqrt(n)).all()
    np.testing.assert_allclose(readings.std(axis=0), sigma, rtol=5 / math.sqrt(2 * n))
    between = np.corrcoef(np.vstack([readings.T, np.roll(readings, 1, axis=0).T]))
    assert np.abs(between - np.eye(12)).max() < 5.5 / math.sqrt(n)


def test_the_bias_is_constant_for_a_seed_and_has_its_standard_deviation():
    biases = []
    for seed in range(300):
        dut, context, p = sensor([0.0] * 6, seed=seed, height=0.0, force_bias=0.05, torque_bias=1e-3)
        biases.append(read(dut, context, p).copy())
        if seed < 3:
            np.testing.assert_array_equal(read(dut, context, p, times=5), biases[-1])
    sizes = np.array(biases) / np.repeat([0.05, 1e-3], 3)
    assert (np.abs(sizes.mean(axis=0)) < 5 / math.sqrt(300)).all()
    np.testing.assert_allclose(sizes.std(axis=0), 1.0, rtol=5 / math.sqrt(600))


@pytest.mark.parametrize("samples", [0, 1, 2, 7])
def test_a_delayed_sensor_gives_exactly_the_same_readings_later(samples):
    """The output is zero until the first reading has passed the delay."""
    noisy = {"force_noise": [0.02] * 3, "torque_noise": [5e-4] * 3, "force_drift": 0.1}
    at_once = sensor([1.0, 2.0, 3.0, 0.1, 0.2, 0.3], **noisy)
    late = sensor([1.0, 2.0, 3.0, 0.1, 0.2, 0.3], delay=samples * 1e-3, **noisy)
    first, second = (np.array([read(*unit).copy() for _ in range(20)]) for unit in (at_once, late))
    np.testing.assert_array_equal(second[:samples], 0.0)
    np.testing.assert_array_equal(second[samples:], first[: 20 - samples])
