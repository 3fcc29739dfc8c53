"""What a planner learns from demonstrations: how the wrench answered each motion, and where the next state began.

Between two observations a ``HORIZON`` apart, in the frame of the features of the first one, the own motion is
u = (turn_x, turn_y, feed), and the answer to it is the change of the loads y = (fx, fy, mx / r, my / r, fz).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.features.canonical_frame import turned_rows
from skill.features.measurement import MEASURED
from skill.features.wrench_features import WrenchFeatures

HORIZON = 0.1
"""Time between the two observations, s: long for the noise of the sensor, short for the motion of the contact."""

N_INPUTS, N_LOADS = 3, 5
"""Lengths of u and of y."""

FORCES = [0, 1, 4]
"""The components of y that are forces; the others are the lateral moments over the peg radius r, N."""


def horizon_steps(period: float) -> int:
    """Returns ``HORIZON`` in sample periods (s), at least 1."""
    return max(1, round(HORIZON / period))


def loads_of(wrenches: Array, angles: Array, peg_radius: float) -> Array:
    """Returns the loads (n, 5), N, of wrenches (n, 6 or more) in frames at angles (n,), rad, from P about z."""
    force, moment = turned_rows(wrenches, -angles), turned_rows(wrenches[:, 3:], -angles)
    return np.column_stack([force, moment / peg_radius, wrenches[:, 2]])


@dataclass(frozen=True)
class Transitions:
    """n samples; what depends on a frame is in that of the features at the sample.

    Attributes:
        measured: (n, 7), the measurements.
        inputs: (n, 3), own turn about x and y (rad) and feed (m) until one ``HORIZON`` later.
        outputs: (n, 5), change of the loads until then, N.
        loads: (n, 5), the loads, N.
        next_states: (n,), the state that follows the present visit; K if the demonstration then ends inserted, K + 1 if
            it ends otherwise.
        changes: (n, 5), change of the loads until the next state begins, N.
        times: (n,), time until then, s.
        good: (n,), whether the demonstration ends inserted.
    """

    measured: Array
    inputs: Array
    outputs: Array
    loads: Array
    next_states: NDArray[np.intp]
    changes: Array
    times: Array
    good: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: Sequence[Transitions]) -> Transitions:
        """Joins the transitions of several demonstrations."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


def transitions(
    observed: Array,
    states: NDArray[np.intp],
    *,
    good: bool,
    n_states: int,
    features: WrenchFeatures,
    peg_radius: float,
    period: float,
) -> Transitions:
    """Returns the transitions of one demonstration; its last ``HORIZON`` has none.

    Args:
        observed: (m, 9), observations; see `skill.features.measurement`.
        states: (m,), their states, from 0 to ``n_states`` - 1.
        good: whether it ends inserted.
        n_states: K.
        features: define the frame.
        peg_radius: r, m.
        period: time between observations, s.
    """
    steps = horizon_steps(period)
    first = np.arange(max(0, len(observed) - steps))
    later = np.flatnonzero(np.diff(states)) + 1  # where the second and the following visits begin
    visit = np.searchsorted(later, first, side="right")
    entry = np.append(later, len(states) - 1)[visit]
    before = observed[first]
    measured = before[:, : len(MEASURED)]
    angles = features.rotation_angle(measured)
    moved = observed[first + steps] - before
    loads = loads_of(before, angles, peg_radius)
    return Transitions(
        measured=measured,
        inputs=np.column_stack([turned_rows(moved[:, 7:], -angles), moved[:, 6]]),
        outputs=loads_of(moved, angles, peg_radius),
        loads=loads,
        next_states=np.append(states[later], n_states if good else n_states + 1)[visit],
        changes=loads_of(observed[entry], angles, peg_radius) - loads,
        times=np.asarray((entry - first) * period, dtype=float),
        good=np.full(len(first), good),
    )
