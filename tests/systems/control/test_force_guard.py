import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.scenario import ForceGuardParameters
from systems.control.force_guard import SLOPE_TIME, ForceGuard, GuardTiming
from tests.stepping import fixed_context, update

P = ForceGuardParameters()
RADIUS, TURN_RATE, MAX_TURN, RETRACT = 0.01, 0.2, 0.14, 0.015
TIMING = GuardTiming(period=1e-3, delay=7e-3, deceleration=9.0)
REST = {"pitch_rate": [0.0], "yaw_rate": [0.0], "feed_speed": [0.0], "unwinding": [0.0], "blind": [0.0]}
MIDDLE = 0.5 * (P.soft_force + P.hold_force)


def guard(**inputs):
    dut = ForceGuard(
        parameters=P,
        timing=TIMING,
        peg_radius=RADIUS,
        max_turn_rate=TURN_RATE,
        max_turn=MAX_TURN,
        retract_speed=RETRACT,
    )
    return dut, fixed_context(dut, **{"wrench": np.zeros(6), "depth": [0.01], **REST, **inputs})


def settled(dut, context):
    """Updates until the slope of a constant load has decayed."""
    update(dut, context, period=TIMING.period, times=round(50 * SLOPE_TIME / TIMING.period))


def outputs(dut, context):
    return [dut.GetOutputPort(name).Eval(context)[0] for name in ("target_pitch", "target_yaw", "feed_speed")]


def rates(dut, context):
    """The turn rates of the next update."""
    before = np.array(outputs(dut, context)[:2])
    update(dut, context, period=TIMING.period)
    return (np.array(outputs(dut, context)[:2]) - before) / TIMING.period


def push(load):
    return np.array([0.0, 0.0, load, 0.0, 0.0, 0.0])


def moment(size):
    """A contact moment on the peg about x with this load; the hole feels the opposite one."""
    return np.array([0.0, 0.0, 0.0, size * RADIUS, 0.0, 0.0])


def test_in_free_air_commands_pass():
    dut, context = guard(pitch_rate=[0.05], yaw_rate=[-0.1], feed_speed=[-0.02])
    update(dut, context, period=TIMING.period, times=10)
    assert outputs(dut, context) == pytest.approx([0.05 * 0.01, -0.1 * 0.01, -0.02])


@pytest.mark.parametrize(("load", "share"), [(P.soft_force, 1.0), (MIDDLE, 0.5), (P.hold_force, 0.0)])
def test_the_feed_into_the_hole_falls_to_zero_between_soft_force_and_hold_force(load, share):
    dut, context = guard(wrench=push(load), feed_speed=[-0.02])
    settled(dut, context)
    assert outputs(dut, context)[2] == pytest.approx(-0.02 * share, abs=1e-9)


def test_a_rising_load_slows_the_feed_before_it_is_high():
    """By hand: after one sample the slope is T/(tau + T) F/T, and the load ahead F + slope (t + |v|/a)."""
    load = 6.0
    dut, context = guard(wrench=push(load), feed_speed=[-0.02])
    update(dut, context, period=TIMING.period)
    slope = load / (SLOPE_TIME + TIMING.period)
    ahead = load + slope * TIMING.delay
    share = (P.hold_force - ahead) / (P.hold_force - P.soft_force)
    assert 0.0 < share < 1.0
    assert outputs(dut, context)[2] == pytest.approx(-0.02 * share)
    update(dut, context, period=TIMING.period)  # now the feed moves: its stopping time counts too
    slope += 0.25 * (0.0 - slope)
    ahead = load + slope * (TIMING.delay + 0.02 * share / TIMING.deceleration)
    share = (P.hold_force - ahead) / (P.hold_force - P.soft_force)
    assert outputs(dut, context)[2] == pytest.approx(-0.02 * share)


def test_a_falling_load_does_not_count_as_less():
    dut, context = guard(wrench=push(P.hold_force), feed_speed=[-0.02])
    settled(dut, context)
    dut.GetInputPort("wrench").FixValue(context, push(MIDDLE))
    update(dut, context, period=TIMING.period)
    assert outputs(dut, context)[2] == pytest.approx(-0.01)


@pytest.mark.parametrize(("load", "share"), [(P.soft_force, 1.0), (MIDDLE, 0.5), (P.hold_force, 0.0)])
def test_all_of_a_turn_but_its_part_that_lowers_the_load_is_reduced(load, share):
    dut, context = guard(wrench=moment(load), pitch_rate=[0.05], yaw_rate=[0.03])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([0.05 * share, 0.03 * share], abs=1e-9)
    dut.GetInputPort("pitch_rate").FixValue(context, [-0.05])  # with the moment on the hole
    assert rates(dut, context) == pytest.approx([-0.05, 0.03 * share], abs=1e-9)


def test_a_force_across_the_tip_counts_with_its_lever_about_the_mouth():
    """At a depth of 10 mm, 1 N across the tip along y turns the hole about x by -10 mN m."""
    force = MIDDLE / math.hypot(1.0, 0.0)
    dut, context = guard(wrench=np.array([0.0, force, 0.0, 0.0, 0.0, 0.0]), pitch_rate=[0.05], yaw_rate=[0.03])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([0.025, 0.015], abs=1e-9)


def test_above_the_hold_force_the_hole_turns_with_the_moment():
    middle = 0.5 * (P.hold_force + P.force_limit)
    dut, context = guard(wrench=moment(middle))
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([-0.5 * TURN_RATE, 0.0])


