"""Models the feed drive: a DC motor on a lead screw, with a PI speed controller and a current limit."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import DcMotorParameters

FRICTION_SPEED = 2.0  # in units of rad/s; scale of the tanh that smooths Coulomb friction


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

    Let w = N v be the motor's speed (N = 2 pi / lead, rad/m) and w* = N v* its command. Every period T,

        u = k_p (w* - w) + k_i integral(w* - w) + k_e w*,      |u| <= supply voltage,
        i+ = i e^{-RT/L} + (u - k_e w)/R (1 - e^{-RT/L}),      |i+| <= i_max  (u is limited to ensure this),

    which is the exact solution of L di/dt = u - R i - k_e w over one period. The integral is frozen while a limit is
    active and the error would drive the voltage further beyond it. The force on the carriage is

        F = N (eta k_t i - b w - tau_c tanh(w / w_0)).

    The plant's joint actuator models the rotor's inertia. ``speed_command`` is in m/s, ``carriage_state`` is
    [position, velocity] in m, m/s, ``carriage_force`` is in N and ``current`` in A.

    While ``enabled`` is 0 a relay disconnects the motor from its controller and joins its terminals: u = 0, the current
    -k_e w/R brakes the rotor, and the integral is cleared. This works whatever the controller does.

    ``travel`` is the position of the carriage (m, upwards) as the encoder on the motor's shaft counts it.

    Args:
        parameters: Parameters of the motor.
        period: Period T of the speed controller, s.
    """

    def __init__(self, *, parameters: DcMotorParameters, period: float) -> None:
        super().__init__()
        self._parameters = parameters
        self._period = period
        self._ratio = parameters.ratio
        self._decay = math.exp(-parameters.resistance * period / parameters.inductance)
        self._speed_command = self.DeclareVectorInputPort("speed_command", 1)
        self._carriage_state = self.DeclareVectorInputPort("carriage_state", 2)
        self._enabled = self.DeclareVectorInputPort("enabled", 1)
        self._count = parameters.screw_lead / parameters.encoder_counts
        self._state = self.DeclareDiscreteState(np.zeros(2))  # current (A) and integral of the speed error (rad)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort("carriage_force", 1, self._calc_force, {state, self._carriage_state.ticket()})
        self.DeclareVectorOutputPort("current", 1, self._calc_current, {state})
        self.DeclareVectorOutputPort("travel", 1, self._calc_travel, {self._carriage_state.ticket()})

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p, decay = self._parameters, self._decay
        current, integral = context.get_discrete_state(self._state).value().tolist()
        w = self._ratio * float(self._carriage_state.Eval(context)[1])
        if not self._enabled.Eval(context)[0]:
            braking = current * decay - p.torque_constant * w / p.resistance * (1.0 - decay)
            discrete_state.get_mutable_vector(self._state).SetFromVector([braking, 0.0])
            return
        command = self._ratio * float(self._speed_command.Eval(context)[0])
        error = command - w
        voltage = p.speed_kp * error + p.speed_ki * integral + p.torque_constant * command
        back_emf = p.torque_constant * w
        # The voltages after which the current is at its limits.
        gain = p.resistance / (1.0 - decay)
        minimum = max(-p.supply_voltage, back_emf + gain * (-p.current_limit - current * decay))
        maximum = min(p.supply_voltage, back_emf + gain * (p.current_limit - current * decay))
        applied = min(max(voltage, minimum), maximum)
        saturated = applied != voltage and (voltage - applied) * error > 0
        if not saturated:
            integral += error * self._period
        current = current * decay + (applied - back_emf) / gain
        discrete_state.get_mutable_vector(self._state).SetFromVector([current, integral])

    def _calc_force(self, context: Context, output: BasicVector) -> None:
        p = self._parameters
        current = context.get_discrete_state(self._state)[0]
        w = self._ratio * float(self._carriage_state.Eval(context)[1])
        friction = p.viscous_friction * w + p.coulomb_friction * math.tanh(w / FRICTION_SPEED)
        output[0] = self._ratio * (p.screw_efficiency * p.torque_constant * current - friction)

    def _calc_current(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state)[0]

    def _calc_travel(self, context: Context, output: BasicVector) -> None:
        output[0] = round(self._carriage_state.Eval(context)[0] / self._count) * self._count
