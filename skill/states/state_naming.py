"""Names of discovered contact states, from labels of the samples.

The learner never sees labels. If labels of recorded samples are known, for example from exact geometry or from a video,
each state is named after the most frequent label of its samples.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIXED_BELOW = 0.6
"""A state whose most frequent label has a smaller share than this is named after its two most frequent labels."""


@dataclass(frozen=True)
class StateNames:
    """Names of the K states, and the labels they come from.

    Attributes:
        names: name of each state, all different.
        labels: shape (K,), most frequent label of each state; -1 for states without labelled samples.
        purity: shape (K,), share of this label among the labelled samples of the state; NaN if there are none.
        counts: shape (K, L), number of samples of each label in each state.
    """

    names: list[str]
    labels: NDArray[np.intp]
    purity: NDArray[np.float64]
    counts: NDArray[np.intp]


def name_states(states: ArrayLike, labels: ArrayLike, label_names: Sequence[str], *, n_states: int) -> StateNames:
    """Names each state after its most frequent label.

    States with the same name are numbered in the order of their purity. A state without a clear label has the names of
    two labels ("free / two-point contact"). A state without labelled samples has its index ("state 3").

    Args:
        states: shape (N,), discovered state of each sample from 0 to K - 1, or -1 for unknown.
        labels: shape (N,), label of each sample from 0 to L - 1, or -1 for unknown.
        label_names: names of the L labels.
        n_states: number of states K.
    """
    s, y = np.asarray(states), np.asarray(labels)
    known = (s >= 0) & (y >= 0)
    counts = np.zeros((n_states, len(label_names)), dtype=np.intp)
    np.add.at(counts, (s[known], y[known]), 1)
    totals = counts.sum(axis=1)
    dominant = np.where(totals > 0, counts.argmax(axis=1), -1)
    with np.errstate(invalid="ignore"):
        purity = counts.max(axis=1, initial=0) / totals
    base_names = [
        _base_name(row, share, label_names) if row.sum() else f"state {k}"
        for k, (row, share) in enumerate(zip(counts, purity, strict=True))
    ]
    names = list(base_names)
    for name, uses in Counter(base_names).items():
        if uses > 1:
            same_name = [k for k in range(n_states) if base_names[k] == name]
            for rank, k in enumerate(sorted(same_name, key=lambda k: -purity[k]), start=1):
                names[k] = f"{name} {rank}"
    return StateNames(names, np.asarray(dominant, dtype=np.intp), purity, counts)


def _base_name(label_counts: NDArray[np.intp], share: float, label_names: Sequence[str]) -> str:
    """Returns the name of the most frequent label, or of the two most frequent if the first has a small share."""
    order = np.argsort(-label_counts, kind="stable")
    most_frequent = [str(label_names[label]) for label in order[:2]]
    if share >= MIXED_BELOW:
        return most_frequent[0]
    return " / ".join(most_frequent)
