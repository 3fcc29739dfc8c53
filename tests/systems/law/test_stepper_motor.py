import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.hardware import StepperMotorParameters
from systems.law.stepper_motor import StepperMotor, ramp_speed
from tests.stepping import fixed_context, update

P = StepperMotorParameters(microsteps=1)
PERIOD = 1e-3


def motor(target, *, measured=0.0, start=0.0, parameters=P, period=PERIOD):
    dut = StepperMotor(parameters=parameters, period=period, start_angle=start)
    return dut, fixed_context(dut, target_angle=[target], measured_angle=[measured])


def follow(dut, context, *, times):
    """Updates with a rotor that follows without lag."""
    for _ in range(times):
        dut.GetInputPort("measured_angle").FixValue(context, [equilibrium(dut, context)])
        update(dut, context, period=PERIOD)


def equilibrium(dut, context):
    return dut.GetOutputPort("equilibrium_angle").Eval(context)[0]


def counts(dut, context):
    return list(dut.GetOutputPort("step_counts").Eval(context))


@pytest.mark.parametrize(("target", "steps"), [(0.0, 0), (0.49, 0), (0.51, 1), (7.4, 7), (-3.6, -4)])
@pytest.mark.parametrize("start", [0.0, 0.0411])
def test_the_axis_moves_to_the_nearest_whole_step_from_its_start(target, steps, start):
    reached = start + steps * P.step_angle
    dut, context = motor(target * P.step_angle, start=start)
    assert equilibrium(dut, context) == start
    follow(dut, context, times=200)
    assert equilibrium(dut, context) == pytest.approx(reached, abs=1e-15)
    assert counts(dut, context) == [abs(steps), 0]


@pytest.mark.parametrize(
    ("microsteps", "target", "steps"), [(2, 0.24, 0), (2, 0.26, 0.5), (2, -3.6, -3.5), (8, 1.3, 1.25)]
)
def test_a_driver_with_microsteps_stops_between_the_full_steps(microsteps, target, steps):
    dut, context = motor(target * P.step_angle, parameters=StepperMotorParameters(microsteps=microsteps))
    follow(dut, context, times=200)
    assert equilibrium(dut, context) == pytest.approx(steps * P.step_angle, abs=1e-15)
    assert counts(dut, context) == [abs(steps) * microsteps, 0]


def ramp_profile(distance, parameters, times):
    """Positions and speeds of the driver on a move over ``distance`` steps, from rest."""
    dut, context = motor(distance * parameters.step_angle, parameters=parameters)
    states = []
    for _ in range(times):
        follow(dut, context, times=1)
        states.append(context.get_discrete_state(0).value()[:2].copy())
    return np.array(states).T


@pytest.mark.parametrize("distance", [1, 2, 7, 40, -300])
@pytest.mark.parametrize(("rate", "acceleration"), [(400.0, 2e4), (2500.0, 1e4), (300.0, 777.0)])
def test_a_move_has_a_trapezoidal_speed_and_ends_on_its_step(distance, rate, acceleration):
    """n steps take n/v + v/a if the maximum rate is reached, else 2 sqrt(n/a), within a few periods of rounding."""
    parameters = StepperMotorParameters(max_step_rate=rate, max_step_acceleration=acceleration)
    n = abs(distance)
    time = n / rate + rate / acceleration if n > rate**2 / acceleration else 2 * math.sqrt(n / acceleration)
    position, speed = ramp_profile(distance, parameters, math.ceil(time / PERIOD) + 10)
    arrived = np.abs(position - distance) < 1e-6
    assert arrived.argmax() * PERIOD == pytest.approx(time, abs=4 * PERIOD)
    assert arrived[arrived.argmax() :].all()
    assert (np.abs(position) <= n + 1e-9).all()  # no overshoot
    assert (np.diff(np.abs(position)) >= -1e-9).all()
    assert np.abs(speed).max() <= rate * (1 + 1e-12)
    change = np.diff(speed, prepend=0.0, append=0.0)
    assert np.abs(change).max() <= acceleration * PERIOD * (1 + 1e-9)
    if n > rate**2 / acceleration + 2 * rate * PERIOD:
        assert np.abs(speed).max() == pytest.approx(rate)


