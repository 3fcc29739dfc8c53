import math
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import trial_scenario
from models.control import ForceGuardParameters
from models.scenario import Scenario
from skill.policy.rig_policy import Action
from systems.law.control_law import ControlLaw
from systems.law.force_guard import SLOPE_TIME, ForceGuard, GuardLimits, StoppingModel
from tests.stepping import fixed_context, update

P = ForceGuardParameters()
RADIUS, TURN_RATE, MAX_TURN, RETRACT = 0.01, 0.2, 0.14, 0.015
STOPPING = StoppingModel(period=1e-3, delay=7e-3, deceleration=9.0, feed_impact=1000.0, turn_impact=200.0)
SLOW = STOPPING._replace(turn_impact=800.0)
REST = {name: [0.0] for name in ("pitch_rate", "yaw_rate", "clocking_rate", "feed_speed", "unwinding", "blind")}
MIDDLE = 0.5 * (P.soft_force + P.hold_force)
HALF_FEED = 0.5 * (P.soft_force + MIDDLE)  # the load at which half of a feed is left
HALF_TURN = 0.5 * (MIDDLE + P.hold_force)


def guard(*, stopping=STOPPING, clocking=0.0, **inputs):
    limits = GuardLimits(P.soft_force, P.hold_force, P.force_limit, RADIUS, TURN_RATE, MAX_TURN, RETRACT, clocking)
    dut = ForceGuard(limits=limits, stopping=stopping)
    return dut, fixed_context(dut, **{"wrench": np.zeros(6), "depth": [0.01], **REST, **inputs})


def settled(dut, context):
    """Updates until the slope of a constant load has decayed."""
    update(dut, context, period=STOPPING.period, times=round(50 * SLOPE_TIME / STOPPING.period))


def outputs(dut, context):
    return [dut.GetOutputPort(name).Eval(context)[0] for name in ("target_pitch", "target_yaw", "feed_speed")]


def rates(dut, context):
    """The turn rates of the next update."""
    before = np.array(outputs(dut, context)[:2])
    update(dut, context, period=STOPPING.period)
    return (np.array(outputs(dut, context)[:2]) - before) / STOPPING.period


def push(load):
    return np.array([0.0, 0.0, load, 0.0, 0.0, 0.0])


def moment(size):
    """A contact moment on the peg about x with this load; the hole feels the opposite one."""
    return np.array([0.0, 0.0, 0.0, size * RADIUS, 0.0, 0.0])


def test_in_free_air_commands_pass():
    dut, context = guard(pitch_rate=[0.03], yaw_rate=[-0.04], feed_speed=[-0.02])
    update(dut, context, period=STOPPING.period, times=10)
    assert outputs(dut, context) == pytest.approx([0.03 * 0.01, -0.04 * 0.01, -0.02])


