"""Names for discovered contact states, from labels that someone else knows.

The learner never sees labels. Where a judge has them for recorded samples (exact geometry, a person at a video), each
state is called after the label that dominates among its samples.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

MIXED_BELOW = 0.6
"""A state whose commonest label has a smaller share than this is named after its two commonest labels."""


@dataclass(frozen=True)
class StateNames:
    """What the states mean.

    Attributes:
        names: one a state, all different.
        labels: (K,), the dominant label of each state; -1 where the state has no labelled sample.
        purity: (K,), share of that label among the state's samples; NaN where it has none.
        counts: (K, L), samples of each label in each state.
    """

    names: list[str]
    labels: NDArray[np.intp]
    purity: NDArray[np.float64]
    counts: NDArray[np.intp]


def name_states(states: ArrayLike, labels: ArrayLike, label_names: Sequence[str], *, n_states: int) -> StateNames:
    """Names each state by its dominant label.

    Args:
        states: (N,), discovered state 0..K-1 of each sample; -1 for none.
        labels: (N,), label 0..L-1 of each sample; -1 for unknown.
        label_names: of the L labels.
        n_states: K.

    Returns:
        Names, unique: states of one label are numbered, the purest first; a state without a clear label bears two
        ("free / two-point contact"), one without samples its number ("state 3").

    Raises:
        ValueError: if the arrays do not match, or a state or a label is out of range.
    """
    s, y = np.asarray(states), np.asarray(labels)
    if s.ndim != 1 or s.shape != y.shape:
        raise ValueError(f"states has shape {s.shape} and labels {y.shape}, expected (N,) both")
    for name, values, count in (("states", s, n_states), ("labels", y, len(label_names))):
        if values.size and (values.min() < -1 or values.max() >= count):
            raise ValueError(f"{name} lie between {values.min()} and {values.max()}, expected -1 to {count - 1}")
    known = (s >= 0) & (y >= 0)
    counts = np.zeros((n_states, len(label_names)), dtype=np.intp)
    np.add.at(counts, (s[known], y[known]), 1)
    totals = counts.sum(axis=1)
    dominant = np.where(totals > 0, counts.argmax(axis=1), -1)
    with np.errstate(invalid="ignore"):
        purity = counts.max(axis=1, initial=0) / totals
    plain = [
        _plain_name(row, share, label_names) if row.sum() else f"state {k}"
        for k, (row, share) in enumerate(zip(counts, purity, strict=True))
    ]
    names = list(plain)
    for name, uses in Counter(plain).items():
        if uses > 1:
            alike = [k for k in range(n_states) if plain[k] == name]
            for rank, k in enumerate(sorted(alike, key=lambda k: -purity[k]), start=1):
                names[k] = f"{name} {rank}"
    return StateNames(names, np.asarray(dominant, dtype=np.intp), purity, counts)


def _plain_name(row: NDArray[np.intp], share: float, label_names: Sequence[str]) -> str:
    order = np.argsort(-row, kind="stable")
    if share >= MIXED_BELOW or len(label_names) < 2:
        return label_names[order[0]]
    return f"{label_names[order[0]]} / {label_names[order[1]]}"
