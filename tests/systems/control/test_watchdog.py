import numpy as np
import pytest

from models.hardware import DcMotorParameters
from models.scenario import ControllerParameters, WatchdogParameters, parse_scenario
from systems.control.faults import Fault
from systems.control.watchdog import COMMANDS, Watchdog, WatchdogState
from tests.stepping import fixed_context, update

P, MOTOR = WatchdogParameters(), DcMotorParameters()
COMMANDED = {"pitch_rate": [0.01], "yaw_rate": [-0.02], "feed_speed": [-0.01], "unwinding": [1.0]}
RETRACTING = {"pitch_rate": [0.0], "yaw_rate": [0.0], "feed_speed": [P.retract_speed], "unwinding": [0.0]}


def watchdog(parameters=P, **changes):
    dut = Watchdog(parameters=parameters, motor=MOTOR)
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


def test_without_a_fault_commands_pass_at_once():
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
        ({"yaw_counts": [9.0, 1.0]}, Fault.YAW_STEPS_LOST),
    ],
)
def test_after_a_fault_the_peg_is_retracted_and_then_stopped(change, fault):
    dut, context = watchdog()
    assert step(dut, context) == Fault.NONE
    assert step(dut, context, **change) == fault
    periods = 0
    while not stopped(dut, context):
        # The angles stay and the peg is retracted, for any command and even if the fault disappears.
        assert commands(dut, context) == RETRACTING
        found = step(
            dut,
            context,
            pitch_rate=[0.3],
            feed_speed=[-0.02],
            controller_failed=[0.0],
            measurement_fault=[0.0],
            pitch_counts=[9.0, 0.0],
            yaw_counts=[9.0, 0.0],
        )
        assert found == fault
        periods += 1
    assert periods * P.period == pytest.approx(P.back_off_time)
    step(dut, context, times=50)
    assert commands(dut, context) == {**COMMANDED, "feed_speed": [0.0]}


PERIODS = round(P.feed_stall_distance / 0.01 / P.period)  # of pushing at 10 mm/s


@pytest.mark.parametrize(
    ("current", "fault"), [(-MOTOR.current_limit, Fault.MOTOR_STALLED), (-0.3, Fault.ENCODER_STUCK)]
)
def test_a_feed_that_does_not_move_without_contact_force_is_a_fault(current, fault):
    dut, context = watchdog(current=[current])
    assert step(dut, context, times=PERIODS) == Fault.NONE
    assert step(dut, context, times=2) == fault


def test_a_feed_that_the_contact_blocks_is_no_fault():
    half = 0.5 * MOTOR.force_constant * MOTOR.current_limit
    for share, fault in ((1.02, Fault.NONE), (0.98, Fault.MOTOR_STALLED)):
        dut, context = watchdog(
            current=[-MOTOR.current_limit], wrench=[0.6 * share * half, 0, 0.8 * share * half, 0, 0, 0]
        )
        assert step(dut, context, times=PERIODS + 2) == fault


@pytest.mark.parametrize("current", [0.3, 0.6])
@pytest.mark.parametrize(("share", "fault"), [(1.02, Fault.NONE), (0.98, Fault.ENCODER_STUCK)])
def test_half_of_the_force_of_the_present_current_is_a_contact(current, share, fault):
    force = share * 0.5 * MOTOR.force_constant * current
    dut, context = watchdog(current=[-current], wrench=[0, 0, force, 0, 0, 0])
    assert step(dut, context, times=PERIODS + 2) == fault


def test_a_feed_that_moves_or_is_retracted_in_between_is_no_fault():
    dut, context = watchdog(current=[-MOTOR.current_limit])
    for k in range(10 * PERIODS):
        assert step(dut, context, depth=[0.005 + 0.25 * P.stall_depth * k]) == Fault.NONE
    dut, context = watchdog(current=[-MOTOR.current_limit])
    for _ in range(6):
        assert step(dut, context, times=PERIODS - 1, feed_speed=[-0.01]) == Fault.NONE
        assert step(dut, context, times=2, feed_speed=[0.01]) == Fault.NONE


def test_the_stall_distance_does_not_depend_on_the_back_off_distance_of_the_force_guard():
    for back_off_distance in (0.1e-3, 10e-3):
        parameters = ControllerParameters(back_off_distance=back_off_distance)
        dut, context = watchdog(parameters, current=[-0.3])
        assert step(dut, context, times=PERIODS) == Fault.NONE
        assert step(dut, context, times=2) == Fault.ENCODER_STUCK


