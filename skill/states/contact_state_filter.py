"""Which contact state is the peg in, on line: posterior, gate for the unknown, and a hidden Markov filter.

`ContactStateFilter` is immutable and its `step` a pure function, so that whoever runs it keeps the belief
wherever state belongs (the context of a simulation, say). `StateEstimator` keeps the belief itself.
"""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.clustering.gaussian_components import log_normalizers
from skill.clustering.gaussian_states import UNKNOWN, GaussianStates, chi_square_gate


class Estimate(NamedTuple):
    """One on-line estimate.

    Attributes:
        log_belief: shape (M,), log-probability of each state given the samples so far, to be handed to
            the next step.
        probabilities: shape (M,), its exponential.
        mahalanobis: squared Mahalanobis distance of the sample to the most probable state.
        known: whether that distance lies within the gate.
    """

    log_belief: Array
    probabilities: Array
    mahalanobis: float
    known: bool


class ContactStateFilter:
    """Recursive estimate of the contact state from Gaussian states.

    Without a transition matrix every sample is judged by itself, log b_i = log P_i N(x | v_i, F_i) + const.
    With one it is the forward recursion of a hidden Markov model (Rabiner, Proc. IEEE 77(2), 1989, eq. 20,
    normalised),

        log b_i(t) = log sum_k b_k(t-1) A_ki + log N(x(t) | v_i, F_i) + const.

    A sample outside the gate belongs to no state and says nothing about which it is: the belief is then only
    carried forward, b(t) = A' b(t-1), or kept.

    Args:
        states: fitted states.
        gate: probability in (0, 1) of the chi-square gate, or None for no gate.
        transitions: shape (M, M), A_ki the probability of going from state k to i between samples, rows
            summing to
            one; or None.
        channels: indices of the k channels that samples hold, or None for all; the others are
            marginalised out.

    Raises:
        ValueError: if the gate, the transition matrix or the channels are not as described.
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
        self.threshold = np.inf if gate is None else chi_square_gate(gate, k)
        self.transitions = None if transitions is None else _checked_transitions(transitions, M)
        # One product whitens the sample for all states: rows of W are R_i', so W x - W v is (M k,).
        self._whitening = np.ascontiguousarray(factors.transpose(0, 2, 1).reshape(M * k, k))
        self._offset = np.einsum("mab,ma->mb", factors, components.means).reshape(M * k)
        with np.errstate(divide="ignore"):
            self._log_prior = np.log(components.weights)
        self._constant = log_normalizers(np.ones(M), factors)

    def initial_log_belief(self) -> Array:
        """Log of the states' shares, shape (M,)."""
        return self._log_prior.copy()

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> Estimate:
        """One step of the filter; changes nothing.

        Args:
            log_belief: shape (M,), of the previous step or `initial_log_belief`.
            x: shape (k,), one sample.

        Raises:
            ValueError: if the sample has the wrong shape or is not finite.
        """
        sample = np.asarray(x, dtype=np.float64)
        if sample.shape != (self.n_channels,):
            raise ValueError(f"sample has shape {sample.shape}, expected ({self.n_channels},)")
        whitened = self._whitening @ sample
        whitened -= self._offset
        blocks = whitened.reshape(self.n_states, self.n_channels)
        distances = np.einsum("mk,mk->m", blocks, blocks)
        if self.transitions is None:
            predicted = self._log_prior
        else:
            b = np.exp(np.asarray(log_belief, dtype=np.float64)) @ self.transitions
            predicted = np.log(b + np.finfo(float).tiny)
        updated = predicted + self._constant
        updated -= 0.5 * distances
        best = int(updated.argmax())
        distance = float(distances[best])
        if distance != distance:
            raise ValueError(f"sample is not finite: {sample}; check the sensor")
        known = distance <= self.threshold
        if not known:
            updated = predicted if self.transitions is not None else np.array(log_belief, dtype=np.float64)
            best = int(updated.argmax())
        updated = updated - updated[best]
        probabilities = np.exp(updated)
        total = probabilities.sum()
        return Estimate(updated - np.log(total), probabilities / total, distance, known)


class StateEstimator:
    """A `ContactStateFilter` that remembers its belief; one instance serves one run."""

    def __init__(self, contact_state_filter: ContactStateFilter) -> None:
        self.filter = contact_state_filter
        self.log_belief = contact_state_filter.initial_log_belief()

    def reset(self) -> Self:
        """Forgets everything seen."""
        self.log_belief = self.filter.initial_log_belief()
        return self

    def update(self, x: ArrayLike) -> tuple[int, Estimate]:
        """The state after sample ``x`` (k,), -1 for unknown, and the estimate."""
        estimate = self.filter.step(self.log_belief, x)
        self.log_belief = estimate.log_belief
        return (int(estimate.probabilities.argmax()) if estimate.known else UNKNOWN), estimate


def _checked_transitions(transitions: ArrayLike, M: int) -> Array:
    matrix = np.array(transitions, dtype=np.float64)
    if matrix.shape != (M, M):
        raise ValueError(f"transitions has shape {matrix.shape}, expected ({M}, {M})")
    if not np.isfinite(matrix).all() or (matrix < 0.0).any() or np.abs(matrix.sum(axis=1) - 1.0).max() > 1e-9:
        raise ValueError("transitions: expected probabilities, each row summing to one")
    return matrix
