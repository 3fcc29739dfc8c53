"""A stepper axis: microsteps on a trapezoidal speed ramp, a magnetic spring, and step loss under overload."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from pydrake.systems.framework import Context

from compiled import compiled
from models.hardware import StepperMotorParameters
from skill.arrays import Array
from systems.law.part import Part

PERIOD_STEPS = 4  # full steps in one electrical period, the distance between two stable equilibria of the rotor

POSITION, SPEED, SHIFT, TAKEN, LOST, SIZE = range(6)
"""Places in the state: ramp position and speed and slip of the rotor, in full steps, and the counts of microsteps taken
and lost; and its size."""

START = SIZE
"""Place of the angle at time 0, rad, which follows the state of the step in that of `StepperMotor`."""


class Axis(NamedTuple):
    """A stepper axis; see `models.hardware.StepperMotorParameters`.

    Attributes:
        period: of the driver, s.
        step: angle of a full step, rad.
        microsteps: positions in a full step.
        top: largest speed, steps/s.
        change: largest change of the speed in a period, steps/s.
        resolution: of the encoder on the shaft, rad.
    """

    period: float
    step: float
    microsteps: int
    top: float
    change: float
    resolution: float

    @classmethod
    def of(cls, p: StepperMotorParameters, *, period: float) -> Self:
        """Returns the axis with a period, s, of its driver."""
        change = p.max_step_acceleration * period
        return cls(period, p.step_angle, p.microsteps, p.max_step_rate, change, p.encoder_resolution)


@compiled
def stepper_step(p: Axis, state: Array, target: float, measured: float) -> Array:
    """Returns the next state (SIZE,).

    The driver moves its ramp position towards the microstep nearest to the target, with a trapezoidal speed (see
    `ramp_speed`), takes every microstep that the ramp passes, and counts them open loop. When the rotor lags its
    equilibrium by more than two full steps, it slips to the next one, one electrical period of four steps away: the
    slip is increased or decreased by four, and 4 m of m microsteps count as lost.

    Args:
        p: the axis.
        state: (SIZE,), after the last period.
        target: angle, rad, relative to the start.
        measured: angle of the rotor, rad, relative to the start.
    """
    found = state.copy()
    m = p.microsteps
    wanted = round(target / p.step * m) / m
    previous = round(state[POSITION] * m)
    if wanted != state[POSITION] or state[SPEED] != 0.0:
        found[SPEED] = ramp_speed(wanted - state[POSITION], state[SPEED], p.top, p.change, p.period)
        found[POSITION] += found[SPEED] * p.period
    commanded = round(found[POSITION] * m)
    found[TAKEN] += abs(commanded - previous)
    lag = measured / p.step - (commanded / m + state[SHIFT])
    if abs(lag) > PERIOD_STEPS / 2:
        found[SHIFT] += math.copysign(PERIOD_STEPS, lag)
        found[LOST] += PERIOD_STEPS * m
    return found


@compiled
def equilibrium_angle(p: Axis, state: Array) -> float:
    """Returns the angle (rad) at which the rotor is held, relative to the start."""
    return float(p.step * (round(state[POSITION] * p.microsteps) / p.microsteps + state[SHIFT]))


@compiled
def shaft_angles(p: Axis, state: Array, measured: float) -> Array:
    """Returns [commanded, measured] angle (2,), rad, relative to the start: the steps counted, and the encoder's."""
    found = np.empty(2)
    found[0] = p.step * round(state[POSITION] * p.microsteps) / p.microsteps
    found[1] = round(measured / p.resolution) * p.resolution
    return found


@compiled
def ramp_speed(distance: float, speed: float, top: float, change: float, period: float) -> float:
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
    n = max(1.0, math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * abs(distance) / (change * period)) - 1.0) - 1e-9))
    braking = abs(distance) / (n * period) + 0.5 * change * (n - 1.0)
    return sign * max(min(braking, top, sign * speed + change), sign * speed - change)


class StepperMotor(Part):
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
        axis = Axis.of(parameters, period=period)

        def step(state: Array, target: float, measured: float) -> Array:
            return np.append(stepper_step(axis, state[:SIZE], target, measured - state[START]), state[START])

        inputs = {"target_angle": 1, "measured_angle": 1}
        super().__init__(inputs, state=[*np.zeros(SIZE), start_angle], period=period, step=step)
        self.declare_output("equilibrium_angle", 1, lambda state: state[START] + equilibrium_angle(axis, state))
        self.declare_output("step_counts", 2, lambda state: state[TAKEN:START])
        self.declare_output(
            "shaft", 2, lambda state, measured: shaft_angles(axis, state, measured - state[START]), "measured_angle"
        )

    def set_start_angle(self, context: Context, angle: float) -> None:
        """Replaces theta_start, rad, in ``context``, which is this system's, at time 0."""
        context.SetDiscreteState([*np.zeros(SIZE), angle])