def test_above_the_hold_force_the_peg_moves_with_the_axial_force():
    for load, speed in ((0.5 * (P.hold_force + P.force_limit), 0.5 * RETRACT), (2.0 * P.force_limit, RETRACT)):
        for sign in (-1.0, 1.0):
            dut, context = guard(wrench=push(sign * load))
            settled(dut, context)
            assert outputs(dut, context)[2] == pytest.approx(sign * speed)


def test_a_gripped_peg_is_pulled_with_less_than_the_limit():
    middle = 0.5 * (P.hold_force + P.force_limit)
    dut, context = guard(wrench=np.array([0.0, 0.0, -middle, 0.0, 0.0, 0.0]), feed_speed=[RETRACT])
    settled(dut, context)
    assert outputs(dut, context)[2] == pytest.approx(0.0, abs=1e-9)  # half a retraction, half a yield to the pull
    dut, context = guard(wrench=push(middle), feed_speed=[RETRACT])  # pushed out: nothing holds it
    settled(dut, context)
    assert outputs(dut, context)[2] >= RETRACT


def test_unwinding_returns_to_the_angles_at_the_last_light_load():
    dut, context = guard(pitch_rate=[0.05], yaw_rate=[0.1])
    update(dut, context, period=TIMING.period, times=50)
    light = outputs(dut, context)[:2]
    dut.GetInputPort("wrench").FixValue(context, np.array([0.0, 0.0, 12.0, 0.0, 0.0, 0.0]))
    update(dut, context, period=TIMING.period, times=50)
    assert outputs(dut, context)[0] > light[0] + 1e-3
    dut.GetInputPort("unwinding").FixValue(context, [1.0])
    update(dut, context, period=TIMING.period, times=100)
    # The angles at the last sample with a light load, before the turn of that sample.
    assert outputs(dut, context)[:2] == pytest.approx(light, abs=0.1 * TIMING.period * 1.01)


def test_unwinding_does_not_go_round_the_cap():
    dut, context = guard(pitch_rate=[0.1])
    update(dut, context, period=TIMING.period, times=50)
    turned = outputs(dut, context)[0]
    dut.GetInputPort("wrench").FixValue(context, moment(-P.hold_force))  # presses the hole on in the same direction
    settled(dut, context)
    dut.GetInputPort("unwinding").FixValue(context, [1.0])
    assert rates(dut, context) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert outputs(dut, context)[0] >= turned


def test_unwinding_from_far_is_reduced_like_a_turn_at_the_largest_rate():
    """At half the share, half of the largest rate is left, however far the angles of the light load are."""
    dut, context = guard(pitch_rate=[0.2], wrench=moment(MIDDLE))
    light = outputs(dut, context)[0]
    settled(dut, context)
    update(dut, context, period=TIMING.period, times=200)
    far = outputs(dut, context)[0]
    assert far > light + 0.01
    dut.GetInputPort("wrench").FixValue(context, moment(-MIDDLE))
    dut.GetInputPort("unwinding").FixValue(context, [1.0])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([-0.5 * TURN_RATE, 0.0], abs=1e-9)


@given(
    wrench=st.tuples(*[st.floats(-60, 60)] * 3, *[st.floats(-0.6, 0.6)] * 3),
    command=st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.03, 0.03)),
    depth=st.floats(-0.003, 0.025),
    unwinding=st.booleans(),
)
def test_nothing_raises_the_load_at_the_hold_force(wrench, command, depth, unwinding):
    """No command feeds inwards or turns against the moment, and every turn stays within its limits."""
    wrench = np.array(wrench)
    load = float(np.hypot(np.linalg.norm(wrench[:3]), np.linalg.norm(wrench[3:]) / RADIUS))
    pitch, yaw, speed = command
    flags = {"pitch_rate": [pitch], "yaw_rate": [yaw], "feed_speed": [speed], "unwinding": [float(unwinding)]}
    dut, context = guard(wrench=wrench, depth=[depth], **flags)
    settled(dut, context)
    turn = rates(dut, context)
    assert np.linalg.norm(turn) <= TURN_RATE * (1 + 1e-9)
    assert np.abs(outputs(dut, context)[:2]).max() <= MAX_TURN
    if load >= P.hold_force:
        on_hole = -(wrench[3:5] + depth * np.array([wrench[1], -wrench[0]]))
        assert turn @ on_hole >= -1e-9
        assert outputs(dut, context)[2] >= min(0.0, wrench[2] / load * RETRACT) - 1e-12


def test_after_a_fault_of_the_sensor_only_a_retraction_passes():
    for wrench in (push(2.0 * P.force_limit), push(-2.0 * P.force_limit), moment(2.0 * P.force_limit)):
        commands = {"pitch_rate": [0.1], "feed_speed": [-0.01], "unwinding": [1.0], "blind": [1.0]}
        dut, context = guard(wrench=wrench, **commands)
        settled(dut, context)
        assert outputs(dut, context) == [0.0, 0.0, 0.0]
        dut.GetInputPort("feed_speed").FixValue(context, [0.012])
        update(dut, context, period=TIMING.period)
        assert outputs(dut, context) == [0.0, 0.0, 0.012]


def test_the_largest_measured_load_is_kept():
    """3 N across and 0.04 N m over 10 mm are 5 N."""
    dut, context = guard(wrench=np.array([0.0, 3.0, 0.0, 0.0, 0.0, 0.04]))
    assert dut.peak_load(context) == 0.0
    update(dut, context, period=TIMING.period)
    dut.GetInputPort("wrench").FixValue(context, push(1.0))
    update(dut, context, period=TIMING.period)
    assert dut.peak_load(context) == pytest.approx(5.0)
