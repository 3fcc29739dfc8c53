"""The drive monitor: it compares the feed's motion with its command, its current and the depth encoder."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.control import DriveMonitorParameters
from models.hardware import DcMotorParameters
from models.scenario import Scenario
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
        p = scenario.controller.drive_monitor
        return cls(upper=-scenario.start.height - p.travel_above, lower=scenario.geometry.hole_depth + p.travel_below)


class DriveState(NamedTuple):
    """State of the monitor between two periods.

    Attributes:
        fault: first fault found.
        started: whether there has been a sample.
        travel: last count of the shaft's encoder, m.
        depth: last depth, m.
        offset: depth + travel at the start, m.
        path: path travelled, m.
        idle: path travelled since the depth last changed, m.
        fastest: largest recent speed command, m/s.
        slowest: smallest recent speed command, m/s.
        excess: motion beyond the recent commands, m.
        pushed: distance commanded into the hole since the feed last moved, m.
        anchor: travel from which a motion is measured, m.
        speed: speed of the shaft, as travel, m/s.
    """

    fault: float = 0.0
    started: float = 0.0
    travel: float = 0.0
    depth: float = 0.0
    offset: float = 0.0
    path: float = 0.0
    idle: float = 0.0
    fastest: float = 0.0
    slowest: float = 0.0
    excess: float = 0.0
    pushed: float = 0.0
    anchor: float = 0.0
    speed: float = 0.0


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

    If ``stall_distance`` was commanded into the hole and the shaft moved by less than ``stall_depth``, the feed
    is

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
        parameters: DriveMonitorParameters,
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
        self._dead_current = 0.25 * min(motor.current_limit, current_per_distance * parameters.stall_distance)
        self._feed_speed = self.DeclareVectorInputPort("feed_speed", 1)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._current = self.DeclareVectorInputPort("current", 1)
        self._travel = self.DeclareVectorInputPort("travel", 1)
        self._state = self.DeclareDiscreteState(list(DriveState()))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("feed_enabled", 1, self._calc_enabled, state)

    def _drive_state(self, context: Context) -> DriveState:
        return DriveState._make(context.get_discrete_state(self._state).value().tolist())

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = self._drive_state(context)
        if state.fault != Fault.NONE:
            return
        command = self._feed_speed.Eval(context).item()
        state = self._next_state(state, command, self._travel.Eval(context).item(), self._depth.Eval(context).item())
        fault = self._find_fault(context, state, command)
        discrete_state.set_value(state if fault is Fault.NONE else state._replace(fault=float(fault)))

    def _next_state(self, last: DriveState, command: float, travel: float, depth: float) -> DriveState:
        if not last.started:
            return DriveState(started=1.0, travel=travel, depth=depth, offset=depth + travel, anchor=travel)
        T, fade = self._period, self._command_fade
        moved = travel - last.travel
        distance = abs(moved)
        fastest, slowest = max(command, 0.0, last.fastest * fade), min(command, 0.0, last.slowest * fade)
        beyond = max(moved - fastest * T, 0.0) + min(moved - slowest * T, 0.0)
        still = command < 0.0 and abs(travel - last.anchor) < self._parameters.stall_depth
        return DriveState(
            0.0,
            1.0,
            travel,
            depth,
            last.offset,
            last.path + distance,
            last.idle + distance if depth == last.depth else 0.0,
            fastest,
            slowest,
            last.excess * self._motion_fade + beyond,
            last.pushed - command * T if still else 0.0,
            last.anchor if still else travel,
            moved / T,
        )

    def _find_fault(self, context: Context, state: DriveState, command: float) -> Fault:
        p, limits = self._parameters, self._travel_limits
        if abs(state.excess) > p.follow_error:
            return self._name_motion(state, abs(self._current.Eval(context).item()))
        if state.idle > self._slack:
            return Fault.ENCODER_STUCK
        if abs(state.depth + state.travel - state.offset) > self._slack + ENCODER_GAIN_ERROR * state.path:
            return Fault.ENCODER_CONTRADICTED
        # A feed that leaves its limit again may be beyond it.
        if state.depth < limits.upper and command > 0.0:
            return Fault.UPPER_TRAVEL_LIMIT
        if state.depth > limits.lower and command < 0.0:
            return Fault.LOWER_TRAVEL_LIMIT
        if state.pushed >= p.stall_distance:
            return self._name_stall(context, abs(self._current.Eval(context).item()))
        return Fault.NONE

    def _name_motion(self, state: DriveState, current: float) -> Fault:
        """Names a motion beyond the command."""
        if current < NO_CURRENT * self._motor.current_limit:
            return Fault.FEED_DEAD
        commanded = state.slowest if state.excess > 0.0 else state.fastest  # the opposite direction
        along = state.fastest if state.excess > 0.0 else -state.slowest
        against = abs(commanded) > along and abs(state.speed) < 2.0 * abs(commanded)
        return Fault.FEED_REVERSED if against else Fault.FEED_RUNS_AWAY

    def _name_stall(self, context: Context, current: float) -> Fault:
        """Names a feed that does not move."""
        if current < self._dead_current:
            return Fault.FEED_DEAD
        force = float(np.linalg.norm(self._wrench.Eval(context)[:3]))
        limited = current >= AT_LIMIT * self._motor.current_limit
        if limited and force < 0.5 * self._motor.force_constant * current:
            return Fault.MOTOR_STALLED
        return Fault.NONE

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = self._drive_state(context).fault

    def _calc_enabled(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._drive_state(context).fault not in FEED_FAULTS)
