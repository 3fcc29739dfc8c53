"""The drive monitor: what it makes of one period of the feed drive."""

from __future__ import annotations

import math
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from compiled import compiled
from skill.arrays import Array
from systems.law.faults import FEED_NUMBERS, Fault
from systems.law.part import Part

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario

AT_LIMIT = 0.95  # share of the current limit from which the current counts as limited
NO_CURRENT = 0.02  # share of the current limit below which the drive gives no current
COMMAND_MEMORY = 0.020  # in units of s; the speed loop follows its command within this time
MOTION_MEMORY = 0.050  # in units of s; motion against the command is forgotten after this time
ENCODER_SLACK = 0.1e-3  # in units of m; play of the screw
ENCODER_GAIN_ERROR = 0.02  # error of lead and scale that two sound encoders may have between them

# Places in the state.
FAULT = 0  # first fault found
STARTED = 1  # whether there has been a sample
TRAVEL = 2  # last count of the shaft's encoder, m
DEPTH = 3  # last depth, m
OFFSET = 4  # depth + travel at the start, m
PATH = 5  # path travelled, m
FASTEST = 6  # largest recent speed command, m/s
SLOWEST = 7  # smallest recent speed command, m/s
EXCESS = 8  # motion beyond the recent commands, m
PUSHED = 9  # distance commanded into the hole since the feed last moved, m
ANCHOR = 10  # travel from which a motion is measured, m
SIZE = 11