@given(
    targets=st.lists(st.floats(-60, 60), min_size=1, max_size=6),
    rate=st.floats(50, 3000),
    acceleration=st.floats(500, 1e5),
)
def test_the_ramp_keeps_its_limits_and_arrives_for_any_targets(targets, rate, acceleration):
    position = speed = 0.0
    change = acceleration * PERIOD
    for target in [*targets, round(targets[-1])]:
        for _ in range(40):
            new = ramp_speed(target - position, speed, top=rate, change=change, period=PERIOD)
            assert abs(new) <= rate * (1 + 1e-9)
            assert abs(new - speed) <= change * (1 + 1e-6)
            speed, position = new, position + new * PERIOD
    for _ in range(4000):
        speed = ramp_speed(target - position, speed, top=rate, change=change, period=PERIOD)
        position += speed * PERIOD
    assert position == pytest.approx(target, abs=1e-6)
    assert speed == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_no_step_is_lost_with_a_lag_of_up_to_two_full_steps(sign):
    dut, context = motor(0.0, measured=sign * 1.999 * P.step_angle)
    update(dut, context, period=PERIOD, times=20)
    assert equilibrium(dut, context) == 0.0
    assert counts(dut, context) == [0, 0]


@pytest.mark.parametrize(("sign", "microsteps"), [(-1.0, 1), (1.0, 1), (1.0, 2), (-1.0, 8)])
def test_the_rotor_slips_by_four_steps_with_a_lag_of_more_than_two_full_steps(sign, microsteps):
    parameters = StepperMotorParameters(microsteps=microsteps)
    dut, context = motor(0.0, measured=sign * 2.001 * P.step_angle, parameters=parameters)
    update(dut, context, period=PERIOD)
    assert equilibrium(dut, context) == pytest.approx(sign * 4 * P.step_angle)
    assert counts(dut, context) == [0, 4 * microsteps]
    update(dut, context, period=PERIOD, times=20)  # the lag is now 1.999 steps
    assert equilibrium(dut, context) == pytest.approx(sign * 4 * P.step_angle)
    assert counts(dut, context) == [0, 4 * microsteps]


def test_the_driver_does_not_compensate_lost_steps():
    dut, context = motor(3 * P.step_angle, measured=-2.5 * P.step_angle)
    update(dut, context, period=PERIOD, times=12)
    dut.GetInputPort("measured_angle").FixValue(context, [-P.step_angle])
    update(dut, context, period=PERIOD, times=30)
    # Three commanded steps from an equilibrium that has slipped by -4 steps.
    assert counts(dut, context) == [3, 4]
    assert equilibrium(dut, context) == pytest.approx(-P.step_angle)


@pytest.mark.parametrize("start", [0.0, 0.0411])
def test_the_shaft_shows_the_commanded_and_the_measured_angle(start):
    """A rotor that lags by 1.3 steps, measured in whole counts."""
    dut, context = motor(5 * P.step_angle, start=start)
    for _ in range(100):
        dut.GetInputPort("measured_angle").FixValue(context, [start + 3.7 * P.step_angle])
        update(dut, context, period=PERIOD)
    commanded, measured = dut.GetOutputPort("shaft").Eval(context)
    assert commanded == pytest.approx(5 * P.step_angle)
    assert abs(measured - 3.7 * P.step_angle) <= 0.5 * P.encoder_resolution + 1e-15
    assert measured / P.encoder_resolution == pytest.approx(round(measured / P.encoder_resolution))


def test_another_start_angle_moves_the_equilibrium_and_the_zero_of_the_shaft():
    dut, context = motor(0.0, measured=0.05, start=0.01)
    shaft = dut.GetOutputPort("shaft")
    assert equilibrium(dut, context) == 0.01
    assert shaft.Eval(context)[1] == pytest.approx(0.04, abs=P.encoder_resolution)
    dut.set_start_angle(context, -0.02)
    assert equilibrium(dut, context) == -0.02
    assert shaft.Eval(context)[1] == pytest.approx(0.07, abs=P.encoder_resolution)
