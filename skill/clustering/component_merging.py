"""Merging of Gaussian components, from many components down to one.

Each step merges the pair whose merger costs the least likelihood (Runnalls, "Kullback-Leibler approach to Gaussian
mixture reduction", IEEE Trans. AES 43(3), 2007) and then improves the mixture by a few iterations of EM. The result is
a good mixture of every number of components, without a new start for each number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.expectation_maximization import CovariancePrior, expectation_maximization
from skill.clustering.gaussian_components import GaussianComponents, cholesky_factors

Indices = NDArray[np.intp]

EM_STEPS = 10
"""Maximum number of EM iterations after each merger, and of those that polish a mixture."""


def merged_pair(components: GaussianComponents, i: Indices, j: Indices) -> GaussianComponents:
    """Returns one component for each pair (i[k], j[k]), with the weight, mean and covariance of the pair's mixture."""
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
    return GaussianComponents(weights, means, covariances, components.degrees)


def _log_determinants(covariances: Array) -> Array:
    """Returns log |F_i| of covariances (M, d, d), shape (M,)."""
    factors = cholesky_factors(covariances)
    logs: Array = 2.0 * np.log(np.einsum("mdd->md", factors)).sum(axis=1)
    return logs


def runnalls_costs(components: GaussianComponents) -> tuple[Indices, Indices, Array]:
    """Returns the cost of merging each pair, 1/2 [P_ij log|F_ij| - P_i log|F_i| - P_j log|F_j|].

    The cost is an upper bound of the Kullback-Leibler divergence from the mixture to the merged mixture.

    Returns:
        Index arrays i < j and the costs in nats per sample, each of shape (M (M - 1) / 2,).
    """
    i, j = np.triu_indices(len(components), k=1)
    pairs = merged_pair(components, i, j)
    own = components.weights * _log_determinants(components.covariances)
    return i, j, 0.5 * (pairs.weights * _log_determinants(pairs.covariances) - own[i] - own[j])


def merge_closest(components: GaussianComponents) -> GaussianComponents:
    """Merges the pair of minimum Runnalls cost; the merged component comes last."""
    i, j, costs = runnalls_costs(components)
    best = int(np.argmin(costs))
    merged = merged_pair(components, i[best : best + 1], j[best : best + 1])
    keep = np.setdiff1d(np.arange(len(components)), [i[best], j[best]])
    return GaussianComponents(
        np.concatenate([components.weights[keep], merged.weights]),
        np.concatenate([components.means[keep], merged.means]),
        np.concatenate([components.covariances[keep], merged.covariances]),
        components.degrees,
    )


@dataclass(frozen=True)
class Mixture:
    """Gaussian components and the log-likelihood of the samples under them, in nats."""

    components: GaussianComponents
    log_likelihood: float


def merge_path(Z: Array, components: GaussianComponents, prior: CovariancePrior) -> list[Mixture]:
    """Merges down to one component, with EM after each merger.

    Args:
        Z: samples, shape (N, d).
        components: initial components.
        prior: regularisation of the covariances.

    Returns:
        The mixture of each number of components after EM, largest number first.
    """
    tol = negligible_gain(prior.parameters, len(Z))
    path: list[Mixture] = []
    while True:
        components, log_likelihood, _ = expectation_maximization(Z, components, prior, max_iter=EM_STEPS, tol=tol)
        path.append(Mixture(components, log_likelihood))
        if len(components) == 1:
            return path
        components = merge_closest(components)


def best_of_each_number(paths: list[list[Mixture]]) -> dict[int, Mixture]:
    """Returns the mixture of maximum likelihood for each number of components, largest number first."""
    best: dict[int, Mixture] = {}
    for mixture in (mixture for path in paths for mixture in path):
        M = len(mixture.components)
        if M not in best or mixture.log_likelihood > best[M].log_likelihood:
            best[M] = mixture
    return dict(sorted(best.items(), reverse=True))


def negligible_gain(T: int, N: int) -> float:
    """Returns a log-likelihood too small to change the chosen number of components, in nats.

    It is a hundredth of the BIC penalty of one component, T / 2 log N.
    """
    return 0.005 * T * float(np.log(N))


def polished(Z: Array, candidates: dict[int, Mixture], prior: CovariancePrior) -> dict[int, Mixture]:
    """Improves mixtures by EM on all samples.

    EM drops components without samples. A candidate that loses a component duplicates a smaller candidate and is
    left out.

    Args:
        Z: samples, shape (N, d).
        candidates: mixture of each number of components.
        prior: regularisation of the covariances.

    Returns:
        The improved mixture of each remaining number of components.
    """
    tol = negligible_gain(prior.parameters, len(Z))
    result: dict[int, Mixture] = {}
    for M, candidate in candidates.items():
        components, log_likelihood, _ = expectation_maximization(
            Z, candidate.components, prior, max_iter=EM_STEPS, tol=tol
        )
        if len(components) == M:
            result[M] = Mixture(components, log_likelihood)
    return result
