"""Recursions of a hidden Markov model (Rabiner, Proc. IEEE 77(2), 1989).

Sequences are groups of rows in the order of time (`skill.arrays.sequences`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array, sequences

EM_ITERATIONS = 5
"""Iterations in which the transitions are learnt."""

INITIAL_STAY = 0.98
"""Probability of no transition from sample to sample before they are learnt."""


@dataclass(frozen=True)
class MarkovChain:
    """Probabilities of the first state and of the transitions.

    Attributes:
        initial: shape (M,), probability of each state at the first sample of a sequence.
        transitions: shape (M, M), probability A_ki of the transition from state k to state i between samples.
    """

    initial: Array
    transitions: Array

    @classmethod
    def sticky(cls, M: int) -> MarkovChain:
        """A chain of M states that prefers to stay and knows nothing else."""
        transitions = np.full((M, M), (1.0 - INITIAL_STAY) / M) + INITIAL_STAY * np.eye(M)
        return cls(np.full(M, 1.0 / M), transitions)


def _scaled(log_likelihoods: Array) -> Array:
    """Returns the likelihoods of each sample relative to that of its most likely state."""
    likelihoods: Array = np.exp(log_likelihoods - log_likelihoods.max(axis=1, keepdims=True))
    return likelihoods


def forward(log_likelihoods: Array, chain: MarkovChain) -> Array:
    """Returns the probability of each state given the samples so far, shape (n, M).

    Args:
        log_likelihoods: shape (n, M), log-likelihood of each sample in each state.
        chain: the transitions.
    """
    likelihoods = _scaled(log_likelihoods)
    belief = np.empty_like(likelihoods)
    predicted = chain.initial
    for t, likelihood in enumerate(likelihoods):
        updated = (predicted + np.finfo(float).tiny) * likelihood
        belief[t] = updated / updated.sum()
        predicted = belief[t] @ chain.transitions
    return belief


def backward(log_likelihoods: Array, chain: MarkovChain) -> Array:
    """Returns the likelihood of all later samples given each state, up to a factor for each sample, shape (n, M)."""
    likelihoods = _scaled(log_likelihoods)
    later = np.ones_like(likelihoods)
    for t in range(len(later) - 2, -1, -1):
        value = chain.transitions @ (likelihoods[t + 1] * later[t + 1])
        later[t] = value / value.sum()
    return later


def smoothed(log_likelihoods: Array, chain: MarkovChain) -> Array:
    """Returns the probability of each state given all samples of the sequence, shape (n, M)."""
    product = forward(log_likelihoods, chain) * backward(log_likelihoods, chain)
    probabilities: Array = product / product.sum(axis=1, keepdims=True)
    return probabilities


def most_probable_path(log_likelihoods: Array, chain: MarkovChain) -> Array:
    """Returns the most probable sequence of states given all samples, as a probability of one in each row, (n, M).

    It is found by the recursion of Viterbi. The states that are most probable one by one can follow each other too
    often: a short visit that is unlikely as a whole may hold the likeliest state of each of its samples.
    """
    with np.errstate(divide="ignore"):
        change = np.log(chain.transitions)
        best = np.log(chain.initial) + log_likelihoods[0]
    came_from = np.empty(log_likelihoods.shape, dtype=np.intp)
    for t, log_likelihood in enumerate(log_likelihoods[1:], start=1):
        paths = best[:, None] + change
        came_from[t] = paths.argmax(axis=0)
        best = paths.max(axis=0) + log_likelihood
    path = np.zeros_like(log_likelihoods)
    state = int(best.argmax())
    for t in range(len(path) - 1, -1, -1):
        path[t, state] = 1.0
        state = int(came_from[t, state]) if t else state
    return path


def by_sequence(
    recursion: Callable[[Array, MarkovChain], Array],
    log_likelihoods: Array,
    chain: MarkovChain,
    groups: NDArray[np.intp],
) -> Array:
    """Applies a recursion, such as `forward` or `smoothed`, to each sequence, shape (N, M).

    Args:
        recursion: function of the log-likelihoods of one sequence and of the chain.
        log_likelihoods: shape (N, M), log-likelihood of each sample in each state.
        chain: the transitions.
        groups: shape (N,), sequence of each sample.
    """
    found = np.empty_like(log_likelihoods)
    for rows in sequences(groups):
        found[rows] = recursion(log_likelihoods[rows], chain)
    return found


def learnt_chain(log_likelihoods: Array, groups: NDArray[np.intp]) -> MarkovChain:
    """Learns the transitions by expectation-maximisation (Baum and Welch); the likelihoods do not change.

    The transitions from each state get one pseudo-count, in equal parts.

    Args:
        log_likelihoods: shape (N, M), log-likelihood of each sample in each state.
        groups: shape (N,), sequence of each sample.
    """
    M = log_likelihoods.shape[1]
    chain = MarkovChain.sticky(M)
    for _ in range(EM_ITERATIONS):
        first = np.full(M, 1.0 / M)
        counts = np.full((M, M), 1.0 / M)
        for rows in sequences(groups):
            mine = log_likelihoods[rows]
            before, later = forward(mine, chain), backward(mine, chain)
            product = before[0] * later[0]
            first += product / product.sum()
            ahead = _scaled(mine[1:]) * later[1:]
            scale = np.einsum("tk,ki,ti->t", before[:-1], chain.transitions, ahead)
            counts += chain.transitions * ((before[:-1] / scale[:, None]).T @ ahead)
        chain = replace(chain, initial=first / first.sum(), transitions=counts / counts.sum(axis=1, keepdims=True))
    return chain
