"""Gaussian components as matrix products: log-densities, weighted moments, regularisation and marginals.

With the *quadratic features* of a sample, phi(z) = (1, z_a, z_a z_b for a <= b), every squared Mahalanobis
distance is linear in phi and every weighted moment up to the second is a weighted sum of phi. A whole E step
is then one matrix product and a whole M step another one. The price is cancellation: the relative error is of
the order of eps * cond(F), which is why samples are centred and scaled first and why `log_densities`, used
for prediction, goes through the triangular factors instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from skill.arrays import Array

LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class GaussianComponents:
    """M weighted Gaussians in d channels.

    Attributes:
        weights: shape (M,), positive, summing to one.
        means: shape (M, d), in the units of the channels.
        covariances: shape (M, d, d), symmetric positive definite, in products of the units of the channels.
    """

    weights: Array
    means: Array
    covariances: Array

    def __len__(self) -> int:
        return len(self.weights)


class QuadraticFeatures:
    """The map phi(z) = (1, z, z_a z_b for a <= b) of samples with ``d`` channels, and its adjoint."""

    def __init__(self, d: int) -> None:
        self.d = d
        self.rows, self.columns = np.triu_indices(d)
        self.size = 1 + d + len(self.rows)

    def transform(self, Z: Array, out: Array | None = None) -> Array:
        """Returns phi of every row of ``Z`` (n, d), one *column* a sample: shape (size, n)."""
        n, d = Z.shape
        features = np.empty((self.size, n)) if out is None else out[:, :n]
        features[0] = 1.0
        features[1 : d + 1] = Z.T
        linear = features[1 : d + 1]
        start = d + 1
        for a in range(d):
            np.multiply(linear[a:], linear[a], out=features[start : start + d - a])
            start += d - a
        return features

    def coefficients(self, quadratic: Array, linear: Array, constant: Array) -> Array:
        """Returns C (M, size) with C phi(z) = z' Q_i z + b_i' z + c_i for symmetric Q (M, d, d)."""
        upper = quadratic[:, self.rows, self.columns] * np.where(self.rows == self.columns, 1.0, 2.0)
        return np.concatenate([constant[:, None], linear, upper], axis=1)

    def moments(self, sums: Array) -> tuple[Array, Array, Array]:
        """Total weight (M,), mean (M, d), covariance (M, d, d) from sums (M, size) of weighted features."""
        total = sums[:, 0]
        safe = np.maximum(total, np.finfo(float).tiny)[:, None]
        means = sums[:, 1 : self.d + 1] / safe
        second = np.empty((len(sums), self.d, self.d))
        second[:, self.rows, self.columns] = sums[:, self.d + 1 :] / safe
        second[:, self.columns, self.rows] = second[:, self.rows, self.columns]
        return total, means, second - means[:, :, None] * means[:, None, :]


def cholesky_factors(covariances: Array) -> Array:
    """Lower Cholesky factors L (M, d, d) of ``covariances``, F = L L'.

    Raises:
        ValueError: if one of them is not positive definite; the message names the parameter to raise.
    """
    try:
        return np.asarray(np.linalg.cholesky(covariances), dtype=np.float64)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(covariances).min())
        raise ValueError(
            f"a covariance is not positive definite (smallest eigenvalue {smallest:.3g});"
            " a channel is constant or repeats others within a state: raise reg_covar"
            " or sensor_variance, or drop the channel"
        ) from None


def precision_factors(covariances: Array) -> Array:
    """Upper triangular R (M, d, d), inv(F) = R R': |(z - v) R|^2 is the squared Mahalanobis distance."""
    identity = np.eye(covariances.shape[-1])
    return np.stack([solve_triangular(L, identity, lower=True).T for L in cholesky_factors(covariances)])


def squared_mahalanobis(X: Array, means: Array, factors: Array) -> Array:
    """Squared Mahalanobis distances (n, M) of rows of ``X`` (n, d); ``factors`` from `precision_factors`."""
    distances = np.empty((len(X), len(means)))
    for i, (mean, R) in enumerate(zip(means, factors, strict=True)):
        whitened = (X - mean) @ R
        distances[:, i] = np.einsum("nd,nd->n", whitened, whitened)
    return distances


def log_normalizers(weights: Array, factors: Array) -> Array:
    """Log P_i - d/2 log(2 pi) - 1/2 log |F_i|, shape (M,)."""
    log_determinants = np.log(np.einsum("mdd->md", factors)).sum(axis=1)
    with np.errstate(divide="ignore"):
        return np.log(weights) - 0.5 * factors.shape[-1] * LOG_2PI + log_determinants


def log_densities(X: Array, weights: Array, means: Array, factors: Array) -> Array:
    """Log P_i N(x_j | v_i, F_i), shape (n, M): never a determinant, an inverse or an exponential."""
    return log_normalizers(weights, factors) - 0.5 * squared_mahalanobis(X, means, factors)


def log_density_coefficients(components: GaussianComponents, features: QuadraticFeatures) -> Array:
    """Coefficients C (M, size) with C phi(z) = log P_i N(z | v_i, F_i)."""
    factors = precision_factors(components.covariances)
    precisions = factors @ factors.transpose(0, 2, 1)
    linear = np.einsum("mab,mb->ma", precisions, components.means)
    offset = np.einsum("ma,ma->m", linear, components.means)
    constant = log_normalizers(components.weights, factors) - 0.5 * offset
    return features.coefficients(-0.5 * precisions, linear, constant)


def shrunk_covariances(
    covariances: Array,
    counts: Array,
    *,
    prior_count: float,
    prior_variance: float,
    floor: Array,
    diagonal: bool,
) -> Array:
    """F <- (n_i F + nu S_0) / (n_i + nu) + floor, with S_0 = prior_variance I.

    Args:
        covariances: shape (M, d, d), weighted sample covariances.
        counts: shape (M,), the number of independent samples n_i behind each.
        prior_count: nu >= 0, how many samples the prior counts for.
        prior_variance: variance of the spherical prior.
        floor: shape (d,), variance added to each channel (sensor noise and round-off).
        diagonal: whether to keep the diagonal only.
    """
    d = covariances.shape[-1]
    identity = np.eye(d)
    n = counts[:, None, None]
    shrunk = (n * covariances + prior_count * prior_variance * identity) / np.maximum(
        n + prior_count, np.finfo(float).tiny
    )
    if diagonal:
        shrunk = shrunk * identity
    return shrunk + np.diag(floor)


def parameters_per_component(d: int, *, diagonal: bool) -> int:
    """Free parameters of one Gaussian: a mean and a covariance, d + d (d + 1) / 2 or 2 d."""
    return 2 * d if diagonal else d + d * (d + 1) // 2
