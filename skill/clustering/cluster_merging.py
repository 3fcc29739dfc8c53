"""Merging of Gaussian components, from too many down to one.

The pair whose merger costs the least likelihood (Runnalls, "Kullback-Leibler approach to Gaussian mixture
reduction", IEEE Trans. AES 43(3), 2007) is merged, the mixture is polished by a few steps of EM, and so on.
This gives a good mixture of every number of components without a restart for each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.expectation_maximization import CovariancePrior, expectation_maximization
from skill.clustering.gaussian_components import GaussianComponents, cholesky_factors

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


@dataclass(frozen=True)
class Mixture:
    """Gaussian components and the log-likelihood (nats) of the samples under them."""

    components: GaussianComponents
    log_likelihood: float


def merge_path(
    Z: Array, components: GaussianComponents, prior: CovariancePrior, *, em_steps: int = 10
) -> list[Mixture]:
    """Merges down to one component, polishing after each merger.

    Args:
        Z: samples, shape (N, d).
        components: where to start.
        prior: regularisation of the covariances.
        em_steps: EM steps after each merger, at most.

    Returns:
        The polished mixture of every number of components on the way, from the most to a single one.
    """
    tol = negligible_gain(prior.parameters, len(Z))
    path: list[Mixture] = []
    while True:
        components, log_likelihood, _ = expectation_maximization(Z, components, prior, max_iter=em_steps, tol=tol)
        path.append(Mixture(components, log_likelihood))
        if len(components) == 1:
            return path
        components = merge_closest(components)


def best_of_each_number(paths: list[list[Mixture]]) -> dict[int, Mixture]:
    """Of several paths, the likeliest mixture of each number of components, the most components first."""
    best: dict[int, Mixture] = {}
    for mixture in (mixture for path in paths for mixture in path):
        M = len(mixture.components)
        if M not in best or mixture.log_likelihood > best[M].log_likelihood:
            best[M] = mixture
    return dict(sorted(best.items(), reverse=True))


def negligible_gain(T: int, N: int) -> float:
    """Nats that cannot change the choice of a number: a hundredth of the penalty of one component."""
    return 0.005 * T * float(np.log(N))


def polished(
    Z: Array, candidates: dict[int, Mixture], prior: CovariancePrior, *, em_steps: int = 10
) -> dict[int, Mixture]:
    """The candidates after up to ``em_steps`` of EM on samples ``Z`` (N, d), keyed as before.

    EM drops components that hold no sample; such a candidate is a duplicate of a smaller one and is left out.
    """
    tol = negligible_gain(prior.parameters, len(Z))
    result: dict[int, Mixture] = {}
    for M, candidate in candidates.items():
        components, log_likelihood, _ = expectation_maximization(
            Z, candidate.components, prior, max_iter=em_steps, tol=tol
        )
        if len(components) == M:
            result[M] = Mixture(components, log_likelihood)
    return result
