"""How a measurement answers to an own motion: what a planner learns and predicts.

An observation is a measurement (`MEASURED`) and the own turn: the rotation vector (about x and y of P, rad) by which
own motions have turned the peg relative to the hole since the start. On the rig it is minus the commanded angles of the
hole, in demonstrations the sum of the recorded turns.

Between two observations a ``HORIZON`` apart, in the frame of the features of the first one,

    u = (turn_x, turn_y, feed),    y = (change of fx, fy, mx / r, my / r, fz).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compiled import compiled
from skill.arrays import Array
from skill.features.canonical_frame import turned
from skill.features.wrench_features import MEASURED, WrenchFeatures

HORIZON = 0.1
"""Time between the two observations, s: long for the noise of the sensor, short for the motion of the contact."""

N_INPUTS, N_OUTPUTS = 3, 5
"""Lengths of u and of y."""


def observations(measured: Array, turned: Array) -> Array:
    """Joins measurements (..., 7) and own turns (..., 2) to observations (..., 9)."""
    return np.concatenate([measured, turned], axis=-1)


def rig_observations(measured: Array, targets: Array) -> Array:
    """Joins measurements (..., 7) and commanded angles of the hole (..., 2), rad, to observations (..., 9).

    Turning the hole by an angle turns the peg relative to it by minus that angle.
    """
    return observations(measured, -targets)


@dataclass(frozen=True)
class Responses:
    """Answers to own motions, n rows.

    Attributes:
        features: (n, d), features of the first observations.
        inputs: (n, 3), u: own turn (rad) and feed (m) in the frame of the features.
        outputs: (n, 5), y, N.
    """

    features: Array
    inputs: Array
    outputs: Array


LOADS = ("fx", "fy", "mx / r", "my / r", "fz")
"""The outputs: the components of the wrench, N, with the lateral moments over the peg radius."""


@dataclass(frozen=True)
class ResponseFeatures:
    """Computes responses from observations.

    Attributes:
        features: the features, which define the frame.
        peg_radius: r, m.
    """

    features: WrenchFeatures
    peg_radius: float

    def between(self, before: Array, after: Array) -> Responses:
        """Returns the responses between pairs of observations (n, 9)."""
        measured = np.ascontiguousarray(before[:, : len(MEASURED)])
        angles, rows = self.features.rotation_angle(measured), np.ascontiguousarray(before)
        found = [
            response(first, last, angle, self.peg_radius)
            for first, last, angle in zip(rows, np.ascontiguousarray(after), angles, strict=True)
        ]
        return Responses(
            features=self.features.transform(measured),
            inputs=np.reshape([u for u, _ in found], (-1, N_INPUTS)),
            outputs=np.reshape([y for _, y in found], (-1, N_OUTPUTS)),
        )

    def loads(self, wrenches: Array, angles: Array) -> Array:
        """Returns the ``LOADS`` (n, 5) of wrenches (n, 6 or more) in frames at angles (n,), rad, from P about z."""
        rows = zip(np.ascontiguousarray(wrenches), angles, strict=True)
        return np.reshape([turned_loads(row, angle, self.peg_radius) for row, angle in rows], (-1, N_OUTPUTS))


@compiled
def turned_loads(wrench: Array, angle: float, peg_radius: float) -> Array:
    """Returns the ``LOADS`` (5,) of a wrench (6 or more,) in a frame at an angle, rad, from P about z."""
    found = np.empty(N_OUTPUTS)
    found[0], found[1] = turned(wrench[0], wrench[1], -angle)
    mx, my = turned(wrench[3], wrench[4], -angle)
    found[2], found[3], found[4] = mx / peg_radius, my / peg_radius, wrench[2]
    return found


@compiled
def response(before: Array, after: Array, angle: float, peg_radius: float) -> tuple[Array, Array]:
    """Returns u (3,) and y (5,) between two observations (9,), in the frame at an angle (rad) of the first one."""
    change, u = after - before, np.empty(N_INPUTS)
    u[0], u[1] = turned(change[7], change[8], -angle)
    u[2] = change[6]
    return u, turned_loads(change, angle, peg_radius)


def horizon_steps(period: float) -> int:
    """Returns ``HORIZON`` in sample periods (s), at least 1."""
    return max(1, round(HORIZON / period))
