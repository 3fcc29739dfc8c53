import math

import pytest

from models.scenario import Scenario
from systems.law.drive_monitor import ENCODER_GAIN_ERROR, ENCODER_SLACK, DriveLimits, DriveMonitor
from systems.law.faults import Fault
from tests.stepping import fixed_context, update

S = Scenario()
P, MOTOR, LIMITS = S.controller.drive_monitor, S.feed, DriveLimits.of(S)
PERIOD, RESOLUTION = 2e-3, 5e-6
START = -0.003  # in units of m, depth


class Feed:
    """A feed with its monitor, one period at a time."""

    def __init__(self, current=0.4, wrench=(0.0,) * 6, depth=START):
        self.dut = DriveMonitor(LIMITS)
        self.travel, self.depth = 0.080 - depth, depth
        self.context = fixed_context(
            self.dut, feed_speed=[0.0], wrench=wrench, depth=[depth], current=[current], travel=[self.travel]
        )
        update(self.dut, self.context, period=PERIOD)

    def run(self, command, speed=None, *, periods=1, scale=1.0, current=None):
        """Commands a speed and moves with another one; the depth encoder has a scale. Returns the fault."""
        for _ in range(periods):
            moved = (command if speed is None else speed) * PERIOD
            self.travel, self.depth = self.travel + moved, self.depth - scale * moved
            values = {"feed_speed": command, "travel": self.travel, "depth": self.depth}
            values |= {} if current is None else {"current": current}
            for name, value in values.items():
                self.dut.GetInputPort(name).FixValue(self.context, [value])
            update(self.dut, self.context, period=PERIOD)
        return self.dut.GetOutputPort("fault").Eval(self.context)[0]

    @property
    def enabled(self):
        return self.dut.GetOutputPort("feed_enabled").Eval(self.context)[0] == 1.0


@pytest.mark.parametrize(
    ("command", "speed", "current", "fault"),
    [
        (-0.02, 0.02, 0.5, Fault.FEED_RUNS_AWAY),
        (0.015, -0.015, 0.3, Fault.FEED_RUNS_AWAY),
        (-0.02, -0.2, -1.0, Fault.FEED_RUNS_AWAY),
        (-0.02, 0.2, 1.0, Fault.FEED_RUNS_AWAY),
        (0.0, 0.1, 1.0, Fault.FEED_RUNS_AWAY),
        (0.0, -0.1, 0.0, Fault.FEED_DEAD),
        (-0.01, -0.1, 0.0, Fault.FEED_DEAD),
    ],
)
def test_motion_beyond_the_command_names_the_drive_and_switches_it_off(command, speed, current, fault):
    feed = Feed(current=current)
    beyond = abs(speed) if speed * command <= 0.0 else abs(speed) - abs(command)
    permitted = math.floor(P.follow_error / (beyond * PERIOD))
    assert feed.run(command, speed, periods=max(permitted, 1)) == Fault.NONE or permitted == 0
    assert feed.run(command, speed, periods=permitted + 2) == fault
    assert not feed.enabled
    assert feed.run(0.0, periods=5) == fault


def test_a_command_may_be_followed_late():
    """The speed decays from 30 mm/s with a time constant of 5 ms after the command has become zero: 0.15 mm."""
    feed = Feed()
    assert feed.run(-0.03, periods=50) == Fault.NONE
    for k in range(50):
        assert feed.run(0.0, -0.03 * math.exp(-(k + 1) * PERIOD / 0.005)) == Fault.NONE


PUSHING = round(P.stall_distance / 0.01 / PERIOD)  # periods at 10 mm/s


@pytest.mark.parametrize(
    ("current", "force", "fault"),
    [
        (-1.0, 0.0, Fault.MOTOR_STALLED),
        (-0.96, 0.0, Fault.MOTOR_STALLED),
        (-0.94, 0.0, Fault.NONE),
        (-1.0, 0.51 * MOTOR.force_constant, Fault.NONE),
        (-1.0, 0.49 * MOTOR.force_constant, Fault.MOTOR_STALLED),
        (-0.24, 10.0, Fault.FEED_DEAD),  # the integral gain gives 1 A after 0.9 mm
        (-0.26, 10.0, Fault.NONE),
    ],
)
def test_a_feed_that_does_not_move_is_stalled_or_dead_or_blocked_by_the_contact(current, force, fault):
    feed = Feed(current=current, wrench=(0.0, 0.6 * force, 0.8 * force, 9.0, 0.0, 0.0))
    assert feed.run(-0.01, 0.0, periods=PUSHING - 2) == Fault.NONE
    assert feed.run(-0.01, 0.0, periods=4) == fault
    assert feed.enabled == (fault != Fault.FEED_DEAD)


def test_a_drive_without_an_integral_gain_is_not_dead():
    scenario = Scenario()
    scenario.feed.speed_ki = 0.0
    dut = DriveMonitor(DriveLimits.of(scenario))
    inputs = {"feed_speed": [-0.01], "wrench": [0.0] * 6, "depth": [0.0], "current": [0.1], "travel": [0.08]}
    context = fixed_context(dut, **inputs)
    update(dut, context, period=PERIOD, times=2 * PUSHING)
    assert dut.GetOutputPort("fault").Eval(context)[0] == Fault.NONE


def test_a_feed_that_moves_or_is_retracted_in_between_is_not_stalled():
    feed = Feed(current=-1.0)
    for _ in range(6):
        assert feed.run(-0.01, 0.0, periods=PUSHING - 2) == Fault.NONE
        assert feed.run(0.01, 0.0, periods=1) == Fault.NONE
    for _ in range(6):
        assert feed.run(-0.01, 0.0, periods=PUSHING - 20) == Fault.NONE
        assert feed.run(-0.01, periods=18) == Fault.NONE  # 0.36 mm


SLACK = ENCODER_SLACK + 2 * RESOLUTION + 2 * MOTOR.screw_lead / MOTOR.encoder_counts


@pytest.mark.parametrize("scale", [0.0, 0.9, 1.1])
def test_an_encoder_that_stands_or_slips_while_the_shaft_turns_is_found(scale):
    feed = Feed()
    path = SLACK / (abs(1.0 - scale) - ENCODER_GAIN_ERROR)
    assert feed.run(-0.01, periods=math.floor(path / (0.01 * PERIOD)), scale=scale) == Fault.NONE
    assert feed.run(-0.01, periods=3, scale=scale) == Fault.ENCODER_STUCK
    assert feed.enabled


def test_the_travel_is_limited_in_the_direction_of_the_limit_only():
    for depth, fault, outward in (
        (LIMITS.upper - 1e-4, Fault.UPPER_TRAVEL_LIMIT, 0.01),
        (LIMITS.lower + 1e-4, Fault.LOWER_TRAVEL_LIMIT, -0.01),
    ):
        assert Feed(depth=depth).run(-outward, periods=3) == Fault.NONE
        assert Feed(depth=depth).run(outward) == fault


def test_the_limits_lie_above_the_start_and_below_the_bottom():
    assert (LIMITS.upper, LIMITS.lower) == pytest.approx((-0.013, 0.026))
