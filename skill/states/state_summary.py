"""What each discovered contact state is: its typical forces, how long it lasts, and what follows it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.recordings.channel_groups import channel_groups
from skill.recordings.columns import FORCES, MOMENTS
from skill.recordings.recording import Recording
from skill.states.state_graph import StateGraph, Visits
from skill.states.state_style import GAP

LOW, HIGH = 0.1, 0.9
"""Quantiles between which a range lies."""

FORCE, MOMENT = "|force|", "|moment|"
"""Names of the lengths of the force and moment vectors among the quantities of a state."""

SMALL_FORCE = 0.15
"""A state is free if its force is smaller than this share of that of the state with the largest force."""

NOTABLE_MOMENT = 0.3
"""A moment is part of a name if it is at least this share of that of the state with the largest moment."""

STEADY = 0.5
"""A force has a direction if the median vector is at least this share of the median length."""

NOTABLE_AXIS = 0.4
"""An axis is part of a direction if its component is at least this share of the length."""

UNUSED = "never the most probable"
_END = "end"


@dataclass(frozen=True)
class LabelledRecording:
    """A recording and its states.

    Attributes:
        recording: n samples.
        states: (n,) most probable state of each sample.
        probabilities: (n,) its probability.
    """

    recording: Recording
    states: NDArray[np.intp]
    probabilities: Array


class Spread(NamedTuple):
    """Median and the quantiles `LOW` and `HIGH`; NaN where there are no values."""

    median: float
    low: float
    high: float


@dataclass(frozen=True)
class StateSummary:
    """What a state is.

    Attributes:
        name: by its typical forces, such as "12 N along -z".
        share: of the time of all recordings.
        visits: number of visits in a recording, on average.
        recordings: number of recordings that visit it.
        duration: of a visit, s, without gaps. The last visit of a recording counts with its length up to the end.
        quantities: of its samples, by name: each channel in SI units; `FORCE` and `MOMENT` where all axes are there.
        following: the states that follow a visit and the share of the visits that they follow, most frequent first;
            the state None is the end of the recording.
    """

    name: str
    share: float
    visits: float
    recordings: int
    duration: Spread
    quantities: Mapping[str, Spread]
    following: tuple[tuple[int | None, float], ...]


def summarise_states(labelled: Sequence[LabelledRecording], n_states: int) -> list[StateSummary]:
    """Summarises the states of recordings with the same channels.

    Args:
        labelled: the recordings, at least one.
        n_states: number of states K; states without samples have a summary too.
    """
    recordings = [item.recording for item in labelled]
    labels = [item.states for item in labelled]
    times = [recording.time - recording.time[0] for recording in recordings]
    period = float(np.median([1.0 / recording.rate for recording in recordings]))
    graph = StateGraph(n_states, sample_period=period, success=_END)
    graph.fit(labels, [_END] * len(labels), times)
    visits = [Visits.of(*pair, period) for pair in zip(labels, times, strict=True)]
    visited = np.concatenate([v.states for v in visits])
    durations = np.concatenate([_durations(*pair) for pair in zip(recordings, visits, strict=True)])
    states = np.concatenate(labels)
    values = np.concatenate([recording.values for recording in recordings])
    channels = dict(zip(recordings[0].channels, values.T, strict=True))
    quantities = channels | _lengths(channels)
    names = _names(channels, states, n_states)
    return [
        StateSummary(
            name=names[k],
            share=float(durations[visited == k].sum() / durations.sum()),
            visits=float(graph.visits_[k] / len(labelled)),
            recordings=sum(bool((v.states == k).any()) for v in visits),
            duration=_spread(durations[visited == k]),
            quantities={name: _spread(samples[states == k]) for name, samples in quantities.items()},
            following=_following(graph.moves_[k]),
        )
        for k in range(n_states)
    ]


def _durations(recording: Recording, visits: Visits) -> Array:
    """Duration of each visit, s, without the gaps; the last sample counts with the median interval."""
    interval = 1.0 / recording.rate
    steps = np.append(np.diff(recording.time), interval)
    steps[steps > GAP * interval] = interval
    starts = np.cumsum(visits.lengths) - visits.lengths
    found: Array = np.add.reduceat(steps, starts)
    return found


def _spread(values: Array) -> Spread:
    """Median and range of some values."""
    return Spread(*(float(q) for q in np.quantile(values, (0.5, LOW, HIGH)))) if len(values) else Spread(*3 * [np.nan])


def _lengths(channels: Mapping[str, Array]) -> dict[str, Array]:
    """Lengths of the force and the moment of each sample, where all axes are there."""
    vectors = {FORCE: FORCES, MOMENT: MOMENTS}
    return {
        name: np.linalg.norm([channels[axis] for axis in axes], axis=0)
        for name, axes in vectors.items()
        if all(axis in channels for axis in axes)
    }


def _following(moves: Array) -> tuple[tuple[int | None, float], ...]:
    """What follows a state, from its probabilities (K + 1,) of each other state and of the end."""
    order = [int(k) for k in np.argsort(-moves, kind="stable") if moves[k] > 0]
    return tuple((None if k == len(moves) - 1 else k, float(moves[k])) for k in order)


# ---------------------------------------------------------------- names


def _names(channels: Mapping[str, Array], states: NDArray[np.intp], n_states: int) -> list[str]:
    """The name of each state: by its force and moment, or by the medians of its channels."""
    used = [k for k in range(n_states) if (states == k).any()]
    names = [UNUSED] * n_states
    if all(axis in channels for axis in FORCES):
        phrases = _force_names([np.stack([channels[a][states == k] for a in FORCES]) for k in used])
        moments = [""] * len(used)
        if all(axis in channels for axis in MOMENTS):
            moments = _moment_names([np.stack([channels[a][states == k] for a in MOMENTS]) for k in used])
        for k, force, moment in zip(used, phrases, moments, strict=True):
            names[k] = ", ".join(filter(None, (force or ("little force" if moment else "free"), moment)))
    else:
        for k in used:
            names[k] = _channel_name({name: samples[states == k] for name, samples in channels.items()})
    return names


def _force_names(states: Sequence[Array]) -> list[str]:
    """What the forces (3, n) of each state are; empty where they are small beside those of another state."""
    lengths = [float(np.median(np.linalg.norm(force, axis=0))) for force in states]
    names = []
    for force, length in zip(states, lengths, strict=True):
        typical = np.median(force, axis=1)
        strength = float(np.linalg.norm(typical))
        if length < SMALL_FORCE * max(lengths):
            names.append("")
        elif strength < STEADY * length:
            names.append(f"{short_number(length)} N in changing directions")
        else:
            names.append(f"{short_number(strength)} N along {_direction(typical)}" if length else "no forces")
    return names


def _moment_names(states: Sequence[Array]) -> list[str]:
    """What the moments (3, n) of each state are; empty where they are small or have no direction."""
    typical = [np.median(moment, axis=1) for moment in states]
    strengths = [float(np.linalg.norm(vector)) for vector in typical]
    names = []
    for moment, vector, strength in zip(states, typical, strengths, strict=True):
        deviation = float(np.median(np.linalg.norm(moment - vector[:, None], axis=0)))
        notable = strength >= max(NOTABLE_MOMENT * max(strengths), deviation) and strength > 0
        names.append(f"{short_number(strength)} N m about {_direction(vector)}" if notable else "")
    return names


def _direction(vector: Array) -> str:
    """The axes of a vector (3,) with notable components, the largest first, such as "+z -x"."""
    order = np.argsort(-np.abs(vector), kind="stable")
    notable = np.abs(vector) >= NOTABLE_AXIS * np.linalg.norm(vector)
    return " ".join(f"{'-' if vector[k] < 0 else '+'}{'xyz'[k]}" for k in order if notable[k])


def _channel_name(channels: Mapping[str, Array]) -> str:
    """The medians of the first three channels."""
    parts = []
    for group in channel_groups(list(channels)):
        for name in group.channels:
            parts.append(f"{name} {short_number(group.factor * float(np.median(channels[name])))} {group.unit}".strip())
    return ", ".join(parts[:3])


def short_number(value: float) -> str:
    """Returns a number with two significant digits, such as "12", "0.28" or "1200"."""
    return f"{float(f'{value:.2g}'):g}"
