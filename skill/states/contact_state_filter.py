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


class ContactEstimate(NamedTuple):
    """One on-line estimate of the contact state.

    Attributes:
        log_belief: shape (M,), log-probability of each state given the samples so far; argument of the next step.
        probabilities: shape (M,), exponential of ``log_belief``.
        known: whether the Mahalanobis distance to the state most probable with this sample lies within the gate.
    """

    log_belief: Array
    probabilities: Array
    known: bool


class ContactStateFilter:
    """Recursive estimate of the contact state from states with densities p, Gaussian or Student.

    The estimate is the normalised forward recursion of a hidden Markov model (Rabiner, Proc. IEEE 77(2), 1989, eq. 20),

        log b_i(t) = log sum_k b_k(t-1) A_ki + log p(x(t) | v_i, F_i) + const.

    A sample outside the gate belongs to no state and does not tell the states apart. The belief is then only
    propagated, b(t) = A' b(t-1).

    Args:
        states: fitted states.
        transitions: shape (M, M), probability A_ki of the transition from state k to state i between samples; each
            row sums to one.
        channels: indices of the k channels that samples contain; the other channels are marginalised out. None means
            all channels.
        gate: probability in (0, 1) of `distance_gate`; None means no gate.
    """

    def __init__(
        self,
        states: GaussianStates,
        transitions: ArrayLike,
        *,
        channels: ArrayLike | None = None,
        gate: float | None = 0.999,
    ) -> None:
        components, factors = states.marginal(channels)
        M, k = components.means.shape
        self.n_states = M
        self.n_channels = k
        self.threshold = np.inf if gate is None else distance_gate(gate, k, components.degrees)
        self.transitions = np.asarray(transitions, dtype=np.float64)
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
            x: shape (k,), one sample, finite.
        """
        sample = np.minimum(np.maximum(np.asarray(x, dtype=np.float64), -MAX_VALUE), MAX_VALUE)
        whitened = self._whitening @ sample
        whitened -= self._offset
        blocks = whitened.reshape(self.n_states, self.n_channels)
        distances = np.einsum("mk,mk->m", blocks, blocks)
        b = np.exp(np.asarray(log_belief, dtype=np.float64)) @ self.transitions
        predicted = np.log(b + np.finfo(float).tiny)
        updated = predicted + tailed_log_densities(self._normalizers, distances, self.n_channels, self._degrees)
        best = int(updated.argmax())
        known = bool(distances[best] <= self.threshold)
        if not known:
            updated = predicted
            best = int(updated.argmax())
        updated = updated - updated[best]
        probabilities = np.exp(updated)
        total = probabilities.sum()
        return ContactEstimate(updated - np.log(total), probabilities / total, known)
