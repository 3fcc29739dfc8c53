"""The drive monitor: it compares the feed's motion with its command, its current and the depth encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Self

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import DcMotorParameters
from models.scenario import Scenario, WatchdogParameters
from systems.control.faults import FEED_FAULTS, Fault

AT_LIMIT = 0.95  # share of the current limit from which the current counts as limited
NO_CURRENT = 0.02  # share of the current limit below which the drive gives no current
COMMAND_MEMORY = 0.020  # in units of s; the speed loop follows its command within this time
MOTION_MEMORY = 0.050  # in units of s; motion against the command is forgotten after this time
ENCODER_SLACK = 0.1e-3  # in units of m; play of the screw
ENCODER_GAIN_ERROR = 0.02  # error of lead and scale that two sound encoders may have between them


@dataclass(frozen=True)
class Travel:
    """The soft limits of the feed's travel, as depths of the tip below the mouth, m."""

    upper: float
    lower: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the limits of a resolved scenario."""
        p = scenario.controller
        return cls(upper=-scenario.start.height - p.travel_above, lower=scenario.geometry.hole_depth + p.travel_below)


class Index(IntEnum):
    """Places in the discrete state of the monitor."""

    FAULT = 0  # first fault found
    STARTED = 1  # whether there has been a sample
    TRAVEL = 2  # last count of the shaft's encoder, m
    DEPTH = 3  # last depth, m
    OFFSET = 4  # depth + travel at the start, m
    PATH = 5  # path travelled, m
    IDLE = 6  # path travelled since the depth last changed, m
    FASTEST = 7  # largest recent speed command, m/s
    SLOWEST = 8  # smallest recent speed command, m/s
    EXCESS = 9  # motion beyond the recent commands, m
    PUSHED = 10  # distance commanded since the feed last moved, m
    ANCHOR = 11  # travel from which a motion is measured, m
    SPEED = 12  # speed of the shaft, as travel, m/s
    SIZE = 13


class DriveMonitor(LeafSystem):
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

    Once per period of the drive, the monitor compares the speed v that the encoder on the motor's shaft shows with the
    command. The recent commands span the interval from the smallest to the largest command, with zero, each fading
    within `COMMAND_MEMORY`. Motion outside this interval accumulates. Beyond ``follow_error`` the feed is

    * dead, if the drive gives no current (the carriage falls),
    * reversed, if it moves against its command and no faster than twice its command,
    * else it runs away.

    If ``feed_stall_distance`` was commanded into the hole and the shaft turned by less than ``stall_depth``, the feed is

    * dead, if the drive gives less than a quarter of the current of its integral gain,
    * stalled, if the current is at its limit and the contact carries less than half of the drive's force N eta k_t |i|.

    The depth encoder is stuck if the depth does not change while the shaft turns, and contradicted if it differs from
    the shaft's encoder by more than `ENCODER_SLACK` and `ENCODER_GAIN_ERROR` of the path. The travel is limited.

    ``fault`` (`Fault`) is the first fault and stays. After a fault of the feed drive ``feed_enabled`` is 0, which
    switches the drive off. ``feed_speed`` is the command that the drive receives, m/s; ``travel`` and ``depth`` in m.
    """

    def __init__(
        self,
        *,
        parameters: WatchdogParameters,
        motor: DcMotorParameters,
        travel: Travel,
        resolution: float,
        period: float,
    ) -> None:
        """Stores the limits.

        Args:
            parameters: thresholds.
            motor: parameters of the feed drive.
            travel: soft limits.
            resolution: resolution of the depth encoder, m.
            period: of the drive, s.
        """
        super().__init__()
        self._parameters = parameters
        self._motor = motor
        self._travel_limits = travel
        self._period = period
        count = motor.screw_lead / motor.encoder_counts
        self._slack = ENCODER_SLACK + 2.0 * resolution + 2.0 * count
        self._command_fade = math.exp(-period / COMMAND_MEMORY)
        self._motion_fade = math.exp(-period / MOTION_MEMORY)
        current_per_distance = motor.speed_ki * motor.ratio / motor.resistance
        self._dead_current = 0.25 * min(motor.current_limit, current_per_distance * parameters.feed_stall_distance)
        self._feed_speed = self.DeclareVectorInputPort("feed_speed", 1)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._current = self.DeclareVectorInputPort("current", 1)
        self._travel = self.DeclareVectorInputPort("travel", 1)
        self._state = self.DeclareDiscreteState(np.zeros(Index.SIZE))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("feed_enabled", 1, self._calc_enabled, state)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value().tolist()
        if state[Index.FAULT] != Fault.NONE:
            return
        travel, depth = float(self._travel.Eval(context)[0]), float(self._depth.Eval(context)[0])
        if not state[Index.STARTED]:
            state[Index.STARTED] = 1.0
            state[Index.TRAVEL] = state[Index.ANCHOR] = travel
            state[Index.DEPTH], state[Index.OFFSET] = depth, depth + travel
        command = float(self._feed_speed.Eval(context)[0])
        self._follow(state, travel=travel, depth=depth, command=command)
        state[Index.FAULT] = float(self._find_fault(context, state, command))
        discrete_state.set_value(self._state, state)

    def _follow(self, state: list[float], *, travel: float, depth: float, command: float) -> None:
        """Advances the state, except for the fault."""
        moved = travel - state[Index.TRAVEL]
        state[Index.SPEED] = moved / self._period
        state[Index.FASTEST] = max(command, 0.0, state[Index.FASTEST] * self._command_fade)
        state[Index.SLOWEST] = min(command, 0.0, state[Index.SLOWEST] * self._command_fade)
        beyond = max(moved - state[Index.FASTEST] * self._period, 0.0)
        beyond += min(moved - state[Index.SLOWEST] * self._period, 0.0)
        state[Index.EXCESS] = state[Index.EXCESS] * self._motion_fade + beyond
        state[Index.PATH] += abs(moved)
        state[Index.IDLE] = state[Index.IDLE] + abs(moved) if depth == state[Index.DEPTH] else 0.0
        still = command < 0.0 and abs(travel - state[Index.ANCHOR]) < self._parameters.stall_depth
        state[Index.PUSHED] = state[Index.PUSHED] - command * self._period if still else 0.0
        if not still:
            state[Index.ANCHOR] = travel
        state[Index.TRAVEL], state[Index.DEPTH] = travel, depth

    def _find_fault(self, context: Context, state: list[float], command: float) -> Fault:
        p = self._parameters
        if abs(state[Index.EXCESS]) > p.follow_error:
            return self._name_motion(state, float(self._current.Eval(context)[0]))
        if state[Index.IDLE] > self._slack:
            return Fault.ENCODER_STUCK
        contradiction = abs(state[Index.DEPTH] + state[Index.TRAVEL] - state[Index.OFFSET])
        if contradiction > self._slack + ENCODER_GAIN_ERROR * state[Index.PATH]:
            return Fault.ENCODER_CONTRADICTED
        # A feed that leaves the limit again may pass it.
        if state[Index.DEPTH] < self._travel_limits.upper and command > 0.0:
            return Fault.UPPER_TRAVEL_LIMIT
        if state[Index.DEPTH] > self._travel_limits.lower and command < 0.0:
            return Fault.LOWER_TRAVEL_LIMIT
        if state[Index.PUSHED] >= p.feed_stall_distance:
            return self._name_stall(context)
        return Fault.NONE

    def _name_motion(self, state: list[float], current: float) -> Fault:
        """Names a motion beyond the command."""
        if abs(current) < NO_CURRENT * self._motor.current_limit:
            return Fault.FEED_DEAD
        fastest, slowest, speed = state[Index.FASTEST], state[Index.SLOWEST], state[Index.SPEED]
        against = fastest + slowest < 0.0 if state[Index.EXCESS] > 0.0 else fastest + slowest > 0.0
        slow = abs(speed) < 2.0 * max(fastest, -slowest)
        return Fault.FEED_REVERSED if against and slow else Fault.FEED_RUNS_AWAY

    def _name_stall(self, context: Context) -> Fault:
        """Names a feed that does not move."""
        current = abs(float(self._current.Eval(context)[0]))
        if current < self._dead_current:
            return Fault.FEED_DEAD
        force = float(np.linalg.norm(self._wrench.Eval(context)[:3]))
        limited = current >= AT_LIMIT * self._motor.current_limit
        if limited and force < 0.5 * self._motor.force_constant * current:
            return Fault.MOTOR_STALLED
        return Fault.NONE

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state).value()[Index.FAULT]

    def _calc_enabled(self, context: Context, output: BasicVector) -> None:
        output[0] = float(context.get_discrete_state(self._state).value()[Index.FAULT] not in FEED_FAULTS)