@pytest.mark.parametrize("name", ["pitch_rate", "yaw_rate", "clocking_rate", "feed_speed"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_of_commands_that_are_not_finite_none_is_permitted(name, value):
    dut, context = guard(**{"pitch_rate": [0.03], "feed_speed": [-0.02], "unwinding": [1.0], name: [value]})
    update(dut, context, period=STOPPING.period, times=10)
    assert outputs(dut, context) == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("broken", [{"depth": [math.nan]}, {"wrench": np.array([0.0, 0.0, 1.0, math.inf, 0.0, 0.0])}])
@pytest.mark.parametrize("speed", [-0.02, 0.01])
def test_on_a_measurement_that_is_not_finite_only_a_retraction_is_permitted(broken, speed):
    dut, context = guard(pitch_rate=[0.03], yaw_rate=[-0.04], feed_speed=[speed], **broken)
    update(dut, context, period=STOPPING.period, times=10)
    assert outputs(dut, context) == [0.0, 0.0, max(speed, 0.0)]


@pytest.mark.parametrize("load", [0.0, 5.0])
def test_feed_and_turns_are_no_faster_than_a_contact_may_stop_them_at_the_limit(load):
    """A turn of 0.1 rad/s and a feed of 30 mm/s may have to stop with 20 N + 30 N, more than F_limit - F."""
    dut, context = guard(wrench=push(load), pitch_rate=[0.08], yaw_rate=[-0.06], feed_speed=[-0.03])
    settled(dut, context)
    share = (P.force_limit - load) / 50.0
    assert rates(dut, context) == pytest.approx([0.08 * share, -0.06 * share])
    assert outputs(dut, context)[2] == pytest.approx(-0.03 * share)


def test_the_impact_load_adds_to_the_load_ahead():
    """By hand, after one sample: slope F/(tau + T), ahead F + slope t, and 50 N of impact."""
    load = 3.0
    dut, context = guard(wrench=push(load), yaw_rate=[-0.1], feed_speed=[-0.03])
    update(dut, context, period=STOPPING.period)
    ahead = load + load / (SLOPE_TIME + STOPPING.period) * STOPPING.delay
    assert ahead < P.soft_force
    assert outputs(dut, context)[2] == pytest.approx(-0.03 * (P.force_limit - ahead) / 50.0)


def test_a_turn_that_lowers_the_load_ends_at_an_opposite_wall_within_the_limit():
    """By hand: F_limit / turn_impact = 40 N / 800 N s/rad = 0.05 rad/s, however large the command is."""
    dut, context = guard(stopping=SLOW, wrench=moment(MIDDLE), pitch_rate=[-1.0])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([-P.force_limit / 800.0, 0.0])


def test_a_retraction_has_no_impact():
    dut, context = guard(yaw_rate=[0.1], feed_speed=[0.03])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([0.0, 0.1])
    assert outputs(dut, context)[2] == pytest.approx(0.03)


@pytest.mark.parametrize(("bandwidth", "shortest"), [(100.0, 2e-3), (1000.0, 2e-3), (50.0, 3.1831e-3)])
def test_the_stopping_model_by_hand(bandwidth, shortest):
    """The default rig with 1.05 kg and 1.67 g m^2, and a contact that lasts for a step of 2 ms or the low-pass."""
    scenario = Scenario()
    scenario.sensor.bandwidth = bandwidth
    found = StoppingModel.of(scenario, mass=1.05, inertia=1.67e-3)
    delay = 2e-3 + 1.0 / (2.0 * math.pi * bandwidth) + 1e-3 + 2e-3
    assert found.period == 1e-3
    assert found.delay == pytest.approx(delay)
    # The rotor of 1e-6 kg m^2 on a screw of 5 mm adds 1e-6 (2 pi / 0.005)^2 = 1.5791 kg.
    assert found.feed_impact == pytest.approx((1.05 + 1.5791) / shortest, rel=1e-4)
    # A step of 0.18 degrees with 0.5 N m: K = (pi/2) 0.5 / 0.0031416 = 250 N m/rad.
    torque = 1.67e-3 / shortest + 0.75 + 250.0 * delay
    assert found.turn_impact == pytest.approx(torque / 0.010, rel=1e-4)


@pytest.mark.parametrize(("load", "share"), [(P.soft_force, 1.0), (HALF_FEED, 0.5), (MIDDLE, 0.0)])
def test_the_feed_into_the_hole_falls_to_zero_before_the_turns_are_reduced(load, share):
    dut, context = guard(wrench=push(load), feed_speed=[-0.02])
    settled(dut, context)
    assert outputs(dut, context)[2] == pytest.approx(-0.02 * share, abs=1e-9)


def test_a_rising_load_slows_the_feed_before_it_is_high():
    """By hand: after one sample the slope is T/(tau + T) F/T, and the load ahead F + slope (t + |v|/a)."""
    load = 4.5
    dut, context = guard(wrench=push(load), feed_speed=[-0.02])
    update(dut, context, period=STOPPING.period)
    slope = load / (SLOPE_TIME + STOPPING.period)
    ahead = load + slope * STOPPING.delay
    share = (MIDDLE - ahead) / (MIDDLE - P.soft_force)
    assert 0.0 < share < 1.0
    assert outputs(dut, context)[2] == pytest.approx(-0.02 * share)
    update(dut, context, period=STOPPING.period)  # now the feed moves: its stopping time counts too
    slope += 0.25 * (0.0 - slope)
    ahead = load + slope * (STOPPING.delay + 0.02 * share / STOPPING.deceleration)
    share = (MIDDLE - ahead) / (MIDDLE - P.soft_force)
    assert outputs(dut, context)[2] == pytest.approx(-0.02 * share)


def test_a_falling_load_does_not_count_as_less():
    dut, context = guard(wrench=push(P.hold_force), feed_speed=[-0.02])
    settled(dut, context)
    dut.GetInputPort("wrench").FixValue(context, push(HALF_FEED))
    update(dut, context, period=STOPPING.period)
    assert outputs(dut, context)[2] == pytest.approx(-0.01)


@pytest.mark.parametrize(("load", "share"), [(MIDDLE, 1.0), (HALF_TURN, 0.5), (P.hold_force, 0.0)])
def test_all_of_a_turn_but_its_part_that_lowers_the_load_is_reduced(load, share):
    dut, context = guard(wrench=moment(load), pitch_rate=[0.05], yaw_rate=[0.03])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([0.05 * share, 0.03 * share], abs=1e-9)
    dut.GetInputPort("pitch_rate").FixValue(context, [-0.05])  # with the moment on the hole
    assert rates(dut, context) == pytest.approx([-0.05, 0.03 * share], abs=1e-9)


def test_a_force_across_the_tip_counts_with_its_lever_about_the_mouth():
    """At a depth of 10 mm, 1 N across the tip along y turns the hole about x by -10 mN m."""
    dut, context = guard(wrench=np.array([0.0, HALF_TURN, 0.0, 0.0, 0.0, 0.0]), pitch_rate=[0.05], yaw_rate=[0.03])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([0.025, 0.015], abs=1e-9)


@pytest.mark.parametrize(("load", "share"), [(0.5 * (P.hold_force + P.force_limit), 0.5), (P.force_limit, 1.0)])
def test_above_the_hold_force_the_hole_turns_with_the_moment_whatever_the_impact_loads(load, share):
    dut, context = guard(stopping=SLOW, wrench=moment(load), pitch_rate=[0.2])
    settled(dut, context)
    assert rates(dut, context) == pytest.approx([-share * TURN_RATE, 0.0])


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
    update(dut, context, period=STOPPING.period, times=50)
    light = outputs(dut, context)[:2]
    dut.GetInputPort("wrench").FixValue(context, np.array([0.0, 0.0, 12.0, 0.0, 0.0, 0.0]))
    update(dut, context, period=STOPPING.period, times=50)
    assert outputs(dut, context)[0] > light[0] + 1e-3
    dut.GetInputPort("unwinding").FixValue(context, [1.0])
    update(dut, context, period=STOPPING.period, times=100)
    # The angles at the last sample with a light load, before the turn of that sample.
    assert outputs(dut, context)[:2] == pytest.approx(light, abs=0.1 * STOPPING.period * 1.01)


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


def clocking(dut, context):
    """The rate about the axis of the hole in the next update."""
    before = dut.GetOutputPort("target_clocking").Eval(context)[0]
    update(dut, context, period=STOPPING.period)
    return (dut.GetOutputPort("target_clocking").Eval(context)[0] - before) / STOPPING.period


def test_a_clocking_stage_turns_as_the_other_axes_do():
    twist = np.array([0.0, 0.0, 0.0, 0.0, 0.0, HALF_TURN * RADIUS])  # the hole feels the opposite moment
    dut, context = guard(clocking=1.0, wrench=twist, clocking_rate=[0.05])
    settled(dut, context)
    assert clocking(dut, context) == pytest.approx(0.5 * 0.05)  # against the moment, half of a turn is left
    dut.GetInputPort("clocking_rate").FixValue(context, [-0.05])
    assert clocking(dut, context) == pytest.approx(-0.05)
    dut.GetInputPort("wrench").FixValue(context, 2.0 * P.force_limit / HALF_TURN * twist)
    settled(dut, context)
    assert clocking(dut, context) == pytest.approx(-TURN_RATE)  # it yields
    turn = rates(dut, context)
    assert turn == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("load", [0.0, P.force_limit])
def test_a_rig_without_a_clocking_stage_does_not_turn_about_the_axis_of_the_hole(load):
    """Neither by a command, in free air, nor to yield to a moment."""
    dut, context = guard(wrench=np.array([0.0, 0.0, 0.0, 0.0, 0.0, load * RADIUS]), clocking_rate=[0.05])
    settled(dut, context)
    assert dut.GetOutputPort("target_clocking").Eval(context)[0] == 0.0


def test_after_a_fault_of_the_sensor_only_a_retraction_passes():
    for wrench in (push(2.0 * P.force_limit), push(-2.0 * P.force_limit), moment(2.0 * P.force_limit)):
        commands = {"pitch_rate": [0.1], "feed_speed": [-0.01], "unwinding": [1.0], "blind": [1.0]}
        dut, context = guard(wrench=wrench, **commands)
        settled(dut, context)
        assert outputs(dut, context) == [0.0, 0.0, 0.0]
        dut.GetInputPort("feed_speed").FixValue(context, [0.012])
        update(dut, context, period=STOPPING.period)
        assert outputs(dut, context) == [0.0, 0.0, 0.012]


def test_the_largest_measured_load_is_kept():
    """3 N across and 0.04 N m over 10 mm are 5 N."""
    dut, context = guard(wrench=np.array([0.0, 3.0, 0.0, 0.0, 0.0, 0.04]))
    assert dut.peak_load(context) == 0.0
    update(dut, context, period=STOPPING.period)
    dut.GetInputPort("wrench").FixValue(context, push(1.0))
    update(dut, context, period=STOPPING.period)
    assert dut.peak_load(context) == pytest.approx(5.0)


@dataclass(frozen=True)
class Brute(ControlLaw):
    """Pushes with 20 mm/s and turns at the largest rate, another way every millimetre, whatever it feels."""

    def act(self, measured, estimate=None):
        direction = 0.5 * math.pi * round(measured[6] / 1e-3)
        turn = 0.004 * np.array([math.cos(direction), math.sin(direction)])
        return Action(turn=turn, feed=-0.02 * self.period_)


@pytest.mark.parametrize("number", [50400, 50403])
def test_a_policy_that_ignores_the_force_keeps_the_limit(number):
    """Without the impact loads, these trials reach 60 N and 50 N."""
    scenario = trial_scenario(Scenario(), number=number)
    scenario.trial.time_limit = 2.0
    result, _ = run_trial(scenario, Brute(), seed=number)
    assert 0.4 * P.force_limit < result.peak_measured_load < P.force_limit
    assert result.peak_load < 1.2 * P.force_limit
