"""Models the feed drive: a DC motor on a lead screw, with a PI speed controller and a current limit."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import DcMotorParameters
from systems.steps.dc_motor import CURRENT, SIZE, Drive, carriage_force, counted_travel, dc_motor_step


class DcMotor(LeafSystem):
    """
    .. pydrake_system::

        name: DcMotor
        input_ports:
        - speed_command
        - carriage_state
        - enabled
        output_ports:
        - carriage_force
        - current
        - travel

    The drive of `dc_motor_step`. The plant's joint actuator models the rotor's inertia. ``speed_command`` is in m/s,
    ``carriage_state`` is [position, velocity] in m, m/s, ``carriage_force`` is in N and ``current`` in A. While
    ``enabled`` is 0 a relay joins the motor's terminals, whatever the controller does. ``travel`` is the position of
    the carriage (m, upwards) as the encoder on the motor's shaft counts it.

    Args:
        parameters: Parameters of the motor.
        period: Period T of the speed controller, s.
    """

    def __init__(self, *, parameters: DcMotorParameters, period: float) -> None:
        super().__init__()
        self._drive = Drive.of(parameters, period=period)
        self._speed_command = self.DeclareVectorInputPort("speed_command", 1)
        self._carriage_state = self.DeclareVectorInputPort("carriage_state", 2)
        self._enabled = self.DeclareVectorInputPort("enabled", 1)
        self._state = self.DeclareDiscreteState(SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort("carriage_force", 1, self._calc_force, {state, self._carriage_state.ticket()})
        self.DeclareVectorOutputPort("current", 1, self._calc_current, {state})
        self.DeclareVectorOutputPort("travel", 1, self._calc_travel, {self._carriage_state.ticket()})

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        found = dc_motor_step(
            self._drive,
            np.array(context.get_discrete_state(self._state).value()),
            self._speed_command.Eval(context)[0],
            self._carriage_state.Eval(context)[1],
            self._enabled.Eval(context)[0] != 0.0,
        )
        discrete_state.set_value(self._state, found)

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        current, speed = context.get_discrete_state(self._state)[CURRENT], self._carriage_state.Eval(context)[1]
        output[0] = carriage_force(self._drive, current, speed)

    def _calc_current(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state)[CURRENT]

    def _calc_travel(self, context: Context, output: BasicVector) -> None:
        output[0] = counted_travel(self._drive, self._carriage_state.Eval(context)[0])
