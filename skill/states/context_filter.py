"""On-line estimation of the context, from the answers to own motions.

The state of a skill is the pair (contact, context). A context never changes during a run: the transition matrix of the
pair is block-diagonal in the context. All blocks are the transitions of the contacts, and what the measurement shows
of the contact does not depend on the context. The belief therefore is the product of two: that of the contacts
(`ContactStateFilter`), and that of the contexts, which this filter follows by Bayes' rule,

    log b_k(t) = log b_k(t-1) + sum_p log p(y_tp | x_t, u_t, k) / tau_p + const,

with the answers of `skill.features.responses` and the evidence of `ContextMixture.log_likelihoods`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.compiled import compiled
from skill.features.responses import N_OBSERVED, ResponseFeatures, horizon_steps, is_informative, response
from skill.features.wrench_features import MEASURED
from skill.regression.response_model import log_density, residuals_of_sums
from skill.states.context_mixture import ContextMixture

NEGLIGIBLE_WEIGHT = 1e-20
"""Weight of a sample that does not count; `skill.regression.response_model.PRIOR_SAMPLES` others do."""

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
        self._features = responses.features
        self.n_contexts = mixture.n_contexts_
        self.numbers = ContextNumbers(
            log_weights=np.log(mixture.weights_),
            rows=horizon_steps(period) + 1,
            peg_radius=responses.peg_radius,
            X=np.ascontiguousarray(mixture.samples_.X),
            moments=np.ascontiguousarray(mixture.model_.moments),
            memberships=mixture.memberships_,
            bandwidth=float(mixture.bandwidth),
            feature_scale=np.asarray(mixture.scales_[0]),
            input_scale=np.asarray(mixture.scales_[1]),
            output_scale=np.asarray(mixture.scales_[2]),
            centre=np.asarray(mixture.centre_),
            correlation_times=np.asarray(mixture.correlation_times_),
        )

    def initial_memory(self) -> Array:
        """Returns the memory at the start, (C + 1 + 9 (h + 1),): the weights of the contexts, and no observations."""
        return np.concatenate([self.numbers.log_weights, [0.0], np.zeros(self.numbers.rows * N_OBSERVED)])

    def step(self, memory: ArrayLike, observation: ArrayLike) -> ContextEstimate:
        """Returns the estimate after one observation; does not change the filter or the arguments.

        Raises:
            ValueError: if the observation has the wrong shape or is not finite.
        """
        row = np.array(observation, dtype=float)
        if row.shape != (N_OBSERVED,) or not np.isfinite(row).all():
            raise ValueError(f"observation {row}; expected {N_OBSERVED} finite numbers")
        stored = np.array(memory, dtype=float)
        before = observation_before(self.numbers, stored)[None, : len(MEASURED)]
        features, angle = self._features.transform(before)[0], self._features.rotation_angle(before)[0]
        return ContextEstimate(*context_filter_step(self.numbers, stored, row, features, angle))


class ContextNumbers(NamedTuple):
    """A filter of C contexts.

    Attributes:
        log_weights: (C,), before the first observation.
        rows: number of observations in the memory, h + 1.
        peg_radius: r, m.
        X: (n, d), features of the samples, scaled.
        moments: (n, f), see `ResponseModel`.
        memberships: (n, C), probabilities of the contexts of the samples.
        bandwidth: of the kernel.
        feature_scale: (d,).
        input_scale: (3,).
        output_scale: (5,).
        centre: (5,), mean of the outputs.
        correlation_times: (5,), tau.
    """

    log_weights: Array
    rows: int
    peg_radius: float
    X: Array
    moments: Array
    memberships: Array
    bandwidth: float
    feature_scale: Array
    input_scale: Array
    output_scale: Array
    centre: Array
    correlation_times: Array


@compiled
def observation_before(p: ContextNumbers, memory: Array) -> Array:
    """Returns the observation (9,) with which the next one is compared: that of one horizon before."""
    start = len(p.log_weights) + 1 + N_OBSERVED
    return memory[start : start + N_OBSERVED].copy()


@compiled
def context_filter_step(
    p: ContextNumbers, memory: Array, observation: Array, features: Array, angle: float
) -> tuple[Array, Array, Array]:
    """Returns the memory, the probabilities (C,) and the evidence (C,) after one observation.

    Args:
        p: the filter.
        memory: of the last step.
        observation: (9,).
        features: (d,), of the observation that `observation_before` returns.
        angle: of the frame of these features, rad.
    """
    C = len(p.log_weights)
    found, evidence = memory.copy(), np.zeros(C)
    found[C + 1 : -N_OBSERVED] = memory[C + 1 + N_OBSERVED :]
    found[-N_OBSERVED:] = observation
    found[C] = min(memory[C] + 1.0, float(p.rows))
    belief, before = np.exp(memory[:C]), found[C + 1 : C + 1 + N_OBSERVED]
    if found[C] == p.rows and is_informative(before, p.peg_radius):
        inputs, outputs = response(before, observation, angle, p.peg_radius)
        evidence = response_evidence(p, features, inputs, outputs)
        evidence -= evidence.mean()
        belief = belief * np.exp(evidence - evidence.max())
    belief = MIN_PROBABILITY + (1.0 - C * MIN_PROBABILITY) * belief / belief.sum()
    found[:C] = np.log(belief)
    return found, belief, evidence


@compiled
def response_evidence(p: ContextNumbers, features: Array, inputs: Array, outputs: Array) -> Array:
    """Returns the evidence (C,) of one answer, as `ContextMixture.log_likelihoods` does.

    Args:
        p: the filter.
        features: (d,), not scaled, as all arguments.
        inputs: (3,).
        outputs: (5,).
    """
    C, x = len(p.log_weights), features / p.feature_scale
    u, y = np.empty((C, len(inputs))), np.empty((C, len(outputs)))
    for k in range(C):
        u[k], y[k] = inputs / p.input_scale, (outputs - p.centre) / p.output_scale
    sums = np.zeros((C, p.moments.shape[1]))
    for j in range(len(p.X)):
        square = 0.0
        for i in range(len(x)):
            square += (x[i] - p.X[j, i]) ** 2
        weight = math.exp(-square / (2.0 * p.bandwidth**2))
        if weight > NEGLIGIBLE_WEIGHT:
            for k in range(C):
                sums[k] += weight * p.memberships[j, k] * p.moments[j]
    densities = log_density(*residuals_of_sums(sums, u, y))
    found = np.zeros(C)
    for k in range(C):
        found[k] = (densities[k] / p.correlation_times).sum()
    return found
