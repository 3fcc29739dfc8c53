"""Stands between controller and motors: lets commands through while all is well, else draws back and stops."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import DcMotorParameters
from models.scenario import ControllerParameters
from systems.control.faults import Fault

FAULT, SINCE, PITCH, YAW, PUSHED, ANCHOR = range(6)
COMMANDS = ("target_pitch", "target_yaw", "feed_speed")
NEARLY = 0.95  # of the current limit


class Watchdog(LeafSystem):
    """
    .. pydrake_system::

        name: Watchdog
        input_ports:
        - target_pitch
        - target_yaw
        - feed_speed
        - controller_failed
        - measurement_fault
        - wrench
        - depth
        - current
        - pitch_counts
        - yaw_counts
        output_ports:
        - target_pitch
        - target_yaw
        - feed_speed
        - fault
        - stopped

    Every period it looks at what the drives and the checked sensors report. A fault is

    * what the `SensorMonitor` found, or the controller's own failure,
    * a stepper whose drive has found steps lost,
    * a feed that was commanded into the hole by ``back_off_distance`` without the depth changing by ``stall_depth``,
      while the contact carries less than half of the drive's force N eta k_t |i|, so that it is not the contact that
      holds it: the motor is stalled if its current is at the limit, else the depth encoder is stuck.

    The first ``fault`` (`Fault`) stays. From then on the angles stand where they were, the peg is drawn back with
    ``retract_speed`` for ``back_off_time``, and then the feed stands still: ``stopped`` is 1.

    It has nothing to say to the controller: what it knows of the drives does not reach the skill.
    """

    def __init__(self, *, parameters: ControllerParameters, motor: DcMotorParameters) -> None:
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
        self._state = self.DeclareDiscreteState(np.zeros(6))
        self.DeclarePeriodicDiscreteUpdateEvent(parameters.period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        for name in COMMANDS:
            self.DeclareVectorOutputPort(name, 1, self._gate(name), {*state, self._commands[name].ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("stopped", 1, self._calc_stopped, state)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p = self._parameters
        state = context.get_discrete_state(self._state).value().copy()
        if state[FAULT] != Fault.NONE:
            state[SINCE] += p.period
        else:
            depth, speed = self._depth.Eval(context)[0], self._commands["feed_speed"].Eval(context)[0]
            still = speed < 0.0 and abs(depth - state[ANCHOR]) < p.stall_depth
            state[PUSHED] = state[PUSHED] - speed * p.period if still else 0.0
            state[ANCHOR] = state[ANCHOR] if still else depth
            state[FAULT] = self._fault(context, pushed=state[PUSHED])
            state[[PITCH, YAW]] = [self._commands[f"target_{name}"].Eval(context)[0] for name in ("pitch", "yaw")]
        discrete_state.get_mutable_vector(self._state).SetFromVector(state)

    def _fault(self, context: Context, *, pushed: float) -> Fault:
        measurement = Fault(int(self._measurement.Eval(context)[0]))
        if measurement != Fault.NONE:
            return measurement
        if self._failed.Eval(context)[0]:
            return Fault.CONTROLLER_FAILED
        for name, fault in (("pitch", Fault.PITCH_STEPS_LOST), ("yaw", Fault.YAW_STEPS_LOST)):
            if self._counts[name].Eval(context)[1] > 0:
                return fault
        if pushed >= self._parameters.back_off_distance:
            current = abs(self._current.Eval(context)[0])
            force = float(np.linalg.norm(self._wrench.Eval(context)[:3]))
            if force < 0.5 * self._motor.force_constant * current:
                at_limit = current >= NEARLY * self._motor.current_limit
                return Fault.MOTOR_STALLED if at_limit else Fault.ENCODER_STUCK
        return Fault.NONE

    def _gate(self, name: str) -> Callable[[Context, BasicVector], None]:
        held = {"target_pitch": PITCH, "target_yaw": YAW}

        def calc(context: Context, output: BasicVector) -> None:
            state = context.get_discrete_state(self._state).value()
            if state[FAULT] == Fault.NONE:
                output[0] = self._commands[name].Eval(context)[0]
            elif name in held:
                output[0] = state[held[name]]
            else:
                output[0] = 0.0 if self._is_stopped(context) else self._parameters.retract_speed

        return calc

    def _is_stopped(self, context: Context) -> bool:
        state = context.get_discrete_state(self._state).value()
        return bool(state[FAULT] != Fault.NONE and state[SINCE] >= self._parameters.back_off_time - 1e-9)

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state).value()[FAULT]

    def _calc_stopped(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._is_stopped(context))
