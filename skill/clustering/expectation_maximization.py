"""One pass over the samples: memberships, competition and weighted moments, in blocks that stay in cache.

The same pass serves Competitive Agglomeration (memberships biased by the cardinalities, moments weighted by
u^2) and ordinary expectation-maximisation (posteriors, moments weighted by h). Nothing of size N x M is ever
stored, so memory is that of the samples themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.gaussian_components import (
    GaussianComponents,
    QuadraticFeatures,
    log_density_coefficients,
    parameters_per_component,
    shrunk_covariances,
)

BLOCK = 2048
"""Samples a block: with 14 channels features and memberships take about 2.4 MB, a second-level cache."""


@dataclass(frozen=True)
class CovariancePrior:
    """What every covariance is pulled towards, in the channels' (standardised) units.

    Attributes:
        count: nu, how many samples the prior counts for.
        variance: g, mean variance of the channels; the prior of M clusters is 0.1 g M^(-2/d) I, a tenth
            of the
            variance a cluster has when M of them tile the data.
        floor: shape (d,), variance added to each channel.
        diagonal: whether covariances are diagonal.
    """

    count: float
    variance: float
    floor: Array
    diagonal: bool

    def apply(self, covariances: Array, counts: Array) -> Array:
        """Regularises sample covariances (M, d, d) that rest on ``counts`` (M,) samples."""
        M, d = covariances.shape[:2]
        return shrunk_covariances(
            covariances,
            counts,
            prior_count=self.count,
            prior_variance=0.1 * self.variance * M ** (-2.0 / d),
            floor=self.floor,
            diagonal=self.diagonal,
        )

    @property
    def parameters(self) -> int:
        """Free parameters T of one component."""
        return parameters_per_component(len(self.floor), diagonal=self.diagonal)


@dataclass(frozen=True)
class EmStep:
    """What one pass over the samples leaves behind.

    Attributes:
        cardinalities: shape (M,), N_i = sum_j u_ij.
        weight_sums: shape (M,), sum of the weights of the moments (u^2 or h).
        means: shape (M, d), weighted means.
        covariances: shape (M, d, d), weighted covariances, not regularised.
        log_likelihood: sum over samples of log sum_i P_i N(z_j | v_i, F_i).
    """

    cardinalities: Array
    weight_sums: Array
    means: Array
    covariances: Array
    log_likelihood: float


def em_step(
    Z: Array,
    components: GaussianComponents,
    *,
    eta: float = 0.0,
    cardinalities: Array | None = None,
    fuzzy: bool = False,
) -> EmStep:
    """Memberships and weighted moments of all samples.

    With h the posterior, the competition is u_ij = h_ij [1 + alpha (N_i - sum_k h_kj N_k)],
    alpha = eta N / sum_k N_k^2, clipped to [0, 1] and renormalised over the clusters: the minimiser of
    sum u^2 d^2 - alpha sum_i N_i^2 (Frigui and Krishnapuram, 1997) for the distance d^2_ij = 1 / h_ij.

    Args:
        Z: samples, shape (N, d).
        components: the current M Gaussians.
        eta: strength of the competition; 0 is none.
        cardinalities: shape (M,), N_i of the previous pass; needed if ``eta`` > 0.
        fuzzy: weigh the moments by u^2 (fuzzifier 2) instead of u.
    """
    N, d = Z.shape
    M = len(components)
    features = QuadraticFeatures(d)
    C = log_density_coefficients(components, features)
    buffer = np.empty((features.size, min(BLOCK, N)))
    sums = np.zeros((M, features.size))
    totals = np.zeros(M)
    log_likelihood = 0.0
    alpha = 0.0
    if eta > 0.0 and M > 1:
        assert cardinalities is not None
        alpha = eta * N / float(cardinalities @ cardinalities)
    for start in range(0, N, BLOCK):
        phi = features.transform(Z[start : start + BLOCK], out=buffer)
        U = C @ phi
        peak = U.max(axis=0)
        U -= peak
        np.exp(U, out=U)
        evidence = U.sum(axis=0)
        U /= evidence
        log_likelihood += float(np.sum(peak + np.log(evidence)))
        if alpha > 0.0:
            assert cardinalities is not None
            U *= (1.0 + alpha * cardinalities[:, None]) - alpha * (cardinalities @ U)
            np.clip(U, 0.0, 1.0, out=U)
            # Never zero: of the clusters with h > 0, the largest has a factor of at least one.
            U /= U.sum(axis=0)
        totals += U.sum(axis=1)
        if fuzzy:
            np.square(U, out=U)
        sums += U @ phi.T
    weight_sums, means, covariances = features.moments(sums)
    return EmStep(totals, weight_sums, means, covariances, log_likelihood)


def updated(result: EmStep, prior: CovariancePrior) -> GaussianComponents:
    """The Gaussians that a sweep implies."""
    return GaussianComponents(
        weights=result.cardinalities / result.cardinalities.sum(),
        means=result.means,
        covariances=prior.apply(result.covariances, result.weight_sums),
    )


def retained(components: GaussianComponents, keep: NDArray[np.bool_]) -> GaussianComponents:
    """The components selected by ``keep`` (mask or indices), their weights renormalised."""
    weights = components.weights[keep]
    return GaussianComponents(weights / weights.sum(), components.means[keep], components.covariances[keep])


def expectation_maximization(
    Z: Array,
    components: GaussianComponents,
    prior: CovariancePrior,
    *,
    max_iter: int,
    tol: float,
) -> tuple[GaussianComponents, float, bool]:
    """Ordinary EM; components left without a single sample are dropped.

    Args:
        Z: samples, shape (N, d).
        components: where to start.
        prior: regularisation of the covariances.
        max_iter: largest number of passes.
        tol: stop when a pass gains less than this, in nats of log-likelihood.

    Returns:
        The components, the log-likelihood of the samples under the components of the last pass but one (those
        the last pass evaluated), and whether the gain fell below ``tol``.
    """
    previous = -np.inf
    evaluated = components
    log_likelihood = -np.inf
    for _ in range(max_iter):
        evaluated = components
        result = em_step(Z, components)
        log_likelihood = result.log_likelihood
        if log_likelihood - previous < tol:
            return evaluated, log_likelihood, True
        previous = log_likelihood
        components = updated(result, prior)
        alive = result.cardinalities >= 1.0
        if not alive.all() and alive.any():
            components = retained(components, alive)
            previous = -np.inf
    return evaluated, log_likelihood, False
