"""Scores of discovered states against known labels: changes that are found, and changes that a filter follows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array, sequences

MIN_DURATION = 3
"""Samples; a label that lasts a shorter time need not be recognised."""

TOLERANCE = 0.3
"""Largest time between a change of the label and one of the state that stand for each other, s."""

ROUNDING = 1e-9  # s


def recognition(
    true: NDArray[np.intp], estimated: NDArray[np.intp], time: Array, groups: NDArray[np.intp]
) -> tuple[Array, float]:
    """Delays, s, and share of the lasting changes of the true label that were recognised before the next change.

    Args:
        true: (N,), true label of each sample.
        estimated: (N,), label that a filter estimates.
        time: (N,), s.
        groups: (N,), recording of each sample.

    Returns:
        The delays of the recognised changes, [NaN] if there is none, and the share.
    """
    delays, n_changes = [], 0
    for rows in sequences(groups):
        starts = np.flatnonzero(np.diff(true[rows], prepend=-1))
        for begin, end in zip(starts, [*starts[1:], len(rows)], strict=True):
            if end - begin < MIN_DURATION:
                continue
            n_changes += 1
            hits = np.flatnonzero(estimated[rows[begin:end]] == true[rows[begin]])
            delays += [time[rows[begin + hits[0]]] - time[rows[begin]]] if len(hits) else []
    return np.array(delays or [np.nan]), len(delays) / max(n_changes, 1)


def boundary_f1(true: NDArray[np.intp], found: NDArray[np.intp], time: Array, groups: NDArray[np.intp]) -> float:
    """F1 of the changes: each found one may stand for one true one that is at most ``TOLERANCE`` away.

    Args:
        true: (N,), true label of each sample.
        found: (N,), state of each sample, in any numbering.
        time: (N,), s.
        groups: (N,), recording of each sample.

    Returns:
        2 matched / (true changes + found changes), from 0 to 1; 1 if there is no change at all.
    """
    matched = total = 0
    for rows in sequences(groups):
        changes = [time[rows[1:]][np.diff(labels[rows]) != 0] for labels in (true, found)]
        total += len(changes[0]) + len(changes[1])
        matched += _matched(*changes)
    return 2 * matched / total if total else 1.0


def _matched(one: Array, other: Array) -> int:
    """The largest number of pairs of two increasing series that are at most ``TOLERANCE`` apart."""
    pairs = i = j = 0
    while i < len(one) and j < len(other):
        if abs(one[i] - other[j]) <= TOLERANCE + ROUNDING:
            pairs, i, j = pairs + 1, i + 1, j + 1
        elif one[i] < other[j]:
            i += 1
        else:
            j += 1
    return pairs
