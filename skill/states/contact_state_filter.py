"""On-line estimation of the contact state: posterior, gate for unknown samples, and a hidden Markov filter.

`ContactStateFilter` is immutable and its `step` is a pure function, so the caller stores the belief, for example in the
context of a simulation.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compiled import compiled
from skill.arrays import Array
from skill.clustering.gaussian_components import distance_gate, log_normalizers, tailed_log_densities
from skill.clustering.gaussian_states import MAX_VALUE, GaussianStates

TINY = float(np.finfo(float).tiny)


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
        # One product whitens the sample for all states: the rows of W are R_i', so W x - W v has shape (M k,).
        with np.errstate(divide="ignore"):
            self._log_prior = np.log(components.weights)
        constants = log_normalizers(np.ones(M), factors)
        self.numbers = FilterNumbers(
            whitening=np.ascontiguousarray(factors.transpose(0, 2, 1).reshape(M * k, k)),
            offset=np.einsum("mab,ma->mb", factors, components.means).reshape(M * k),
            constants=tailed_log_densities(constants, np.zeros(M), k, components.degrees),
            degrees=float(components.degrees),
            threshold=float(self.threshold),
            transitions=np.array(transitions, dtype=np.float64, order="C"),
        )

    def initial_log_belief(self) -> Array:
        """Returns the log of the states' weights, shape (M,)."""
        return self._log_prior.copy()

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> ContactEstimate:
        """Returns the estimate after one sample; does not change the filter or the arguments.

        Values beyond 1e100 count as 1e100, as in `GaussianStates.predict_proba`.

        Args:
            log_belief: shape (M,), belief of the previous step, or `initial_log_belief`.
            x: shape (k,), one sample, finite.

        Raises:
            ValueError: if a shape is wrong.
        """
        sample, believed = np.ascontiguousarray(x, dtype=np.float64), np.array(log_belief, dtype=np.float64)
        if sample.shape != (self.n_channels,) or believed.shape != (self.n_states,):
            raise ValueError(
                f"belief and sample have shapes {believed.shape} and {sample.shape}; expected ({self.n_states},) and"
                f" ({self.n_channels},)"
            )
        return ContactEstimate(*contact_filter_step(self.numbers, believed, sample))


class FilterNumbers(NamedTuple):
    """A filter of M states over k channels.

    Attributes:
        whitening: (M k, k), rows of the whitening matrices of all states.
        offset: (M k,), the whitened means.
        constants: (M,), log-densities at the means.
        degrees: degrees of freedom of the densities; infinite for Gaussians.
        threshold: largest squared Mahalanobis distance of a known sample.
        transitions: (M, M), A.
    """

    whitening: Array
    offset: Array
    constants: Array
    degrees: float
    threshold: float
    transitions: Array


@compiled
def contact_filter_step(p: FilterNumbers, log_belief: Array, x: Array) -> tuple[Array, Array, bool]:
    """Returns log-belief (M,) and probabilities (M,) after one sample (k,), and whether it is known."""
    M, k = len(p.constants), len(x)
    distances, updated, b = np.zeros(M), np.zeros(M), np.exp(log_belief)
    predicted = np.zeros(M)
    for i in range(M):
        for row in range(i * k, (i + 1) * k):
            whitened = -p.offset[row]
            for j in range(k):
                whitened += p.whitening[row, j] * min(max(x[j], -MAX_VALUE), MAX_VALUE)
            distances[i] += whitened * whitened
        total = 0.0
        for j in range(M):
            total += b[j] * p.transitions[j, i]
        predicted[i] = math.log(total + TINY)
        if math.isinf(p.degrees):
            tail = -0.5 * distances[i]
        else:
            tail = -0.5 * (p.degrees + k) * math.log1p(distances[i] / p.degrees)
        updated[i] = predicted[i] + p.constants[i] + tail
    known = distances[np.argmax(updated)] <= p.threshold
    if not known:
        updated = predicted
    updated = updated - updated.max()
    probabilities = np.exp(updated)
    total = probabilities.sum()
    return updated - math.log(total), probabilities / total, known
