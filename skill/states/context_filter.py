"""On-line estimation of the context, from the answers to own motions.

The state of a skill is the pair (contact, context). A context never changes during a run: the transition matrix of the
pair is block-diagonal in the context. All blocks are the transitions of the contacts, and what the measurement shows
of the contact does not depend on the context. The belief therefore is the product of two: that of the contacts
(`ContactStateFilter`), and that of the contexts, which this filter follows by Bayes' rule,

    log b_k(t) = log b_k(t-1) + sum_p log p(y_tp | x_t, u_t, k) / tau_p + const,

with the answers of `skill.features.responses` and the evidence of `ContextMixture.log_likelihoods`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.features.responses import N_OBSERVED, ResponseFeatures, horizon_steps
from skill.states.context_mixture import ContextMixture

MIN_PROBABILITY = 1e-5
"""Smallest probability of a context: no model is perfect, and later answers must be able to correct earlier ones."""


def pair_probabilities(states: Array, contexts: Array) -> Array:
    """Returns the probabilities (n, K C) of pairs, from those of states (n, K) and of contexts (n or 1, C)."""
    return (states[:, :, None] * contexts[:, None, :]).reshape(len(states), -1)


class ContextEstimate(NamedTuple):
    """One on-line estimate of the context.

    Attributes:
        memory: argument of the next step.
        probabilities: (C,), probabilities of the contexts given the observations so far.
        evidence: (C,), what this observation added to their logarithms, with mean zero; zero if it tells nothing.
    """

    memory: Array
    probabilities: Array
    evidence: Array


class ContextFilter:
    """The filter of the module. It is immutable; the memory holds the belief and the observations of one horizon.

    Args:
        mixture: fitted contexts.
        responses: computes the answers.
        period: time between observations, s.
    """

    def __init__(self, mixture: ContextMixture, responses: ResponseFeatures, period: float) -> None:
        self._mixture = mixture
        self._responses = responses
        self._rows = horizon_steps(period) + 1
        self.n_contexts = mixture.n_contexts_

    def initial_memory(self) -> Array:
        """Returns the memory at the start, (C + 1 + 9 (h + 1),): the weights of the contexts, and no observations."""
        return np.concatenate([np.log(self._mixture.weights_), [0.0], np.zeros(self._rows * N_OBSERVED)])

    def step(self, memory: ArrayLike, observation: ArrayLike) -> ContextEstimate:
        """Returns the estimate after one observation; does not change the filter or the arguments.

        Raises:
            ValueError: if the observation has the wrong shape or is not finite.
        """
        row = np.asarray(observation, dtype=float)
        if row.shape != (N_OBSERVED,) or not np.isfinite(row).all():
            raise ValueError(f"observation {row}; expected {N_OBSERVED} finite numbers")
        C, stored = self.n_contexts, np.asarray(memory, dtype=float)
        belief, count = np.exp(stored[:C]), min(stored[C] + 1.0, float(self._rows))
        rows = np.vstack([stored[C + 1 :].reshape(self._rows, N_OBSERVED)[1:], row])
        evidence = np.zeros(C)
        before = rows[:1]
        if count == self._rows and self._responses.informative(before)[0]:
            answer = self._responses.between(before, rows[-1:])
            evidence = self._mixture.log_likelihoods(answer.features, answer.outputs, inputs=answer.inputs)[0]
            evidence = evidence - evidence.mean()
            belief = belief * np.exp(evidence - evidence.max())
        belief = MIN_PROBABILITY + (1.0 - C * MIN_PROBABILITY) * belief / belief.sum()
        return ContextEstimate(np.concatenate([np.log(belief), [count], rows.ravel()]), belief, evidence)
