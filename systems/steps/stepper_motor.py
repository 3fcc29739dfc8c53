"""A stepper axis: microsteps on a trapezoidal speed ramp, a magnetic spring, and step loss under overload."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from compiled import compiled
from models.hardware import StepperMotorParameters
from skill.arrays import Array

PERIOD_STEPS = 4  # full steps in one electrical period, the distance between two stable equilibria of the rotor

POSITION, SPEED, SHIFT, TAKEN, LOST, SIZE = range(6)
"""Places in the state: ramp position and speed and slip of the rotor, in full steps, and the counts of microsteps taken
and lost; and its size."""


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
