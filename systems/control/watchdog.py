"""The watchdog: it passes commands to the motors, and retracts the peg and stops after a fault."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import DcMotorParameters
from models.scenario import WatchdogParameters
from skill.arrays import Array
from systems.control.faults import Fault

COMMANDS = ("pitch_rate", "yaw_rate", "feed_speed", "unwinding")
AT_LIMIT = 0.95  # share of the current limit from which the current counts as limited


@dataclass(frozen=True)
class WatchdogState:
    """State of the watchdog between two periods.

    Attributes:
        fault: first fault found.
        since: time since that fault, s.
        pushed: distance commanded into the hole since the depth last changed, m.
        anchor: depth from which a change is measured, m.
    """

    fault: Fault = Fault.NONE
    since: float = 0.0
    pushed: float = 0.0
    anchor: float = 0.0

    def as_list(self) -> list[float]:
        """Returns the four numbers of the discrete state, in the order of the attributes."""
        return [float(self.fault), self.since, self.pushed, self.anchor]

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_list`."""
        fault, *others = values
        return cls(Fault(int(fault)), *others)


class Watchdog(LeafSystem):
    """
    .. pydrake_system::

        name: Watchdog
        input_ports:
        - pitch_rate
        - yaw_rate
        - feed_speed
        - unwinding
        - controller_failed
        - measurement_fault
        - wrench
        - depth
        - current
        - pitch_counts
        - yaw_counts
        output_ports:
        - pitch_rate
        - yaw_rate
        - feed_speed
        - unwinding
        - fault
        - stopped

    Every period the watchdog checks what the drives and the sensor monitor report. These are faults:

    * a fault of the `SensorMonitor`, or a failed controller,
    * lost steps, as the drive of a stepper reports them,
    * a stalled feed: ``feed_stall_distance`` was commanded into the hole, the depth changed by less than
      ``stall_depth``, and the contact carries less than half of the drive's force N eta k_t |i|, so that the contact is
      not the cause. If the current is at its limit the motor is stalled, else the depth encoder is stuck.

    ``fault`` (`Fault`) is the first fault and stays. From then on the turns stop, and the peg is retracted with
    ``retract_speed`` for ``back_off_time``. Then the feed stops, and ``stopped`` is 1.

    The watchdog has no output to the controller: the policy does not see what the drives report.
    """

    def __init__(self, *, parameters: WatchdogParameters, motor: DcMotorParameters) -> None:
        super().__init__()
        self._parameters = parameters
        self._motor = motor
        self._commands = {name: self.DeclareVectorInputPort(name, 1) for name in COMMANDS}
        self._failed = self.DeclareVectorInputPort("controller_failed", 1)
        self._measurement = self.DeclareVectorInputPort("measurement_fault", 1)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._current = self.DeclareVectorInputPort("current", 1)
        self._counts = {name: self.DeclareVectorInputPort(f"{name}_counts", 2) for name in ("pitch", "yaw")}
        self._state = self.DeclareDiscreteState(WatchdogState().as_list())
        self.DeclarePeriodicDiscreteUpdateEvent(parameters.period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        for name in COMMANDS:
            self.DeclareVectorOutputPort(name, 1, self._gate(name), {*state, self._commands[name].ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("stopped", 1, self._calc_stopped, state)

    def _watchdog_state(self, context: Context) -> WatchdogState:
        return WatchdogState.from_vector(context.get_discrete_state(self._state).value())

    def _command(self, name: str, context: Context) -> float:
        return float(self._commands[name].Eval(context)[0])

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state, p = self._watchdog_state(context), self._parameters
        if state.fault is not Fault.NONE:
            state = replace(state, since=state.since + p.period)
        else:
            depth, speed = self._depth.Eval(context)[0], self._command("feed_speed", context)
            still = speed < 0.0 and abs(depth - state.anchor) < p.stall_depth
            pushed = state.pushed - speed * p.period if still else 0.0
            state = WatchdogState(
                fault=self._find_fault(context, pushed=pushed),
                since=state.since,
                pushed=pushed,
                anchor=state.anchor if still else depth,
            )
        discrete_state.get_mutable_vector(self._state).SetFromVector(state.as_list())

    def _find_fault(self, context: Context, *, pushed: float) -> Fault:
        measurement = Fault(int(self._measurement.Eval(context)[0]))
        if measurement is not Fault.NONE:
            return measurement
        if self._failed.Eval(context)[0]:
            return Fault.CONTROLLER_FAILED
        for name, fault in (("pitch", Fault.PITCH_STEPS_LOST), ("yaw", Fault.YAW_STEPS_LOST)):
            _, lost = self._counts[name].Eval(context)
            if lost > 0:
                return fault
        if pushed >= self._parameters.feed_stall_distance:
            current = abs(self._current.Eval(context)[0])
            force = float(np.linalg.norm(self._wrench.Eval(context)[:3]))
            if force < 0.5 * self._motor.force_constant * current:
                limited = current >= AT_LIMIT * self._motor.current_limit
                return Fault.MOTOR_STALLED if limited else Fault.ENCODER_STUCK
        return Fault.NONE

    def _gate(self, name: str) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            state = self._watchdog_state(context)
            if state.fault is Fault.NONE:
                output[0] = self._command(name, context)
            elif name == "feed_speed":
                output[0] = 0.0 if self._is_stopped(state) else self._parameters.retract_speed
            else:
                output[0] = 0.0

        return calc

    def _is_stopped(self, state: WatchdogState) -> bool:
        return state.fault is not Fault.NONE and state.since >= self._parameters.back_off_time - 1e-9

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = self._watchdog_state(context).fault

    def _calc_stopped(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._is_stopped(self._watchdog_state(context)))
