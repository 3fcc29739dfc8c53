"""Expectation-maximisation of mixtures, in blocks of samples that fit into the processor's cache.

The same E step serves Competitive Agglomeration (memberships u biased by the cardinalities, moments weighted by u^2)
and ordinary expectation-maximisation (posteriors h, moments weighted by h). It sums the moments block by block: no
array of size N x M is stored, so the memory needed is that of the samples.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.gaussian_components import GaussianComponents, MixtureDensities

BLOCK = 2048
"""Samples in a block. With 14 channels, features and memberships take 2.4 MB, which fits a second-level cache."""


@dataclass(frozen=True)
class CovariancePrior:
    """Regularisation of the covariances, in the units of the standardised channels.

    Attributes:
        count: nu, weight of the prior as a number of samples.
        variance: g, mean variance of the channels. The prior of M clusters is S_0 = 0.1 g M^(-2/d) I, a tenth of the
            variance of each cluster when M of them tile the data.
        floor: shape (d,), variance added to each channel.
    """

    count: float
    variance: float
    floor: Array

    def apply(self, covariances: Array, counts: Array) -> Array:
        """Returns (n_i F_i + nu S_0) / (n_i + nu) + floor, shape (M, d, d).

        Args:
            covariances: shape (M, d, d), weighted sample covariances F_i.
            counts: shape (M,), number n_i of samples behind each covariance.
        """
        M, d = covariances.shape[:2]
        identity = np.eye(d)
        n = counts[:, None, None]
        shrunk = (n * covariances + self.count * (0.1 * self.variance * M ** (-2.0 / d)) * identity) / np.maximum(
            n + self.count, np.finfo(float).tiny
        )
        return np.asarray(shrunk + np.diag(self.floor), dtype=np.float64)

    @property
    def parameters(self) -> int:
        """Number T of free parameters of one component, d + d (d + 1) / 2."""
        d = len(self.floor)
        return d + d * (d + 1) // 2


@dataclass(frozen=True)
class Moments:
    """Result of one E step: the sums over the samples that the M step needs.

    Attributes:
        cardinalities: shape (M,), N_i = sum_j u_ij.
        weight_sums: shape (M,), sums of the weights of the moments (u^2 or u, times the weights of the tails).
        means: shape (M, d), weighted means.
        covariances: shape (M, d, d), weighted covariances, not regularised.
        log_likelihood: sum over the samples of log sum_i P_i p(z_j | v_i, F_i), in nats.
    """

    cardinalities: Array
    weight_sums: Array
    means: Array
    covariances: Array
    log_likelihood: float


class Block(NamedTuple):
    """The posteriors of n samples.

    Attributes:
        features: shape (size, n), quadratic features; the next block overwrites them.
        posteriors: shape (M, n), h_ij.
        log_densities: shape (n,), log-density of the mixture.
        weights: shape (M, n), weights of the samples in the tails of each component; None for Gaussians.
    """

    features: Array
    posteriors: Array
    log_densities: Array
    weights: Array | None


def posterior_blocks(Z: Array, densities: MixtureDensities) -> Iterator[Block]:
    """Computes the posteriors h_ij = P_i p(z_j | v_i, F_i) / sum_k P_k p(z_j | v_k, F_k) block by block.

    Args:
        Z: samples, shape (N, d).
        densities: of the mixture; p is a Gaussian or a Student distribution.
    """
    buffer = np.empty((densities.features.size, min(BLOCK, len(Z))))
    for start in range(0, len(Z), BLOCK):
        phi = densities.features.transform(Z[start : start + BLOCK], out=buffer)
        posteriors, weights = densities.at(phi)
        peak = posteriors.max(axis=0)
        posteriors -= peak
        np.exp(posteriors, out=posteriors)
        evidence = posteriors.sum(axis=0)
        posteriors /= evidence
        yield Block(phi, posteriors, peak + np.log(evidence), weights)


def e_step(
    Z: Array,
    components: GaussianComponents,
    *,
    eta: float = 0.0,
    cardinalities: Array | None = None,
    fuzzy: bool = False,
) -> Moments:
    """Computes the memberships and the weighted moments of all samples.

    With the posteriors h, the memberships under competition are u_ij = h_ij [1 + alpha (N_i - sum_k h_kj N_k)] with
    alpha = eta N / sum_k N_k^2, clipped to [0, 1] and normalised over the clusters. Before clipping they minimise
    sum u^2 d^2 - alpha sum_i N_i^2 (Frigui and Krishnapuram, 1997) for the distance d^2_ij = 1 / h_ij.

    Args:
        Z: samples, shape (N, d).
        components: the current M Gaussians.
        eta: strength of the competition.
        cardinalities: shape (M,), N_i of the previous step; None means no competition.
        fuzzy: whether to weight the moments by u^2 (fuzzifier 2) instead of u. Student distributions weight them by
            the weights of the tails in addition; the covariance is divided by the sum of all weights, which converges
            faster to the same result (Kent, Tyler and Vardi, Communications in Statistics - Simulation 23, 1994).
    """
    N = len(Z)
    M = len(components)
    densities = MixtureDensities(components)
    sums = np.zeros((M, densities.features.size))
    totals = np.zeros(M)
    log_likelihood = 0.0
    alpha = 0.0 if cardinalities is None or M == 1 else eta * N / float(cardinalities @ cardinalities)
    for phi, U, log_evidence, weights in posterior_blocks(Z, densities):
        log_likelihood += float(np.sum(log_evidence))
        if cardinalities is not None and alpha > 0.0:
            _add_competition(U, cardinalities, alpha)
        totals += U.sum(axis=1)
        if fuzzy:
            np.square(U, out=U)
        if weights is not None:
            U *= weights
        sums += U @ phi.T
    weight_sums, means, covariances = densities.features.moments(sums)
    return Moments(totals, weight_sums, means, covariances, log_likelihood)


def _add_competition(U: Array, cardinalities: Array, alpha: float) -> None:
    """Replaces the posteriors ``U`` (M, n) in place by the memberships under competition."""
    U *= (1.0 + alpha * cardinalities[:, None]) - alpha * (cardinalities @ U)
    np.clip(U, 0.0, 1.0, out=U)
    # The sum is positive: among the clusters with h > 0, the largest has a factor of at least one.
    U /= U.sum(axis=0)


def m_step(moments: Moments, prior: CovariancePrior, degrees: float = np.inf) -> GaussianComponents:
    """Returns the components with the given moments, their covariances regularised by ``prior``."""
    return GaussianComponents(
        weights=moments.cardinalities / moments.cardinalities.sum(),
        means=moments.means,
        covariances=prior.apply(moments.covariances, moments.weight_sums),
        degrees=degrees,
    )


def expectation_maximization(
    Z: Array,
    components: GaussianComponents,
    prior: CovariancePrior,
    *,
    max_iter: int,
    tol: float,
) -> tuple[GaussianComponents, float, bool]:
    """Runs ordinary EM, without competition. Components with a cardinality below one sample are dropped.

    Args:
        Z: samples, shape (N, d).
        components: initial components.
        prior: regularisation of the covariances.
        max_iter: maximum number of iterations, at least 1.
        tol: converged when an iteration gains less log-likelihood than this, in nats.

    Returns:
        The components of the last E step, the log-likelihood of the samples under these components, and whether EM
        converged.
    """
    previous = -np.inf
    evaluated = components
    log_likelihood = -np.inf
    for _ in range(max_iter):
        evaluated = components
        moments = e_step(Z, components)
        log_likelihood = moments.log_likelihood
        if log_likelihood - previous < tol:
            return evaluated, log_likelihood, True
        previous = log_likelihood
        components = m_step(moments, prior, components.degrees)
        alive = moments.cardinalities >= 1.0
        if not alive.all() and alive.any():
            components = components.retained(alive)
            previous = -np.inf
    return evaluated, log_likelihood, False


def components_of_partition(Z: Array, labels: NDArray[np.intp], prior: CovariancePrior) -> GaussianComponents:
    """Returns one Gaussian for each label that occurs: share, mean and regularised covariance of its samples."""
    _, labels = np.unique(labels, return_inverse=True)
    counts = np.bincount(labels).astype(float)
    order = np.argsort(labels, kind="stable")
    members = np.split(order, np.cumsum(counts.astype(np.intp))[:-1])
    means = np.stack([Z[rows].mean(axis=0) for rows in members])
    covariances = np.stack(
        [(Z[rows] - mean).T @ (Z[rows] - mean) / len(rows) for rows, mean in zip(members, means, strict=True)]
    )
    return GaussianComponents(counts / counts.sum(), means, prior.apply(covariances, counts))