class DriveLimits(NamedTuple):
    """What a sound feed drive keeps.

    Attributes:
        stall_depth, stall_distance, follow_error: see `models.control.DriveMonitorParameters`.
        upper, lower: soft limits of the travel, as depths of the tip below the mouth, m.
        period: of the drive, s.
        slack: difference of the two encoders, m.
        command_fade, motion_fade: factors of commands and motions in a period.
        current_limit: of the drive, A.
        dead_current: a smaller current in a stall is a dead drive's, A.
        force_constant: N/A.
    """

    stall_depth: float
    stall_distance: float
    follow_error: float
    upper: float
    lower: float
    period: float
    slack: float
    command_fade: float
    motion_fade: float
    current_limit: float
    dead_current: float
    force_constant: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the limits of a resolved scenario."""
        p, motor, period = scenario.controller.drive_monitor, scenario.feed, scenario.contact.time_step
        count = motor.screw_lead / motor.encoder_counts
        current_per_distance = motor.speed_ki * motor.ratio / motor.resistance
        return cls(
            stall_depth=p.stall_depth,
            stall_distance=p.stall_distance,
            follow_error=p.follow_error,
            upper=-scenario.start.height - p.travel_above,
            lower=scenario.geometry.hole_depth + p.travel_below,
            period=period,
            slack=ENCODER_SLACK + 2.0 * scenario.rig.encoder_resolution + 2.0 * count,
            command_fade=math.exp(-period / COMMAND_MEMORY),
            motion_fade=math.exp(-period / MOTION_MEMORY),
            current_limit=motor.current_limit,
            dead_current=0.25 * min(motor.current_limit, current_per_distance * p.stall_distance),
            force_constant=motor.force_constant,
        )


@compiled
def drive_monitor_step(
    p: DriveLimits, state: Array, command: float, wrench: Array, depth: float, current: float, travel: float
) -> Array:
    """Returns the next state (SIZE,): the first fault of the feed drive and its encoders stays.

    The speed v that the encoder on the motor's shaft shows is compared with the command. The recent commands span the
    interval from the smallest to the largest command, with zero, each fading within `COMMAND_MEMORY`. Motion outside
    this interval accumulates. Beyond ``follow_error`` the feed is dead, if the drive gives no current (the carriage
    falls); else it runs away.

    If ``stall_distance`` was commanded into the hole and the shaft moved by less than ``stall_depth``, the feed is

    * dead, if the drive gives less than a quarter of the current of its integral gain,
    * stalled, if the current is at its limit and the contact carries less than half of the drive's force N eta k_t |i|.

    The depth encoder is stuck or slips if it differs from the shaft's encoder by more than `ENCODER_SLACK` and
    `ENCODER_GAIN_ERROR` of the path. The travel is limited.

    Args:
        p: limits.
        state: (SIZE,), after the last period.
        command: speed command that the drive receives, m/s, negative into the hole.
        wrench: (6,), measured wrench about the tip, N and N m.
        depth: measured depth, m.
        current: of the drive, A.
        travel: position of the carriage by the encoder on the motor's shaft, m.
    """
    found = state.copy()
    if state[FAULT] != 0.0:
        return found
    found[TRAVEL], found[DEPTH], found[STARTED] = travel, depth, 1.0
    if state[STARTED] == 0.0:
        found[OFFSET], found[ANCHOR] = depth + travel, travel
    else:
        T, fade = p.period, p.command_fade
        moved = travel - state[TRAVEL]
        fastest, slowest = max(command, 0.0, state[FASTEST] * fade), min(command, 0.0, state[SLOWEST] * fade)
        beyond = max(moved - fastest * T, 0.0) + min(moved - slowest * T, 0.0)
        still = command < 0.0 and abs(travel - state[ANCHOR]) < p.stall_depth
        found[PATH] += abs(moved)
        found[FASTEST], found[SLOWEST] = fastest, slowest
        found[EXCESS] = state[EXCESS] * p.motion_fade + beyond
        found[PUSHED] = state[PUSHED] - command * T if still else 0.0
        found[ANCHOR] = state[ANCHOR] if still else travel
    found[FAULT] = _fault(p, found, command, wrench, abs(current))
    return found


@compiled
def is_enabled(state: Array) -> bool:
    """Returns whether the drive stays on: not after a fault of the feed drive."""
    return int(state[FAULT]) not in FEED_NUMBERS


@compiled
def _fault(p: DriveLimits, state: Array, command: float, wrench: Array, current: float) -> int:
    if abs(state[EXCESS]) > p.follow_error:
        dead = current < NO_CURRENT * p.current_limit
        return Fault.FEED_DEAD.value if dead else Fault.FEED_RUNS_AWAY.value
    if abs(state[DEPTH] + state[TRAVEL] - state[OFFSET]) > p.slack + ENCODER_GAIN_ERROR * state[PATH]:
        return Fault.ENCODER_STUCK.value
    # A feed that leaves its limit again may be beyond it.
    if state[DEPTH] < p.upper and command > 0.0:
        return Fault.UPPER_TRAVEL_LIMIT.value
    if state[DEPTH] > p.lower and command < 0.0:
        return Fault.LOWER_TRAVEL_LIMIT.value
    if state[PUSHED] >= p.stall_distance:
        return _named_stall(p, wrench, current)
    return 0


@compiled
def _named_stall(p: DriveLimits, wrench: Array, current: float) -> int:
    """Names a feed that does not move."""
    if current < p.dead_current:
        return Fault.FEED_DEAD.value
    force = np.sqrt(wrench[0] ** 2 + wrench[1] ** 2 + wrench[2] ** 2)
    if current >= AT_LIMIT * p.current_limit and force < 0.5 * p.force_constant * current:
        return Fault.MOTOR_STALLED.value
    return 0


class DriveMonitor(Part):
    """
    .. pydrake_system::

        name: DriveMonitor
        input_ports:
        - feed_speed
        - wrench
        - depth
        - current
        - travel
        output_ports:
        - fault
        - feed_enabled

    Once per period of the drive, it looks for faults by `drive_monitor_step`. ``fault`` (`Fault`) is the first fault
    and stays. After a fault of the feed drive ``feed_enabled`` is 0, which switches the drive off. ``feed_speed`` is
    the command that the drive receives, m/s; ``travel`` and ``depth`` in m, ``current`` in A.

    Args:
        limits: what a sound drive keeps.
    """

    def __init__(self, limits: DriveLimits) -> None:
        inputs = {"feed_speed": 1, "wrench": 6, "depth": 1, "current": 1, "travel": 1}
        step = partial(drive_monitor_step, limits)
        super().__init__(inputs, state=np.zeros(SIZE), period=limits.period, step=step)
        self.declare_output("fault", 1, itemgetter(FAULT))
        self.declare_output("feed_enabled", 1, is_enabled)
