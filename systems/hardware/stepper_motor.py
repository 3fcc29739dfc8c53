"""Models a stepper axis: microsteps on a trapezoidal speed ramp, a magnetic spring, and step loss under overload."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import StepperMotorParameters

PERIOD_STEPS = 4  # full steps in one electrical period, the distance between two stable equilibria of the rotor


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
        - shaft

    The driver holds the rotor at positions of 1/m of a full step, with m = ``microsteps``. Every period it moves its
    ramp position towards the one nearest to ``target_angle``, with a trapezoidal speed within ``max_step_rate`` and
    ``max_step_acceleration`` (see `ramp_speed`). It takes every microstep that the ramp passes, and counts them open
    loop. The rotor is held at the equilibrium

        theta_0 = theta_start + step (round(m position) / m + shift)

    by the plant's joint actuator, an implicit spring of stiffness K = (pi/2) T_h / step and maximum torque T_h. When
    the lag |theta - theta_0| exceeds two full steps, the rotor slips to the next equilibrium, one electrical period of
    four steps away. ``shift`` is increased or decreased by four, and 4 m microsteps count as lost.

    ``shaft`` is [commanded, measured] angle, relative to theta_start. The drive counts its steps for the first; an
    encoder on the motor's shaft measures the second, in counts of ``encoder_resolution``.

    ``step_counts`` is [microsteps taken, microsteps lost]. Angles are in rad. ``target_angle`` is relative to
    ``theta_start``, because the driver does not know the absolute angle.

    Args:
        parameters: Parameters of the motor and its driver.
        period: Update period of the driver, s.
        start_angle: Angle theta_start of the axis at time 0, rad; `set_start_angle` replaces it in a context.
    """

    def __init__(self, *, parameters: StepperMotorParameters, period: float, start_angle: float) -> None:
        super().__init__()
        self._parameters = parameters
        self._period = period
        self._start = self.DeclareNumericParameter(BasicVector([start_angle]))
        self._target = self.DeclareVectorInputPort("target_angle", 1)
        self._measured = self.DeclareVectorInputPort("measured_angle", 1)
        # Ramp position and speed and slip of the rotor, in full steps, and the counts of microsteps taken and lost.
        self._state = self.DeclareDiscreteState(np.zeros(5))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        start = self.pn_ticket()
        self.DeclareVectorOutputPort("equilibrium_angle", 1, self._calc_equilibrium, {state, start})
        self.DeclareVectorOutputPort("step_counts", 2, self._calc_counts, {state})
        self.DeclareVectorOutputPort("shaft", 2, self._calc_shaft, {state, start, self._measured.ticket()})

    def set_start_angle(self, context: Context, angle: float) -> None:
        """Replaces theta_start, rad, in ``context``, which is this system's."""
        context.get_mutable_numeric_parameter(self._start).SetFromVector([angle])

    def _start_angle(self, context: Context) -> float:
        return float(context.get_numeric_parameter(self._start).value()[0])

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        # Plain floats: this runs at every step of the plant, and NumPy is slower for so few numbers.
        p, microsteps = self._parameters, self._parameters.microsteps
        position, speed, shift, taken, lost = context.get_discrete_state(self._state).value().tolist()
        target = round(float(self._target.Eval(context)[0]) / p.step_angle * microsteps) / microsteps
        previous = round(position * microsteps)
        if target != position or speed != 0.0:
            speed = ramp_speed(
                target - position,
                speed,
                top=p.max_step_rate,
                change=p.max_step_acceleration * self._period,
                period=self._period,
            )
            position += speed * self._period
        commanded = round(position * microsteps)
        taken += abs(commanded - previous)
        angle = (float(self._measured.Eval(context)[0]) - self._start_angle(context)) / p.step_angle
        lag = angle - (commanded / microsteps + shift)
        if abs(lag) > PERIOD_STEPS / 2:
            shift += math.copysign(PERIOD_STEPS, lag)
            lost += PERIOD_STEPS * microsteps
        discrete_state.get_mutable_vector(self._state).SetFromVector([position, speed, shift, taken, lost])

    def _calc_equilibrium(self, context: Context, output: BasicVector) -> None:
        position, _, shift, _, _ = context.get_discrete_state(self._state).value().tolist()
        p = self._parameters
        output[0] = self._start_angle(context) + p.step_angle * (round(position * p.microsteps) / p.microsteps + shift)

    def _calc_counts(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[3:])

    def _calc_shaft(self, context: Context, output: BasicVector) -> None:
        position = context.get_discrete_state(self._state).value()[0]
        resolution, microsteps = self._parameters.encoder_resolution, self._parameters.microsteps
        measured = round((self._measured.Eval(context)[0] - self._start_angle(context)) / resolution) * resolution
        output.SetFromVector([self._parameters.step_angle * round(position * microsteps) / microsteps, measured])


def ramp_speed(distance: float, speed: float, *, top: float, change: float, period: float) -> float:
    """Returns the speed (steps/s) of the next period on the fastest ramp that stops exactly at ``distance``.

    Let c be ``change``, T ``period`` and d ``distance``. Braking from speed v by c in each of n periods covers the
    distance T (n v - c n (n - 1) / 2). The ramp uses the smallest n whose last speed is at most c, and
    v = d / (n T) + c (n - 1) / 2. The speed never changes by more than c in a period. If a new target is too near to
    stop at, the ramp overshoots it and returns.

    Args:
        distance: Distance to the target, steps; positive or negative.
        speed: Speed of the previous period, steps/s.
        top: Maximum speed, steps/s.
        change: Maximum change of speed in a period, steps/s.
        period: Duration of a period, s.
    """
    sign = math.copysign(1.0, distance)
    n = max(1, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * abs(distance) / (change * period)) - 1.0) - 1e-9))
    braking = abs(distance) / (n * period) + 0.5 * change * (n - 1)
    return sign * max(min(braking, top, sign * speed + change), sign * speed - change)
