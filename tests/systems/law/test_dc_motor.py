import numpy as np
import pytest

from models.hardware import DcMotorParameters
from systems.law.dc_motor import DcMotor
from tests.stepping import fixed_context, update

P = DcMotorParameters()
PERIOD = 1e-3
MASS = 1.5  # in units of kg, carriage and rotor together


def motor(speed_command, state=(0.0, 0.0), parameters=P):
    dut = DcMotor(parameters=parameters, period=PERIOD)
    return dut, fixed_context(dut, speed_command=[speed_command], carriage_state=list(state), enabled=[1.0])


def current(dut, context):
    return dut.GetOutputPort("current").Eval(context)[0]


def force(dut, context):
    return dut.GetOutputPort("carriage_force").Eval(context)[0]


def integral_of(context):
    _, integral = context.get_discrete_state(0).value()
    return integral


def test_the_current_of_one_period_in_motion_matches_a_finely_integrated_circuit():
    v, command = -0.012, -0.013
    parameters = DcMotorParameters(inductance=4e-3)  # a time constant longer than the period
    dut, context = motor(command, (0.05, v), parameters)
    i0, integral = 0.11, 1e-3
    context.SetDiscreteState([i0, integral])
    w, w_command = parameters.ratio * v, parameters.ratio * command
    error = w_command - w
    u = parameters.speed_kp * error + parameters.speed_ki * integral + parameters.torque_constant * w_command
    n = 200_000
    i, h = i0, PERIOD / n
    for _ in range(n):  # explicit Euler with h R/L = 3e-6
        i += h * (u - parameters.resistance * i - parameters.torque_constant * w) / parameters.inductance
    update(dut, context, period=PERIOD)
    assert current(dut, context) == pytest.approx(i, rel=1e-5)
    assert integral_of(context) == pytest.approx(integral + error * PERIOD)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stalled_motor_has_the_maximum_current(sign):
    dut, context = motor(sign * 0.03)
    update(dut, context, period=PERIOD, times=2000)
    assert current(dut, context) == pytest.approx(sign * P.current_limit, rel=1e-12)
    stall = P.ratio * P.screw_efficiency * P.torque_constant * P.current_limit
    assert force(dut, context) == pytest.approx(sign * stall, rel=1e-12)


def test_the_current_never_exceeds_its_limit_at_any_speed():
    dut, context = motor(0.0)
    rng = np.random.default_rng(4)
    largest = 0.0
    for command, speed in rng.uniform(-0.1, 0.1, (500, 2)):
        dut.GetInputPort("speed_command").FixValue(context, [command])
        dut.GetInputPort("carriage_state").FixValue(context, [0.0, speed])
        update(dut, context, period=PERIOD)
        largest = max(largest, abs(current(dut, context)))
    assert largest == pytest.approx(P.current_limit, rel=1e-9)


def test_the_force_of_a_motor_without_current_is_its_friction():
    dut, context = motor(0.0, (0.0, 0.02))
    w = P.ratio * 0.02
    assert w > 20  # the smoothed Coulomb friction has its full value
    expected = -P.ratio * (P.viscous_friction * w + P.coulomb_friction)
    assert force(dut, context) == pytest.approx(expected, rel=1e-6)
    assert force(*motor(0.0, (0.0, -0.02))) == pytest.approx(-expected, rel=1e-6)
    assert force(*motor(0.0)) == 0.0


def test_the_integral_is_frozen_while_the_current_is_limited():
    dut, context = motor(0.03)
    update(dut, context, period=PERIOD, times=3000)
    integral = integral_of(context)
    command = P.ratio * 0.03
    proportional = (P.speed_kp + P.torque_constant) * command
    # The integral stopped within one period after the voltage had reached the limit for the maximum current.
    bound = max(0.0, P.resistance * P.current_limit - proportional) / P.speed_ki
    assert 0 <= integral <= bound + command * PERIOD
    # Therefore the current changes sign within milliseconds of the command.
    dut.GetInputPort("speed_command").FixValue(context, [-0.03])
    update(dut, context, period=PERIOD, times=3)
    assert current(dut, context) < 0


def test_a_disabled_motor_is_short_circuited():
    """Its back-EMF k_e w drives the current -k_e w/R, whatever the command; the integral begins anew."""
    v = -0.02
    dut, context = motor(-0.03, (0.05, v))
    update(dut, context, period=PERIOD, times=20)
    assert integral_of(context) != 0.0
    dut.GetInputPort("enabled").FixValue(context, [0.0])
    update(dut, context, period=PERIOD, times=20)
    assert current(dut, context) == pytest.approx(-P.torque_constant * P.ratio * v / P.resistance, rel=1e-6)
    assert force(dut, context) > 0.0  # it brakes
    assert integral_of(context) == 0.0


@pytest.mark.parametrize("position", [0.0, 0.0801234, -0.01])
def test_the_encoder_on_the_shaft_counts_the_travel(position):
    dut, context = motor(0.0, (position, 0.01))
    count = P.screw_lead / P.encoder_counts
    travel = dut.GetOutputPort("travel").Eval(context)[0]
    assert abs(travel - position) <= 0.5 * count + 1e-15
    assert travel / count == pytest.approx(round(travel / count))
