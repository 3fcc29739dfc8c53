"""The graph of contact states: how demonstrations move between them, and where that leads.

A demonstration is a sequence of state labels, one a sample, and an outcome. Runs of equal labels are
visits; the moves from visit to visit make an absorbing Markov chain, whose absorbing states are the
outcomes. With Q the probabilities of moving between states and R those of ending in each outcome, B = (I -
Q)^-1 R holds the probability of each outcome from each state (Kemeny and Snell, "Finite Markov Chains",
1960, theorem 3.3.7).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from skill.arrays import Array

FITTED = (
    *("counts_", "exits_", "sample_counts_", "visits_", "phase_", "outcomes_"),
    *("dwell_mean_", "dwell_std_", "dwell_mean_s_", "dwell_std_s_"),
)


class StateGraph(BaseEstimator):
    """Transitions between contact states, dwell times and the probability of success.

    Args:
        n_states: K; None for the greatest label seen plus one.
        sample_period: s, between samples on line: of ``transition_matrix``, and of sequences without times.
        success: the outcome that is wanted.

    Attributes:
        counts_: (K, K), moves from state i to another state j; zero on the diagonal.
        exits_: (K, A), demonstrations that ended in state i with outcome a.
        outcomes_: (A,), names of the outcomes, ``success`` among them.
        sample_counts_: (K, K), moves from one sample period to the next, staying included.
        visits_: (K,), runs of equal labels.
        dwell_mean_: (K,), mean length of a visit in samples; NaN where there is none. Visits that end with
            the demonstration count with the length they had.
        dwell_std_: (K,), its standard deviation (of the population).
        dwell_mean_s_: (K,), mean length of a visit in s.
        dwell_std_s_: (K,), its standard deviation.
        phase_: (K,), mean time of a state's samples within their demonstration, 0 at its start, 1 at its end.
        moves_: (K, K + A), probabilities of where a visit leads: another state, or an outcome.
        reach_: (K,), probability of ending in ``success``; NaN for states never seen.
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
        """Counts.

        Args:
            label_sequences: one a demonstration: (n_i,) labels from 0, one a sample.
            outcomes: one word a demonstration.
            times: one a demonstration: (n_i,), s, increasing. Give them where samples have been dropped: a state
                then lasts until the next sample that was kept. None: samples are ``sample_period`` apart.

        Raises:
            ValueError: if there is no demonstration, one is empty, labels are not whole numbers from 0 to
                K - 1, times do not increase, or the numbers of sequences, outcomes and times differ.
        """
        sequences = [_checked_labels(labels, i) for i, labels in enumerate(label_sequences)]
        if len(sequences) != len(outcomes) or not sequences:
            raise ValueError(
                f"{len(sequences)} label sequences and {len(outcomes)} outcomes; expected one outcome for"
                " each demonstration, and at least one demonstration"
            )
        if not self.sample_period > 0:
            raise ValueError(f"sample_period = {self.sample_period}; expected a positive number of seconds")
        seen = 1 + max(int(labels.max()) for labels in sequences)
        K = seen if self.n_states is None else self.n_states
        if seen > K:
            raise ValueError(f"label {seen - 1} found, but n_states = {K}; raise n_states to at least {seen}")
        self.outcomes_ = np.unique([self.success, *outcomes])
        self.counts_ = np.zeros((K, K))
        self.sample_counts_ = np.zeros((K, K))
        self.exits_ = np.zeros((K, len(self.outcomes_)))
        clocks = self._clocks(sequences, times)
        lengths: list[list[int]] = [[] for _ in range(K)]
        seconds: list[list[float]] = [[] for _ in range(K)]
        phases: list[list[Array]] = [[] for _ in range(K)]
        for labels, clock, outcome in zip(sequences, clocks, outcomes, strict=True):
            starts = np.concatenate([[0], np.flatnonzero(np.diff(labels)) + 1])
            visited = labels[starts]
            np.add.at(self.counts_, (visited[:-1], visited[1:]), 1.0)
            self.exits_[visited[-1], np.searchsorted(self.outcomes_, outcome)] += 1.0
            np.add.at(self.sample_counts_, (labels[:-1], labels[1:]), 1.0)
            # Through dropped samples the state stayed what it was.
            dropped = np.maximum(np.rint(np.diff(clock) / self.sample_period) - 1.0, 0.0)
            np.add.at(self.sample_counts_, (labels[:-1], labels[:-1]), dropped)
            ends = np.append(clock[starts[1:]], clock[-1] + self.sample_period)
            for state, length in zip(visited, np.diff([*starts, len(labels)]), strict=True):
                lengths[state].append(int(length))
            for state, duration in zip(visited, ends - clock[starts], strict=True):
                seconds[state].append(float(duration))
            phase = (clock - clock[0]) / max(clock[-1] - clock[0], self.sample_period)
            for state in np.unique(visited):
                phases[state].append(phase[labels == state])
        self.visits_ = np.array([len(ls) for ls in lengths], dtype=float)
        self.dwell_mean_ = np.array([np.mean(ls) if ls else np.nan for ls in lengths])
        self.dwell_std_ = np.array([np.std(ls) if ls else np.nan for ls in lengths])
        self.dwell_mean_s_ = np.array([np.mean(s) if s else np.nan for s in seconds])
        self.dwell_std_s_ = np.array([np.std(s) if s else np.nan for s in seconds])
        self.phase_ = np.array([np.concatenate(p).mean() if p else np.nan for p in phases])
        self._solve()
        return self

    def desired_next(self, state: int) -> int | None:
        """The state a successful demonstration most probably goes to next.

        Among the moves j that lead to success, the one of greatest P(j | i, success) = P_ij B_j / B_i: a rare
        lucky jump does not outweigh the way that most insertions take.

        Returns:
            The next state; ``state`` itself if no success was seen from here; None if success itself comes
            next.
        """
        check_is_fitted(self)
        if not 0 <= state < len(self.visits_):
            raise ValueError(f"state {state}; expected a state from 0 to {len(self.visits_) - 1}")
        conditional = self.next_given_success_[state]
        if not conditional.any():
            return state
        best = int(conditional.argmax())
        return None if best == len(self.visits_) else best

    def transition_matrix(self, smoothing: float = 1.0) -> Array:
        """Probabilities of the state at the next sample given that at this one, (K, K), rows sum to one.

        Args:
            smoothing: pseudo-counts a row, spread evenly: the filter must not rule out moves that were
                never seen. States never seen have uniform rows.
        """
        check_is_fitted(self)
        if not smoothing > 0:
            raise ValueError(f"smoothing = {smoothing}; expected a positive number of pseudo-counts")
        counts = self.sample_counts_ + smoothing / len(self.sample_counts_)
        matrix: Array = counts / counts.sum(axis=1, keepdims=True)
        return matrix

    def to_frame(self) -> pd.DataFrame:
        """One row a state: visits, dwell time in s, phase, probability of success, desired next state."""
        check_is_fitted(self)
        K = len(self.visits_)
        nexts = [self.desired_next(state) for state in range(K)]
        shown = [self.success if s is None else "-" if s == i else s for i, s in enumerate(nexts)]
        return pd.DataFrame(
            {
                "visits": self.visits_.astype(int),
                "dwell_s": self.dwell_mean_s_,
                "dwell_std_s": self.dwell_std_s_,
                "phase": self.phase_,
                f"P({self.success})": self.reach_,
                "desired_next": shown,
            },
            index=pd.RangeIndex(K, name="state"),
        )

    def __str__(self) -> str:
        if not hasattr(self, "counts_"):
            return repr(self)
        return str(self.to_frame().to_string(float_format="{:.2f}".format))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything as plain arrays, for a file that needs no pickle."""
        check_is_fitted(self)
        return {
            "sample_period": np.array(float(self.sample_period)),
            "success": np.array(self.success),
            **{name.rstrip("_"): getattr(self, name) for name in FITTED},
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """The graph that ``to_arrays`` described."""
        missing = {name.rstrip("_") for name in FITTED} - set(arrays)
        if missing:
            raise ValueError(f"arrays lack {sorted(missing)}; expected what StateGraph.to_arrays returned")
        self = cls(
            n_states=len(arrays["visits"]),
            sample_period=float(arrays["sample_period"]),
            success=str(arrays["success"]),
        )
        for name in FITTED:
            setattr(self, name, np.array(arrays[name.rstrip("_")]))
        self._solve()
        return self

    def _clocks(self, sequences: Sequence[NDArray[np.intp]], times: Sequence[ArrayLike] | None) -> list[Array]:
        """Times of the samples, s, one array a sequence."""
        if times is None:
            return [self.sample_period * np.arange(len(labels), dtype=np.float64) for labels in sequences]
        clocks = [np.asarray(clock, dtype=float) for clock in times]
        if [c.shape for c in clocks] != [labels.shape for labels in sequences]:
            raise ValueError("times and label sequences differ in number or length; expected one time a label")
        for i, clock in enumerate(clocks):
            if not np.isfinite(clock).all() or (np.diff(clock) <= 0).any():
                raise ValueError(f"times of sequence {i} do not increase; give the seconds since its start")
        return clocks

    def _solve(self) -> None:
        """What follows from the counts."""
        K = len(self.counts_)
        moves = np.hstack([self.counts_, self.exits_])
        totals = moves.sum(axis=1)
        seen = totals > 0
        self.moves_ = np.divide(moves, totals[:, None], out=np.zeros_like(moves), where=seen[:, None])
        # Every state seen leads to the end of its own demonstration, so I - Q is regular on them.
        Q, R = self.moves_[np.ix_(seen, np.flatnonzero(seen))], self.moves_[seen, K:]
        wanted = int(np.searchsorted(self.outcomes_, self.success))
        self.reach_ = np.full(K, np.nan)
        self.reach_[seen] = np.linalg.solve(np.eye(int(seen.sum())) - Q, R[:, wanted]).clip(0.0, 1.0)
        reached = np.append(np.nan_to_num(self.reach_), 1.0)
        joint = np.column_stack([self.moves_[:, :K], self.moves_[:, K + wanted]]) * reached
        sums = joint.sum(axis=1, keepdims=True)
        self.next_given_success_ = np.divide(joint, sums, out=np.zeros_like(joint), where=sums > 0)


def _checked_labels(labels: ArrayLike, i: int) -> NDArray[np.intp]:
    array = np.asarray(labels)
    if array.ndim != 1 or len(array) == 0:
        raise ValueError(f"label sequence {i} has shape {array.shape}; expected (n,), at least one sample")
    whole = array.astype(np.intp)
    if not np.array_equal(whole, array) or whole.min() < 0:
        raise ValueError(
            f"label sequence {i} has labels that are not whole numbers from 0;"
            " assign unknown samples to their nearest state or drop them"
        )
    return whole
