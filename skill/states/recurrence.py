"""States of recordings must recur: a force that only one recording has is not yet a contact state.

Where the grip, the part or the sensor's offset differs from recording to recording, the same contact lies elsewhere in
one of them, and a valley of the density separates it from the others. Such a set of components occurs in few
recordings. It is given to the state that takes its place in the others: the one that comes between the same two states.
Where several do, or none, the most probable one is taken. A set with which a recording begins or ends, and in whose
place the others have nothing, is kept: a single jam is a state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array, sequences
from skill.clustering.component_sets import set_log_likelihoods
from skill.states.hidden_markov import by_sequence, learnt_chain, smoothed

MIN_RECORDINGS = 3
"""Recordings in which a state must occur; two are enough if there are no more than three."""

OCCURRENCE = 0.1
"""A state occurs in a recording that has at least this share of its mean number of samples in a recording."""

NOTHING = -1
"""What is before the first state of a recording, and after the last."""


Visit = tuple[int, int, int, int]
"""The state before a visit, the state that is visited, the state after, and the number of samples."""


def recurrent_sets(
    densities: Array, weights: Array, sets: NDArray[np.intp], groups: NDArray[np.intp], n_alike: float
) -> NDArray[np.intp]:
    """Merges the sets of components that occur in too few recordings, the smallest first.

    Each state has a set of components. The states of the samples are those of a hidden Markov model.

    Args:
        densities: shape (N, K), log P_k p_k(x), density of each sample in each component with its weight.
        weights: shape (K,), weights P of the components.
        sets: shape (K,), set of each component, counted from 0; each is the most probable of some samples.
        groups: shape (N,), recording of each sample, counted from 0.
        n_alike: number of samples whose evidence counts as that of one.

    Returns:
        The set of each component, shape (K,), counted from 0.
    """
    n_recordings = int(groups.max()) + 1
    least = min(MIN_RECORDINGS, n_recordings // 2 + 1)
    while sets.max() > 0:
        M = int(sets.max()) + 1
        evidence = set_log_likelihoods(densities, weights, sets) / n_alike
        states = _states(evidence, groups)
        counts = np.stack([np.bincount(groups[states == s], minlength=n_recordings) for s in range(M)])
        occurs = counts >= np.maximum(OCCURRENCE * counts.mean(axis=1, keepdims=True), 1.0)
        visits = list(_visits(states, groups))
        votes = {int(s): _votes(int(s), visits, M) for s in np.flatnonzero(occurs.sum(axis=1) < least)}
        rare = [s for s, mine in votes.items() if mine[s] <= np.delete(mine, s).max()]
        if not rare:
            break
        smallest = min(rare, key=lambda s: int(counts[s].sum()))
        others = np.delete(np.arange(M), smallest)
        candidates = others[votes[smallest][others] == votes[smallest][others].max()]
        members = sets[densities.argmax(axis=1)] == smallest
        chosen = candidates[evidence[np.ix_(members, candidates)].mean(axis=0).argmax()]
        sets = np.where(sets == smallest, chosen, sets)
        sets = np.unique(sets, return_inverse=True)[1].astype(np.intp)
    return sets


def _states(evidence: Array, groups: NDArray[np.intp]) -> NDArray[np.intp]:
    """Returns the most probable state of each sample, shape (N,), by a chain that is learnt from the evidence."""
    states: NDArray[np.intp] = by_sequence(smoothed, evidence, learnt_chain(evidence, groups), groups).argmax(axis=1)
    return states


def _visits(states: NDArray[np.intp], groups: NDArray[np.intp]) -> Iterator[Visit]:
    """Yields the visits of all recordings, one recording after the other."""
    for rows in sequences(groups):
        begins = np.flatnonzero(np.diff(states[rows], prepend=NOTHING))
        visited = [NOTHING, *(int(s) for s in states[rows][begins]), NOTHING]
        lengths = np.diff([*begins, len(rows)])
        for k, length in enumerate(lengths):
            yield visited[k], visited[k + 1], visited[k + 2], int(length)


def _votes(state: int, visits: Sequence[Visit], M: int) -> Array:
    """Returns how often each state takes the place of one, shape (M,), weighted by the samples of the one.

    A state takes its place where it comes between the same two states, or where these two follow each other without
    any between: then the visit prolonged one of them. A visit with which a recording begins or ends, and in whose place
    the others have nothing, counts for the state itself.
    """
    votes = np.zeros(M)
    for before, visited, after, n_samples in visits:
        if visited != state:
            continue
        inside = NOTHING not in (before, after)
        mine = np.zeros(M)
        if inside and before == after:
            mine[before] += n_samples
        for earlier, other, later, _ in visits:
            between = (earlier, later) == (before, after)
            prolonged = inside and (before, after) in ((earlier, other), (other, later))
            if other != state and (between or prolonged):
                mine[other] += n_samples
        if not inside and not mine.any():
            mine[state] = n_samples
        votes += mine
    return votes
