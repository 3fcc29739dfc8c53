import pytest

from models.hardware import StepperMotorParameters
from skill.data.axes import AXES
from systems.law.faults import Fault
from systems.law.watchdog import COMMANDS, LOST_LAG, MONITORS, RetractLimits, Watchdog
from tests.stepping import fixed_context, update

PERIOD, SPEED, TIME, STEP = 0.02, 0.015, 0.4, StepperMotorParameters().step_angle
COMMANDED = {
    **{"pitch_rate": [0.01], "yaw_rate": [-0.02], "clocking_rate": [0.03]},
    **{"feed_speed": [-0.01], "unwinding": [1.0]},
}
RETRACTING = {**{name: [0.0] for name in COMMANDED}, "feed_speed": [SPEED]}
STOPPED = {**RETRACTING, "feed_speed": [0.0]}
SOUND = {**{name: [0.0] for name in MONITORS}, "controller_failed": [0.0]}
SOUND |= {"pitch_shaft": [0.01, 0.0101], "yaw_shaft": [-0.02, -0.0201], "clocking_shaft": [0.03, 0.0301]}


def watchdog(**changes):
    dut = Watchdog(RetractLimits(PERIOD, SPEED, TIME, LOST_LAG * STEP), AXES)
    return dut, fixed_context(dut, **{**COMMANDED, **SOUND, **changes})


def step(dut, context, times=1, **changes):
    for name, value in changes.items():
        dut.GetInputPort(name).FixValue(context, value)
    update(dut, context, period=PERIOD, times=times)
    return dut.GetOutputPort("fault").Eval(context)[0]


def commands(dut, context):
    return {name: [dut.GetOutputPort(name).Eval(context)[0]] for name in COMMANDS}


def stopped(dut, context):
    return dut.GetOutputPort("stopped").Eval(context)[0] == 1.0


def test_without_a_fault_commands_pass_at_once():
    dut, context = watchdog()
    assert commands(dut, context) == COMMANDED
    dut.GetInputPort("feed_speed").FixValue(context, [0.003])
    assert commands(dut, context)["feed_speed"] == [0.003]
    assert not stopped(dut, context)


FAULTS = [
    ({"controller_failed": [1.0]}, Fault.CONTROLLER_FAILED),
    ({"sensor_monitor_fault": [float(Fault.SENSOR_STUCK)]}, Fault.SENSOR_STUCK),
    ({"drive_monitor_fault": [float(Fault.ENCODER_STUCK)]}, Fault.ENCODER_STUCK),
    ({"pitch_shaft": [0.0, 1.01 * LOST_LAG * STEP]}, Fault.PITCH_STEPS_LOST),
    ({"yaw_shaft": [0.0, -1.01 * LOST_LAG * STEP]}, Fault.YAW_STEPS_LOST),
    ({"clocking_shaft": [0.0, 1.01 * LOST_LAG * STEP]}, Fault.CLOCKING_STEPS_LOST),
]


@pytest.mark.parametrize(("change", "fault"), FAULTS)
def test_after_a_fault_the_peg_is_retracted_and_then_stopped(change, fault):
    dut, context = watchdog()
    assert step(dut, context) == Fault.NONE
    assert step(dut, context, **change) == fault
    periods = 0
    while not stopped(dut, context):
        # The angles stay and the peg is retracted, for any command and even if the fault disappears.
        assert commands(dut, context) == RETRACTING
        assert step(dut, context, pitch_rate=[0.3], yaw_rate=[0.4], feed_speed=[-0.02], **SOUND) == fault
        periods += 1
    assert periods * PERIOD == pytest.approx(TIME)
    step(dut, context, times=50)
    assert commands(dut, context) == STOPPED


@pytest.mark.parametrize("fault", [Fault.FEED_RUNS_AWAY, Fault.FEED_DEAD, Fault.UPPER_TRAVEL_LIMIT])
def test_a_feed_that_does_not_obey_or_is_at_its_upper_end_is_not_retracted(fault):
    dut, context = watchdog()
    assert step(dut, context, drive_monitor_fault=[float(fault)]) == fault
    periods = 0
    while not stopped(dut, context):
        assert commands(dut, context) == STOPPED
        step(dut, context)
        periods += 1
    assert periods * PERIOD == pytest.approx(TIME)


@pytest.mark.parametrize(("name", "sign"), [("pitch_shaft", 1.0), ("yaw_shaft", -1.0)])
def test_a_stepper_may_lag_by_two_steps(name, sign):
    """The rotor falls into the next equilibrium beyond two steps."""
    dut, context = watchdog(**{name: [0.1, 0.1 + sign * 2.0 * STEP]})
    assert step(dut, context, times=5) == Fault.NONE


def test_the_first_fault_stays_and_monitors_come_in_order():
    for kept in range(len(FAULTS)):
        dut, context = watchdog()
        _, first = FAULTS[kept]
        assert step(dut, context, **FAULTS[kept][0]) == first
        for change, _ in FAULTS:
            assert step(dut, context, **change) == first
    found = {"sensor_monitor_fault": [float(Fault.SENSOR_STUCK)], "drive_monitor_fault": [float(Fault.FEED_DEAD)]}
    dut, context = watchdog(**found)
    assert step(dut, context, controller_failed=[1.0]) == Fault.SENSOR_STUCK


@pytest.mark.parametrize(
    ("fault", "blind"), [(Fault.SENSOR_STUCK, 1.0), (Fault.SENSOR_NOISY, 1.0), (Fault.ENCODER_STUCK, 0.0)]
)
def test_the_wrench_is_unknown_after_a_fault_of_the_sensor(fault, blind):
    dut, context = watchdog()
    assert dut.GetOutputPort("blind").Eval(context)[0] == 0.0
    step(dut, context, sensor_monitor_fault=[float(fault)])
    assert dut.GetOutputPort("blind").Eval(context)[0] == blind


def test_a_sensor_that_fails_after_another_fault_blinds_the_guard_too():
    """Its reading is held from then on; a guard that follows it would turn the hole against the peg."""
    dut, context = watchdog()
    assert step(dut, context, yaw_shaft=[0.0, 1.01 * LOST_LAG * STEP]) == Fault.YAW_STEPS_LOST
    assert dut.GetOutputPort("blind").Eval(context)[0] == 0.0
    assert step(dut, context, sensor_monitor_fault=[float(Fault.SENSOR_SATURATED)]) == Fault.YAW_STEPS_LOST
    assert dut.GetOutputPort("blind").Eval(context)[0] == 1.0
