"""A stepper axis: whole steps on a trapezoidal ramp, held like a magnetic spring, lost when overloaded."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import StepperMotorParameters

POSITION, SPEED, SHIFT, TAKEN, LOST = range(5)
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

    Every update the driver moves along a trapezoid of speed towards the nearest step to ``target_angle``, within
    ``max_step_rate`` and ``max_step_acceleration`` (`ramp_speed`), and takes the whole steps that it passes; it counts
    open loop. The rotor is held about the equilibrium

        theta_0 = theta_start + step (round(position) + shift)

    by the plant's joint actuator: stiffness K = (pi/2) T_h / step, torque at most T_h (an implicit spring, which holds
    at the plant's time step). When the lag |theta - theta_0| passes two full steps the rotor falls into the next
    equilibrium, one electrical period of four steps away: ``shift`` takes them up and they count as lost.

    ``step_counts`` is [steps taken, steps lost]. Angles in rad; ``target_angle`` counts from ``theta_start``, where the
    axis stood at time 0, which the driver does not know.
    """

    def __init__(self, *, parameters: StepperMotorParameters, period: float, start_angle: float) -> None:
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
        before = round(state[POSITION])
        state[SPEED] = ramp_speed(
            wanted - state[POSITION],
            state[SPEED],
            top=p.max_step_rate,
            change=p.max_step_acceleration * self._period,
            period=self._period,
        )
        state[POSITION] += state[SPEED] * self._period
        commanded = round(state[POSITION])
        state[TAKEN] += abs(commanded - before)
        lag = (self._measured.Eval(context)[0] - self._start_angle) / p.step_angle - (commanded + state[SHIFT])
        if abs(lag) > PERIOD_STEPS / 2:
            state[SHIFT] += math.copysign(PERIOD_STEPS, lag)
            state[LOST] += PERIOD_STEPS
        discrete_state.get_mutable_vector(self._state).SetFromVector(state)

    def _calc_equilibrium(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        output[0] = self._start_angle + self._parameters.step_angle * (round(state[POSITION]) + state[SHIFT])

    def _calc_counts(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        output.SetFromVector(state[[TAKEN, LOST]])


def ramp_speed(distance: float, speed: float, *, top: float, change: float, period: float) -> float:
    """Speed of the next period on the fastest ramp that comes to rest exactly ``distance`` away.

    Braking by ``change`` (c) a period (T), n periods at v, v - c, ... come to rest after T (n v - c n (n - 1) / 2);
    n is the smallest number for which the last of them is within c, and v = d / (n T) + c (n - 1) / 2. The speed never
    changes by more than c, so a target that comes nearer than it can brake is overrun and returned to.

    Args:
        distance: to go, steps; positive or negative.
        speed: of the last period, steps/s.
        top: greatest speed, steps/s.
        change: greatest change of speed in a period, steps/s.
        period: s.
    """
    sign = math.copysign(1.0, distance)
    n = max(1, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * abs(distance) / (change * period)) - 1.0) - 1e-9))
    braking = abs(distance) / (n * period) + 0.5 * change * (n - 1)
    return sign * max(min(braking, top, sign * speed + change), sign * speed - change)
