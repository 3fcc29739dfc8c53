"""On-line estimation of the contact state: posterior, gate for unknown samples, and a hidden Markov filter.

`ContactStateFilter` is immutable and its `step` is a pure function, so the caller stores the belief, for example in the
context of a simulation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.clustering.gaussian_components import distance_gate, log_normalizers, tailed_log_densities
from skill.clustering.gaussian_states import MAX_VALUE, GaussianStates

MAX_ROW_SUM_ERROR = 1e-9
"""Maximum deviation from one of the row sums of a transition matrix."""


class ContactEstimate(NamedTuple):
    """One on-line estimate of the contact state.

    Attributes:
        log_belief: shape (M,), log-probability of each state given the samples so far; argument of the next step.
        probabilities: shape (M,), exponential of ``log_belief``.
        mahalanobis: squared Mahalanobis distance of the sample to the state most probable with this sample.
        known: whether this distance lies within the gate.
    """

    log_belief: Array
    probabilities: Array
    mahalanobis: float
    known: bool


class ContactStateFilter:
    """Recursive estimate of the contact state from states with densities p, Gaussian or Student.

    Without a transition matrix, each sample is classified on its own, log b_i = log P_i p(x | v_i, F_i) + const. With
    a transition matrix, the estimate is the normalised forward recursion of a hidden Markov model (Rabiner, Proc. IEEE
    77(2), 1989, eq. 20),

        log b_i(t) = log sum_k b_k(t-1) A_ki + log p(x(t) | v_i, F_i) + const.

    A sample outside the gate belongs to no state and does not tell the states apart. The belief is then only
    propagated, b(t) = A' b(t-1), or kept without a transition matrix.

    Args:
        states: fitted states.
        gate: probability in (0, 1) of `distance_gate`; None means no gate.
        transitions: shape (M, M), probability A_ki of the transition from state k to state i between samples; each
            row sums to one. None means no transition matrix.
        channels: indices of the k channels that samples contain; the other channels are marginalised out. None means
            all channels.

    Raises:
        ValueError: if the gate, the transition matrix or the channels are out of range.
    """

    def __init__(
        self,
        states: GaussianStates,
        *,
        gate: float | None = 0.999,
        transitions: ArrayLike | None = None,
        channels: ArrayLike | None = None,
    ) -> None:
        components, factors = states.marginal(channels)
        M, k = components.means.shape
        self.n_states = M
        self.n_channels = k
        self.threshold = np.inf if gate is None else distance_gate(gate, k, components.degrees)
        self.transitions = None if transitions is None else _checked_transitions(transitions, M)
        # One product whitens the sample for all states: the rows of W are R_i', so W x - W v has shape (M k,).
        self._whitening = np.ascontiguousarray(factors.transpose(0, 2, 1).reshape(M * k, k))
        self._offset = np.einsum("mab,ma->mb", factors, components.means).reshape(M * k)
        with np.errstate(divide="ignore"):
            self._log_prior = np.log(components.weights)
        self._normalizers = log_normalizers(np.ones(M), factors)
        self._degrees = components.degrees

    def initial_log_belief(self) -> Array:
        """Returns the log of the states' weights, shape (M,)."""
        return self._log_prior.copy()

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> ContactEstimate:
        """Returns the estimate after one sample; does not change the filter or the arguments.

        Values beyond 1e100 count as 1e100, as in `GaussianStates.predict_proba`.

        Args:
            log_belief: shape (M,), belief of the previous step, or `initial_log_belief`.
            x: shape (k,), one sample.

        Raises:
            ValueError: if the sample has the wrong shape or is not finite.
        """
        sample = np.asarray(x, dtype=np.float64)
        if sample.shape != (self.n_channels,):
            raise ValueError(f"sample has shape {sample.shape}, expected ({self.n_channels},)")
        if not np.isfinite(sample).all():
            raise ValueError(f"sample is not finite: {sample}; check the sensor")
        sample = np.minimum(np.maximum(sample, -MAX_VALUE), MAX_VALUE)
        whitened = self._whitening @ sample
        whitened -= self._offset
        blocks = whitened.reshape(self.n_states, self.n_channels)
        distances = np.einsum("mk,mk->m", blocks, blocks)
        if self.transitions is None:
            predicted = self._log_prior
        else:
            b = np.exp(np.asarray(log_belief, dtype=np.float64)) @ self.transitions
            predicted = np.log(b + np.finfo(float).tiny)
        updated = predicted + tailed_log_densities(self._normalizers, distances, self.n_channels, self._degrees)
        best = int(updated.argmax())
        distance = float(distances[best])
        known = distance <= self.threshold
        if not known:
            updated = predicted if self.transitions is not None else np.array(log_belief, dtype=np.float64)
            best = int(updated.argmax())
        updated = updated - updated[best]
        probabilities = np.exp(updated)
        total = probabilities.sum()
        return ContactEstimate(updated - np.log(total), probabilities / total, distance, known)


def _checked_transitions(transitions: ArrayLike, M: int) -> Array:
    """Returns the transition matrix, shape (M, M).

    Raises:
        ValueError: if the shape is wrong, or the rows are not probability distributions.
    """
    matrix = np.array(transitions, dtype=np.float64)
    if matrix.shape != (M, M):
        raise ValueError(f"transitions has shape {matrix.shape}, expected ({M}, {M})")
    row_errors = np.abs(matrix.sum(axis=1) - 1.0)
    if not np.isfinite(matrix).all() or (matrix < 0.0).any() or row_errors.max() > MAX_ROW_SUM_ERROR:
        raise ValueError("transitions: expected probabilities, each row summing to one")
    return matrix
