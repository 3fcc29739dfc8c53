import math

import numpy as np
import pytest
from stepping import fixed_context, update

from models.hardware import StepperMotor as Parameters
from systems.stepper_motor import StepperMotor

P = Parameters()
PERIOD = 1e-3


def motor(target, *, measured=0.0, start=0.0, parameters=P, period=PERIOD):
    dut = StepperMotor(parameters=parameters, period=period, start_angle=start)
    return dut, fixed_context(dut, target_angle=[target], measured_angle=[measured])


def follow(dut, context, *, times):
    """A rotor that follows without lag."""
    for _ in range(times):
        dut.GetInputPort("measured_angle").FixValue(context, [equilibrium(dut, context)])
        update(dut, context, period=PERIOD)


def equilibrium(dut, context):
    return dut.GetOutputPort("equilibrium_angle").Eval(context)[0]


def counts(dut, context):
    return list(dut.GetOutputPort("step_counts").Eval(context))


@pytest.mark.parametrize(("target", "steps"), [(0.0, 0), (0.49, 0), (0.51, 1), (7.4, 7), (-3.6, -4)])
@pytest.mark.parametrize("start", [0.0, 0.0411])
def test_it_settles_on_the_nearest_whole_step_counted_from_where_it_stood(target, steps, start):
    reached = start + steps * P.step_angle
    dut, context = motor(target * P.step_angle, start=start)
    assert equilibrium(dut, context) == start
    follow(dut, context, times=200)
    assert equilibrium(dut, context) == pytest.approx(reached, abs=1e-15)
    assert counts(dut, context) == [abs(steps), 0]


def test_going_there_and_back_counts_every_step():
    dut, context = motor(2 * P.step_angle)
    follow(dut, context, times=50)
    dut.GetInputPort("target_angle").FixValue(context, [-P.step_angle])
    follow(dut, context, times=50)
    assert equilibrium(dut, context) == pytest.approx(-P.step_angle)
    assert counts(dut, context) == [5, 0]


@pytest.mark.parametrize("rate", [100.0, 400.0, 2500.0])
def test_the_step_rate_is_limited(rate):
    parameters = Parameters(max_step_rate=rate)
    dut, context = motor(100.0, parameters=parameters)  # far out of reach
    taken = []
    for k in range(1, 300):
        follow(dut, context, times=1)
        taken.append(counts(dut, context)[0])
        assert abs(taken[-1] - rate * PERIOD * k) <= 1.0 + 1e-9
    most = math.ceil(rate * PERIOD)
    assert np.diff(taken).max() <= most


def test_a_motor_at_rest_saves_no_steps_for_later():
    dut, context = motor(0.0)
    update(dut, context, period=PERIOD, times=1000)
    dut.GetInputPort("target_angle").FixValue(context, [100.0])
    update(dut, context, period=PERIOD)
    assert counts(dut, context)[0] <= max(1.0, P.max_step_rate * PERIOD)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_up_to_two_full_steps_of_lag_nothing_is_lost(sign):
    dut, context = motor(0.0, measured=sign * 1.999 * P.step_angle)
    update(dut, context, period=PERIOD, times=20)
    assert equilibrium(dut, context) == 0.0
    assert counts(dut, context) == [0, 0]


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_beyond_two_full_steps_the_rotor_falls_four_steps_further(sign):
    dut, context = motor(0.0, measured=sign * 2.001 * P.step_angle)
    update(dut, context, period=PERIOD)
    assert equilibrium(dut, context) == pytest.approx(sign * 4 * P.step_angle)
    assert counts(dut, context) == [0, 4]
    update(dut, context, period=PERIOD, times=20)  # the lag is now -1.999 steps: it stays there
    assert equilibrium(dut, context) == pytest.approx(sign * 4 * P.step_angle)
    assert counts(dut, context) == [0, 4]


def test_the_driver_does_not_know_what_was_lost():
    dut, context = motor(3 * P.step_angle, measured=-2.5 * P.step_angle)
    update(dut, context, period=PERIOD, times=2)
    dut.GetInputPort("measured_angle").FixValue(context, [-P.step_angle])
    update(dut, context, period=PERIOD, times=30)
    # Three commanded steps from an equilibrium that slipped by minus four.
    assert counts(dut, context) == [3, 4]
    assert equilibrium(dut, context) == pytest.approx(-P.step_angle)
