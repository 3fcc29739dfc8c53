"""What a planner learns from demonstrations: how the wrench answered each motion, and where the next state began."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array
from skill.features.responses import ResponseFeatures, horizon_steps
from skill.features.wrench_features import MEASURED


@dataclass(frozen=True)
class Transitions:
    """n samples; what depends on a frame is in that of the features at the sample.

    Attributes:
        measured: (n, 7), the measurements.
        features: (n, d), their features.
        inputs: (n, 3), own turn about x and y (rad) and feed (m) until one ``HORIZON`` later.
        outputs: (n, 5), change of the ``LOADS`` until then, N.
        loads: (n, 5), the ``LOADS``, N.
        next_states: (n,), the state that follows the present visit; K if the demonstration then ends inserted, K + 1 if
            it ends otherwise.
        changes: (n, 5), change of the ``LOADS`` until the next state begins, N.
        times: (n,), time until then, s.
        good: (n,), whether the demonstration ends inserted.
    """

    measured: Array
    features: Array
    inputs: Array
    outputs: Array
    loads: Array
    next_states: NDArray[np.intp]
    changes: Array
    times: Array
    good: NDArray[np.bool_]


def transitions(
    observed: Sequence[Array],
    labels: Sequence[ArrayLike],
    good: Sequence[bool],
    features: ResponseFeatures,
    *,
    n_states: int,
    period: float,
) -> Transitions:
    """Returns the transitions of demonstrations.

    The last ``HORIZON`` of a demonstration has none.

    Args:
        observed: for each, observations (m, 9); see `skill.features.responses`.
        labels: for each, the states (m,) of the observations, from 0 to ``n_states`` - 1.
        good: for each, whether it ends inserted.
        features: computes the answers.
        n_states: K.
        period: time between observations, s.
    """
    parts = [
        _of_one(series, np.asarray(states, dtype=np.intp), inserted, features, n_states, period)
        for series, states, inserted in zip(observed, labels, good, strict=True)
    ]
    columns = (np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Transitions))
    return Transitions(*columns)


def _of_one(
    observed: Array, states: NDArray[np.intp], good: bool, features: ResponseFeatures, n_states: int, period: float
) -> Transitions:
    """The transitions of one demonstration."""
    steps = horizon_steps(period)
    first = np.arange(max(0, len(observed) - steps))
    later = np.flatnonzero(np.diff(states)) + 1  # where the second and the following visits begin
    visit = np.searchsorted(later, first, side="right")
    entry = np.append(later, len(states) - 1)[visit]
    measured = observed[first, : len(MEASURED)]
    answers = features.between(observed[first], observed[first + steps])
    phi = features.features.rotation_angle(measured)
    loads = features.loads(measured, phi)
    return Transitions(
        measured=measured,
        features=answers.features,
        inputs=answers.inputs,
        outputs=answers.outputs,
        loads=loads,
        next_states=np.append(states[later], n_states if good else n_states + 1)[visit],
        changes=features.loads(observed[entry], phi) - loads,
        times=np.asarray((entry - first) * period, dtype=float),
        good=np.full(len(first), good),
    )
