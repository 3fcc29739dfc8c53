"""Graph of the contact states: transitions in demonstrations, dwell times, and the probability of each outcome.

A demonstration is a sequence of state labels, one for each sample, and an outcome. A visit is a run of equal labels.
The transitions from visit to visit form an absorbing Markov chain, and the outcomes are its absorbing states. Let Q be
the probabilities of transitions between states, and R those of ending in each outcome. Then B = (I - Q)^-1 R contains
the probability of each outcome from each state (Kemeny and Snell, "Finite Markov Chains", 1960, theorem 3.3.7).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from skill.arrays import Array
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays

DWELL = ArrayRule(("K",), low=0.0, unknown=True)

FITTED = {
    "counts_": ArrayRule(("K", "K"), low=0.0),
    "exits_": ArrayRule(("K", "A"), low=0.0),
    "sample_counts_": ArrayRule(("K", "K"), low=0.0),
    "visits_": ArrayRule(("K",), low=0.0),
    "phase_": ArrayRule(("K",), low=0.0, high=1.0, unknown=True),
    "outcomes_": ArrayRule(("A",), holds="texts"),
    **dict.fromkeys(("dwell_mean_", "dwell_std_", "dwell_mean_s_", "dwell_std_s_"), DWELL),
}
"""Fitted attributes that are stored, and what they are: K states and A outcomes. The others follow from them."""

RULES = {name.rstrip("_"): rule for name, rule in FITTED.items()} | {
    "sample_period": ArrayRule(low=MIN_POSITIVE),
    "success": ArrayRule(holds="texts"),
}
"""The arrays of `StateGraph.to_arrays`."""


@dataclass(frozen=True)
class Visits:
    """The v visits and n samples of one demonstration.

    Attributes:
        states: shape (v,), state of each visit.
        lengths: shape (v,), length of each visit in samples.
        durations: shape (v,), duration of each visit in s.
        dropped: shape (n - 1,), number of samples missing after each sample.
        phase: shape (n,), time of each sample within the demonstration, from 0 to 1.
    """

    states: NDArray[np.intp]
    lengths: NDArray[np.intp]
    durations: Array
    dropped: Array
    phase: Array

    @classmethod
    def of(cls, labels: NDArray[np.intp], times: Array, sample_period: float) -> Visits:
        """Splits a demonstration with ``labels`` (n,) at ``times`` (n,), s, into visits."""
        starts = np.concatenate([[0], np.flatnonzero(np.diff(labels)) + 1])
        ends = np.append(times[starts[1:]], times[-1] + sample_period)
        return cls(
            states=labels[starts],
            lengths=np.diff([*starts, len(labels)]),
            durations=ends - times[starts],
            dropped=np.maximum(np.rint(np.diff(times) / sample_period) - 1.0, 0.0),
            phase=(times - times[0]) / max(times[-1] - times[0], sample_period),
        )


class StateGraph(BaseEstimator):
    """Transitions between contact states, dwell times and the probability of success.

    Args:
        n_states: number of states K; None means the largest label plus one.
        sample_period: time between samples in s, for `transition_matrix` and for sequences without times.
        success: name of the desired outcome.

    Attributes:
        counts_: shape (K, K), number of transitions from the visit of a state i to the visit of another state j.
        exits_: shape (K, A), number of demonstrations that ended in state i with outcome a.
        outcomes_: shape (A,), sorted names of the outcomes, including ``success``.
        sample_counts_: shape (K, K), number of transitions from sample to sample, including those to the same state.
        visits_: shape (K,), number of visits.
        dwell_mean_: shape (K,), mean length of a visit in samples; NaN for states without visits. The last visit of a
            demonstration counts with its length up to the end.
        dwell_std_: shape (K,), population standard deviation of this length.
        dwell_mean_s_: shape (K,), mean duration of a visit in s.
        dwell_std_s_: shape (K,), population standard deviation of this duration in s.
        phase_: shape (K,), mean time of a state's samples within their demonstration, from 0 (start) to 1 (end).
        moves_: shape (K, K + A), probability that a visit ends in each other state or outcome.
        reach_: shape (K,), probability of ending in ``success``; NaN for states without visits.
        next_given_success_: shape (K, K + 1), probability of each next state, and of ``success``, given that the
            demonstration ends in ``success``; zero if it never does.
    """

    def __init__(self, n_states: int | None = None, *, sample_period: float = 0.02, success: str = "inserted") -> None:
        self.n_states = n_states
        self.sample_period = sample_period
        self.success = success

    def fit(
        self,
        label_sequences: Sequence[ArrayLike],
        outcomes: Sequence[str],
        times: Sequence[ArrayLike] | None = None,
    ) -> Self:
        """Counts transitions, visits and outcomes.

        Args:
            label_sequences: one for each demonstration: labels from 0, shape (n_i,).
            outcomes: one for each demonstration: name of its outcome.
            times: one for each demonstration: times of the samples in s, shape (n_i,), increasing. They are needed
                if samples were dropped: a state then lasts until the next sample that was kept. None means that
                samples are ``sample_period`` apart.

        Raises:
            ValueError: if there is no demonstration, a sequence is empty, a label is not an integer from 0 to K - 1,
                times do not increase, or the numbers of sequences, outcomes and times differ.
        """
        sequences = [_checked_labels(labels, i) for i, labels in enumerate(label_sequences)]
        if len(sequences) != len(outcomes) or not sequences:
            raise ValueError(
                f"{len(sequences)} label sequences and {len(outcomes)} outcomes; expected one outcome for"
                " each demonstration, and at least one demonstration"
            )
        if not self.sample_period > 0:
            raise ValueError(f"sample_period = {self.sample_period}; expected a positive number of seconds")
        n_seen = 1 + max(int(labels.max()) for labels in sequences)
        K = n_seen if self.n_states is None else self.n_states
        if n_seen > K:
            raise ValueError(f"label {n_seen - 1} found, but n_states = {K}; raise n_states to at least {n_seen}")
        demonstrations = [
            Visits.of(labels, clock, self.sample_period)
            for labels, clock in zip(sequences, self._checked_times(sequences, times), strict=True)
        ]
        self._count(sequences, demonstrations, outcomes, K)
        states = np.concatenate([d.states for d in demonstrations])
        lengths = np.concatenate([d.lengths for d in demonstrations])
        durations = np.concatenate([d.durations for d in demonstrations])
        phase = np.concatenate([d.phase for d in demonstrations])
        self.visits_ = np.bincount(states, minlength=K).astype(float)
        self.dwell_mean_ = _of_each_state(np.mean, lengths, states, K)
        self.dwell_std_ = _of_each_state(np.std, lengths, states, K)
        self.dwell_mean_s_ = _of_each_state(np.mean, durations, states, K)
        self.dwell_std_s_ = _of_each_state(np.std, durations, states, K)
        self.phase_ = _of_each_state(np.mean, phase, np.concatenate(sequences), K)
        self._solve()
        return self

    def _count(
        self, sequences: list[NDArray[np.intp]], demonstrations: list[Visits], outcomes: Sequence[str], K: int
    ) -> None:
        """Counts the transitions between visits, between samples, and to the outcomes."""
        self.outcomes_ = np.unique([self.success, *outcomes])
        self.counts_ = np.zeros((K, K))
        self.sample_counts_ = np.zeros((K, K))
        self.exits_ = np.zeros((K, len(self.outcomes_)))
        for labels, visits, outcome in zip(sequences, demonstrations, outcomes, strict=True):
            np.add.at(self.counts_, (visits.states[:-1], visits.states[1:]), 1.0)
            self.exits_[visits.states[-1], np.searchsorted(self.outcomes_, outcome)] += 1.0
            np.add.at(self.sample_counts_, (labels[:-1], labels[1:]), 1.0)
            # Dropped samples have the state of the sample before them.
            np.add.at(self.sample_counts_, (labels[:-1], labels[:-1]), visits.dropped)

    def desired_next(self, state: int) -> int | None:
        """Returns the most probable next state of a successful demonstration.

        It maximises P(j | i, success) = P_ij B_j / B_i, so a rare direct transition does not outweigh the usual way.

        Args:
            state: current state i.

        Returns:
            The next state j; ``state`` itself if no demonstration succeeded from there; None if the demonstration
            most probably ends in success.

        Raises:
            ValueError: if there is no such state.
        """
        check_is_fitted(self)
        if not 0 <= state < len(self.visits_):
            raise ValueError(f"state {state}; expected a state from 0 to {len(self.visits_) - 1}")
        conditional = self.next_given_success_[state]
        if not conditional.any():
            return state
        best = int(conditional.argmax())
        return None if best == len(self.visits_) else best

    def values(self, time_constant: float) -> Array:
        """Returns the value of each state, shape (K,): how probably and how soon it leads to ``success``.

        The value is V = E[exp(-t / tau)], with t the time until ``success``, infinite after another outcome. With the
        mean duration d_i of a visit it solves V_i = exp(-d_i / tau) (sum_j P_ij V_j + P_i,success). The value of a
        state without visits is 0.

        Args:
            time_constant: tau, s, positive.
        """
        check_is_fitted(self)
        K = len(self.visits_)
        kept = np.exp(-np.nan_to_num(self.dwell_mean_s_) / time_constant)
        success = int(np.searchsorted(self.outcomes_, self.success))
        moves = kept[:, None] * self.moves_
        found: Array = np.linalg.solve(np.eye(K) - moves[:, :K], moves[:, K + success])
        return found

    def transition_matrix(self) -> Array:
        """Returns the probability of each state at the next sample given the current state, shape (K, K).

        Each row sums to one; the rows of states without visits are uniform. One pseudo-count is added to each row, in
        equal parts. It keeps a filter from excluding transitions that were not demonstrated.
        """
        check_is_fitted(self)
        counts = self.sample_counts_ + 1.0 / len(self.sample_counts_)
        matrix: Array = counts / counts.sum(axis=1, keepdims=True)
        return matrix

    def to_frame(self) -> pd.DataFrame:
        """Returns a table, one row for each state.

        Its columns are the number of visits, the dwell time in s and its standard deviation, the phase, the
        probability of success, and the desired next state.
        """
        check_is_fitted(self)
        K = len(self.visits_)
        nexts = [self.desired_next(state) for state in range(K)]
        next_labels = [self.success if s is None else "-" if s == i else s for i, s in enumerate(nexts)]
        return pd.DataFrame(
            {
                "visits": self.visits_.astype(int),
                "dwell_s": self.dwell_mean_s_,
                "dwell_std_s": self.dwell_std_s_,
                "phase": self.phase_,
                f"P({self.success})": self.reach_,
                "desired_next": next_labels,
            },
            index=pd.RangeIndex(K, name="state"),
        )

    def __str__(self) -> str:
        if not hasattr(self, "counts_"):
            return repr(self)
        return str(self.to_frame().to_string(float_format="{:.2f}".format))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Returns the graph as arrays that can be stored without pickle."""
        check_is_fitted(self)
        return {
            "sample_period": np.array(float(self.sample_period)),
            "success": np.array(self.success),
            **{name.rstrip("_"): getattr(self, name) for name in FITTED},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores a graph from the result of `to_arrays`.

        Raises:
            ValueError: if an array is missing, unknown, or does not fit the others.
        """
        check_arrays(arrays, RULES, "StateGraph.to_arrays")
        ended = np.asarray(arrays["counts"]).sum(axis=1) + np.asarray(arrays["exits"]).sum(axis=1)
        if not np.array_equal(ended, arrays["visits"]):
            raise ValueError("array 'visits' is not the number of the transitions in 'counts' and 'exits'")
        unseen = np.asarray(arrays["visits"]) == 0
        for name, rule in RULES.items():
            if rule.unknown and not np.array_equal(np.isnan(arrays[name]), unseen):
                raise ValueError(f"array '{name}' is not NaN exactly where a state has no 'visits'")
        outcomes = np.asarray(arrays["outcomes"])
        if not np.array_equal(outcomes, np.unique(outcomes)) or str(arrays["success"]) not in outcomes:
            raise ValueError(f"array 'outcomes' is {outcomes.tolist()}, expected names in order with that of 'success'")
        self = cls(
            n_states=len(arrays["visits"]),
            sample_period=float(arrays["sample_period"]),
            success=str(arrays["success"]),
        )
        for name in FITTED:
            setattr(self, name, np.array(arrays[name.rstrip("_")]))
        self._solve()
        return self

    def _checked_times(self, sequences: list[NDArray[np.intp]], times: Sequence[ArrayLike] | None) -> list[Array]:
        """Returns the times of the samples of each sequence, in s."""
        if times is None:
            return [self.sample_period * np.arange(len(labels), dtype=np.float64) for labels in sequences]
        clocks = [np.asarray(clock, dtype=float) for clock in times]
        if [c.shape for c in clocks] != [labels.shape for labels in sequences]:
            raise ValueError("times and label sequences differ in number or length; expected one time for each label")
        for i, clock in enumerate(clocks):
            if not np.isfinite(clock).all() or (np.diff(clock) <= 0).any():
                raise ValueError(f"times of sequence {i} do not increase; expected seconds since its start")
        return clocks

    def _solve(self) -> None:
        """Computes the probabilities from the counts."""
        K = len(self.counts_)
        moves = np.hstack([self.counts_, self.exits_])
        totals = moves.sum(axis=1)
        seen = totals > 0
        self.moves_ = np.divide(moves, totals[:, None], out=np.zeros_like(moves), where=seen[:, None])
        # From each visited state its own demonstration reaches an outcome, so I - Q is regular.
        Q, R = self.moves_[np.ix_(seen, np.flatnonzero(seen))], self.moves_[seen, K:]
        success = int(np.searchsorted(self.outcomes_, self.success))
        self.reach_ = np.full(K, np.nan)
        self.reach_[seen] = np.linalg.solve(np.eye(int(seen.sum())) - Q, R[:, success]).clip(0.0, 1.0)
        reached = np.append(np.nan_to_num(self.reach_), 1.0)
        joint = np.column_stack([self.moves_[:, :K], self.moves_[:, K + success]]) * reached
        sums = joint.sum(axis=1, keepdims=True)
        self.next_given_success_ = np.divide(joint, sums, out=np.zeros_like(joint), where=sums > 0)


def _of_each_state(statistic: Callable[[Any], Any], values: NDArray[Any], states: NDArray[np.intp], K: int) -> Array:
    """Returns a statistic of the values that belong to each state, shape (K,); NaN for states without values."""
    members = [values[states == state] for state in range(K)]
    return np.array([statistic(of_state) if len(of_state) else np.nan for of_state in members])


def _checked_labels(labels: ArrayLike, i: int) -> NDArray[np.intp]:
    """Returns the labels of sequence ``i``, shape (n,).

    Raises:
        ValueError: if they are not a vector of integers from 0.
    """
    array = np.asarray(labels)
    if array.ndim != 1 or len(array) == 0:
        raise ValueError(f"label sequence {i} has shape {array.shape}; expected (n,), at least one sample")
    integers = array.astype(np.intp)
    if not np.array_equal(integers, array) or integers.min() < 0:
        raise ValueError(
            f"label sequence {i} has labels that are not integers of at least 0;"
            " assign unknown samples to their nearest state or drop them"
        )
    return integers
