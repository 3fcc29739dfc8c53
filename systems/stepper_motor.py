"""A stepper axis: whole steps at a limited rate, held like a magnetic spring, lost when overloaded."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import StepperMotor as StepperParameters

COMMANDED, SHIFT, TAKEN, LOST, CREDIT = range(5)
PERIOD_STEPS = 4  # full steps in one electrical period: a slipping rotor falls into the next equilibrium


class StepperMotor(LeafSystem):
    """
    .. pydrake_system::

        name: StepperMotor
        input_ports:
        - target_angle
        - measured_angle
        output_ports:
        - equilibrium_angle
        - step_counts

    Every update the driver takes whole steps towards the nearest step to ``target_angle``, at most
    ``max_step_rate`` a second; it counts open loop. The rotor is held about the equilibrium

        theta_0 = theta_start + step (commanded + shift)

    by the plant's joint actuator: stiffness K = (pi/2) T_h / step, torque at most T_h (an implicit spring, which holds
    at the plant's time step). When the lag |theta - theta_0| passes two full steps the rotor falls into the next
    equilibrium, one electrical period of four steps away: ``shift`` takes them up and they count as lost.

    ``step_counts`` is [steps taken, steps lost]. Angles in rad; ``target_angle`` counts from ``theta_start``, where the
    axis stood at time 0, which the driver does not know.
    """

    def __init__(self, *, parameters: StepperParameters, period: float, start_angle: float) -> None:
        super().__init__()
        self._parameters = parameters
        self._period = period
        self._start_angle = start_angle
        self._target = self.DeclareVectorInputPort("target_angle", 1)
        self._measured = self.DeclareVectorInputPort("measured_angle", 1)
        self._state = self.DeclareDiscreteState(np.zeros(5))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state_only = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort("equilibrium_angle", 1, self._calc_equilibrium, state_only)
        self.DeclareVectorOutputPort("step_counts", 2, self._calc_counts, state_only)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p = self._parameters
        state = context.get_discrete_state(self._state).value().copy()
        wanted = round(self._target.Eval(context)[0] / p.step_angle)
        gained = p.max_step_rate * self._period
        state[CREDIT] += gained
        missing = abs(wanted - state[COMMANDED])
        steps = min(missing, math.floor(state[CREDIT] + 1e-9))
        state[COMMANDED] += math.copysign(steps, wanted - state[COMMANDED])
        state[TAKEN] += steps
        state[CREDIT] -= steps
        if steps == missing:  # a motor at rest saves no steps for later
            state[CREDIT] = min(state[CREDIT], max(0.0, 1.0 - gained))
        lag = (self._measured.Eval(context)[0] - self._start_angle) / p.step_angle - (state[COMMANDED] + state[SHIFT])
        if abs(lag) > PERIOD_STEPS / 2:
            state[SHIFT] += math.copysign(PERIOD_STEPS, lag)
            state[LOST] += PERIOD_STEPS
        discrete_state.get_mutable_vector(self._state).SetFromVector(state)

    def _calc_equilibrium(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        output[0] = self._start_angle + self._parameters.step_angle * (state[COMMANDED] + state[SHIFT])

    def _calc_counts(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        output.SetFromVector(state[[TAKEN, LOST]])
