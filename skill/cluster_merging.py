"""Merging of Gaussian components by the Bayesian information criterion.

The pair whose merger costs the least likelihood (Runnalls, "Kullback-Leibler approach to Gaussian mixture
reduction", IEEE Trans. AES 43(3), 2007) is merged, the mixture is polished by a few steps of EM, and so on
down to a single component; the mixture of the least criterion on the way is kept. Starting from too many
components this finds their number without a restart for each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skill.expectation_maximization import CovariancePrior, expectation_maximization
from skill.gaussian_components import Array, GaussianComponents, cholesky_factors

Indices = NDArray[np.intp]


def log_determinants(covariances: Array) -> Array:
    """Log |F_i| of a stack (M, d, d)."""
    factors = cholesky_factors(covariances)
    return 2.0 * np.log(np.einsum("mdd->md", factors)).sum(axis=1)


def merged_pair(components: GaussianComponents, i: Indices, j: Indices) -> GaussianComponents:
    """The moment-preserving mergers of components ``i`` and ``j`` (index arrays, one merger an entry)."""
    P = components.weights
    weights = P[i] + P[j]
    a = (P[i] / weights)[:, None]
    means = a * components.means[i] + (1.0 - a) * components.means[j]
    between = components.means[i] - components.means[j]
    covariances = (
        a[:, :, None] * components.covariances[i]
        + (1.0 - a)[:, :, None] * components.covariances[j]
        + (a * (1.0 - a))[:, :, None] * between[:, :, None] * between[:, None, :]
    )
    return GaussianComponents(weights, means, covariances)


def runnalls_costs(components: GaussianComponents) -> tuple[Indices, Indices, Array]:
    """Cost of merging each pair, 1/2 [P_ij log|F_ij| - P_i log|F_i| - P_j log|F_j|], bounding the loss.

    Returns:
        Index arrays i < j and the costs, each of shape (M (M - 1) / 2,), in nats a sample.
    """
    i, j = np.triu_indices(len(components), k=1)
    pairs = merged_pair(components, i, j)
    own = components.weights * log_determinants(components.covariances)
    return i, j, 0.5 * (pairs.weights * log_determinants(pairs.covariances) - own[i] - own[j])


def merge_closest(components: GaussianComponents) -> GaussianComponents:
    """Merges the pair of least Runnalls cost."""
    i, j, costs = runnalls_costs(components)
    best = int(np.argmin(costs))
    merged = merged_pair(components, i[best : best + 1], j[best : best + 1])
    keep = np.setdiff1d(np.arange(len(components)), [i[best], j[best]])
    return GaussianComponents(
        np.concatenate([components.weights[keep], merged.weights]),
        np.concatenate([components.means[keep], merged.means]),
        np.concatenate([components.covariances[keep], merged.covariances]),
    )


def bayesian_information_criterion(
    log_likelihood: float, M: int, T: int, N: int, evidence: float = 1.0
) -> float:
    """-2 log L + K log n for n = evidence N independent samples, log L scaled to n, K = M T + M - 1."""
    return -2.0 * evidence * log_likelihood + (M * T + M - 1) * float(np.log(max(evidence * N, 2.0)))


def merge_by_bic(
    Z: Array,
    components: GaussianComponents,
    prior: CovariancePrior,
    *,
    evidence: float,
    em_steps: int = 10,
) -> tuple[GaussianComponents, list[tuple[int, float]]]:
    """Merges down to one component; returns the mixture of least criterion and (M, criterion) along the way.

    Args:
        Z: samples, shape (N, d).
        components: where to start.
        prior: regularisation of the covariances.
        evidence: independent samples a sample counts for, in (0, 1].
        em_steps: EM steps after each merger, at most.
    """
    N = len(Z)
    T = prior.parameters
    # A step of EM that gains less than a hundredth of one component's penalty cannot change the choice.
    tol = 0.005 * T * float(np.log(max(evidence * N, 2.0)))
    best, least = components, np.inf
    path: list[tuple[int, float]] = []
    while True:
        components, log_likelihood, _ = expectation_maximization(
            Z, components, prior, evidence=evidence, max_iter=em_steps, tol=tol
        )
        criterion = bayesian_information_criterion(log_likelihood, len(components), T, N, evidence)
        path.append((len(components), criterion))
        if criterion < least:
            best, least = components, criterion
        if len(components) == 1:
            return best, path
        components = merge_closest(components)