def test_the_shared_defaults_of_the_watchdog_are_those_of_the_controller():
    shared = ("period", "retract_speed", "back_off_time", "stall_depth", "feed_stall_distance")
    assert [getattr(P, name) for name in shared] == [getattr(ControllerParameters(), name) for name in shared]


def test_a_stored_scenario_without_the_stall_distance_still_loads():
    stored = parse_scenario(
        "controller: {gain: 1.0, back_off_distance: 2.0e-3, stall_depth: 0.1e-3}", "test"
    ).controller
    assert stored == ControllerParameters(gain=1.0, back_off_distance=2.0e-3, stall_depth=0.1e-3)
    assert stored.feed_stall_distance == P.feed_stall_distance


def test_the_watchdog_checks_from_time_zero():
    timing = watchdog()[0].GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.offset_sec(), timing.period_sec()) == (0.0, P.period)


def test_a_moment_does_not_count_as_a_contact_force():
    """A drive at its limit would be blocked by such a force, not by such a moment."""
    large = MOTOR.force_constant * MOTOR.current_limit
    for axis, fault in enumerate([Fault.NONE] * 3 + [Fault.MOTOR_STALLED] * 3):
        wrench = np.zeros(6)
        wrench[axis] = -large
        dut, context = watchdog(current=[-MOTOR.current_limit], wrench=wrench)
        assert step(dut, context, times=PERIODS + 2) == fault


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "fault"), [(0.96, Fault.MOTOR_STALLED), (0.94, Fault.ENCODER_STUCK)])
def test_a_current_from_95_percent_of_the_limit_counts_as_limited(sign, share, fault):
    motor = DcMotorParameters(current_limit=2.5)
    dut = Watchdog(parameters=P, motor=motor)
    zeros = {name: [0.0] for name in ("controller_failed", "measurement_fault", "depth")}
    counts = {name: [0.0, 0.0] for name in ("pitch_counts", "yaw_counts")}
    context = fixed_context(dut, **COMMANDED, **zeros, **counts, wrench=np.zeros(6), current=[sign * share * 2.5])
    assert step(dut, context, times=PERIODS + 2) == fault


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(("share", "stalled"), [(0.9, True), (1.1, False)])
def test_a_change_of_depth_by_the_stall_depth_in_either_direction_starts_anew(direction, share, stalled):
    dut, context = watchdog(current=[-0.3])
    assert step(dut, context, times=PERIODS - 1) == Fault.NONE
    found = step(dut, context, times=4, depth=[0.005 + direction * share * P.stall_depth])
    assert (found == Fault.ENCODER_STUCK) == stalled


def test_the_stall_distance_is_measured_and_not_the_time():
    """At a quarter of the speed it takes four times as long."""
    dut, context = watchdog(current=[-0.3], feed_speed=[-0.0025])
    assert step(dut, context, times=4 * PERIODS) == Fault.NONE
    assert step(dut, context, times=2) == Fault.ENCODER_STUCK


def test_a_fault_of_the_measurement_takes_precedence():
    everything = {"pitch_counts": [9.0, 1.0], "yaw_counts": [9.0, 1.0]}
    failed = {**everything, "controller_failed": [1.0]}
    measured = {**failed, "measurement_fault": [float(Fault.ENCODER_JUMPED)]}
    for change, fault in (
        (everything, Fault.PITCH_STEPS_LOST),
        (failed, Fault.CONTROLLER_FAILED),
        (measured, Fault.ENCODER_JUMPED),
    ):
        dut, context = watchdog(**change)
        assert step(dut, context) == fault


def test_the_angles_of_both_axes_stay_after_a_fault():
    dut, context = watchdog()
    step(dut, context, controller_failed=[1.0])
    step(dut, context, pitch_rate=[0.3], yaw_rate=[0.4])
    assert commands(dut, context)["pitch_rate"] == commands(dut, context)["yaw_rate"] == [0.0]


def test_the_state_survives_its_storage():
    state = WatchdogState(Fault.ENCODER_STUCK, 0.1, 0.2, 0.3)
    assert state.as_list() == [6.0, 0.1, 0.2, 0.3, 0.4, 0.5]
    assert WatchdogState.from_vector(np.array(state.as_list())) == state
    assert WatchdogState().as_list() == [0.0] * 6


def test_every_output_is_one_number():
    dut = watchdog()[0]
    assert [dut.GetOutputPort(name).size() for name in (*COMMANDS, "fault", "stopped")] == [1] * 5
