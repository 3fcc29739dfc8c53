import numpy as np
import pytest

from models.hardware import DcMotorParameters
from models.scenario import ControllerParameters
from systems.control.faults import Fault
from systems.control.watchdog import COMMANDS, Watchdog
from tests.stepping import fixed_context, update

P, MOTOR = ControllerParameters(), DcMotorParameters()
COMMANDED = {"target_pitch": [0.01], "target_yaw": [-0.02], "feed_speed": [-0.01]}


def watchdog(**changes):
    dut = Watchdog(parameters=P, motor=MOTOR)
    inputs = {
        **COMMANDED,
        "controller_failed": [0.0],
        "measurement_fault": [0.0],
        "wrench": np.zeros(6),
        "depth": [0.005],
        "current": [0.2],
        "pitch_counts": [7.0, 0.0],
        "yaw_counts": [3.0, 0.0],
    }
    return dut, fixed_context(dut, **{**inputs, **changes})


def step(dut, context, times=1, **changes):
    for name, value in changes.items():
        dut.GetInputPort(name).FixValue(context, value)
    update(dut, context, period=P.period, times=times)
    return dut.GetOutputPort("fault").Eval(context)[0]


def commands(dut, context):
    return {name: [dut.GetOutputPort(name).Eval(context)[0]] for name in COMMANDS}


def stopped(dut, context):
    return dut.GetOutputPort("stopped").Eval(context)[0] == 1.0


def test_while_all_is_well_commands_pass_at_once():
    dut, context = watchdog()
    assert commands(dut, context) == COMMANDED
    dut.GetInputPort("feed_speed").FixValue(context, [0.003])
    assert commands(dut, context)["feed_speed"] == [0.003]
    assert not stopped(dut, context)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"controller_failed": [1.0]}, Fault.CONTROLLER_FAILED),
        ({"measurement_fault": [float(Fault.SENSOR_STUCK)]}, Fault.SENSOR_STUCK),
        ({"pitch_counts": [9.0, 4.0]}, Fault.PITCH_STEPS_LOST),
        ({"yaw_counts": [9.0, 4.0]}, Fault.YAW_STEPS_LOST),
    ],
)
def test_after_a_fault_the_peg_is_drawn_back_and_then_stands_still(change, fault):
    dut, context = watchdog()
    assert step(dut, context) == Fault.NONE
    assert step(dut, context, **change) == fault
    drawn = 0
    while not stopped(dut, context):
        # Whatever is commanded now, and even if the fault goes away, the angles stay and the peg comes out.
        assert commands(dut, context) == {**COMMANDED, "feed_speed": [P.retract_speed]}
        found = step(
            dut,
            context,
            target_pitch=[0.3],
            feed_speed=[-0.02],
            controller_failed=[0.0],
            measurement_fault=[0.0],
            pitch_counts=[9.0, 0.0],
            yaw_counts=[9.0, 0.0],
        )
        assert found == fault
        drawn += 1
    assert drawn * P.period == pytest.approx(P.back_off_time)
    step(dut, context, times=50)
    assert commands(dut, context) == {**COMMANDED, "feed_speed": [0.0]}


PERIODS = round(P.back_off_distance / 0.01 / P.period)  # of pushing at 10 mm/s


@pytest.mark.parametrize(
    ("current", "fault"), [(-MOTOR.current_limit, Fault.MOTOR_STALLED), (-0.3, Fault.ENCODER_STUCK)]
)
def test_a_feed_that_nothing_holds_and_that_does_not_come_is_a_fault(current, fault):
    dut, context = watchdog(current=[current])
    assert step(dut, context, times=PERIODS) == Fault.NONE
    assert step(dut, context, times=2) == fault


def test_a_feed_that_the_contact_holds_is_for_the_supervisor():
    half = 0.5 * MOTOR.force_constant * MOTOR.current_limit
    for share, fault in ((1.02, Fault.NONE), (0.98, Fault.MOTOR_STALLED)):
        dut, context = watchdog(
            current=[-MOTOR.current_limit], wrench=[0.6 * share * half, 0, 0.8 * share * half, 0, 0, 0]
        )
        assert step(dut, context, times=PERIODS + 2) == fault


def test_a_feed_that_comes_or_is_drawn_back_in_between_is_sound():
    dut, context = watchdog(current=[-MOTOR.current_limit])
    for k in range(10 * PERIODS):
        assert step(dut, context, depth=[0.005 + 0.25 * P.stall_depth * k]) == Fault.NONE
    dut, context = watchdog(current=[-MOTOR.current_limit])
    for _ in range(6):
        assert step(dut, context, times=PERIODS - 1, feed_speed=[-0.01]) == Fault.NONE
        assert step(dut, context, times=2, feed_speed=[0.01]) == Fault.NONE
