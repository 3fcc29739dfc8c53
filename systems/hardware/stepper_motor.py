"""Models a stepper axis: microsteps on a trapezoidal speed ramp, a magnetic spring, and step loss under overload."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import StepperMotorParameters
from skill.arrays import Array
from systems.steps.stepper_motor import SIZE, TAKEN, Axis, equilibrium_angle, shaft_angles, stepper_step


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
    ``max_step_acceleration`` (see `stepper_step`). It takes every microstep that the ramp passes, and counts them open
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
        self._axis = Axis.of(parameters, period=period)
        self._start = self.DeclareNumericParameter(BasicVector([start_angle]))
        self._target = self.DeclareVectorInputPort("target_angle", 1)
        self._measured = self.DeclareVectorInputPort("measured_angle", 1)
        self._state = self.DeclareDiscreteState(SIZE)
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

    def _values(self, context: Context) -> Array:
        return np.array(context.get_discrete_state(self._state).value())

    def _turned(self, context: Context) -> float:
        """The angle of the rotor relative to the start, rad."""
        return float(self._measured.Eval(context)[0]) - self._start_angle(context)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        target, state = self._target.Eval(context)[0], self._values(context)
        discrete_state.set_value(self._state, stepper_step(self._axis, state, target, self._turned(context)))

    def _calc_equilibrium(self, context: Context, output: BasicVector) -> None:
        output[0] = self._start_angle(context) + equilibrium_angle(self._axis, self._values(context))

    def _calc_counts(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[TAKEN:])

    def _calc_shaft(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(shaft_angles(self._axis, self._values(context), self._turned(context)))
