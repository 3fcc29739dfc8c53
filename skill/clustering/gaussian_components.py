"""Components of a mixture: log-densities and weighted moments as matrix products, and regularised covariances.

The *quadratic features* of a sample are phi(z) = (1, z_a, z_a z_b for a <= b). Every squared Mahalanobis distance
is linear in phi, and every weighted moment up to the second is a weighted sum of phi. The E step is therefore one
matrix product and the M step another. The cost is cancellation: the relative error is of the order of
eps * cond(F). For this reason samples are centred and scaled first, and `log_densities`, which serves prediction,
uses the triangular factors instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from skill.arrays import Array

LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class GaussianComponents:
    """M weighted Gaussians in d channels, or Student distributions (`skill.clustering.student_tails`).

    Attributes:
        weights: shape (M,), mixture weights P_i; positive, their sum is one.
        means: shape (M, d), means v_i in the units of the channels.
        covariances: shape (M, d, d), covariances F_i; symmetric and positive definite. With finite degrees of freedom
            nu they are scale matrices: the covariance is nu / (nu - 2) F_i.
        degrees: degrees of freedom of the Student distributions; infinite for Gaussians.
    """

    weights: Array
    means: Array
    covariances: Array
    degrees: float = np.inf

    def __len__(self) -> int:
        return len(self.weights)


class QuadraticFeatures:
    """The features phi(z) = (1, z, z_a z_b for a <= b) of samples with ``d`` channels.

    Attributes:
        size: number of features, 1 + d + d (d + 1) / 2.
    """

    def __init__(self, d: int) -> None:
        self.d = d
        self.rows, self.columns = np.triu_indices(d)
        self.size = 1 + d + len(self.rows)

    def transform(self, Z: Array, out: Array | None = None) -> Array:
        """Returns the features of each sample as a *column*, shape (size, n).

        Args:
            Z: samples, shape (n, d).
            out: buffer of shape (size, at least n); its first n columns receive the result. None allocates one.
        """
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
        """Returns C, shape (M, size), with C phi(z) = z' Q_i z + b_i' z + c_i.

        Args:
            quadratic: shape (M, d, d), symmetric matrices Q_i.
            linear: shape (M, d), vectors b_i.
            constant: shape (M,), scalars c_i.
        """
        upper = quadratic[:, self.rows, self.columns] * np.where(self.rows == self.columns, 1.0, 2.0)
        return np.concatenate([constant[:, None], linear, upper], axis=1)

    def moments(self, sums: Array) -> tuple[Array, Array, Array]:
        """Returns total weights (M,), means (M, d) and covariances (M, d, d).

        Args:
            sums: shape (M, size), weighted sums of the features of the samples.
        """
        total = sums[:, 0]
        safe = np.maximum(total, np.finfo(float).tiny)[:, None]
        means = sums[:, 1 : self.d + 1] / safe
        second = np.empty((len(sums), self.d, self.d))
        second[:, self.rows, self.columns] = sums[:, self.d + 1 :] / safe
        second[:, self.columns, self.rows] = second[:, self.rows, self.columns]
        return total, means, second - means[:, :, None] * means[:, None, :]


def cholesky_factors(covariances: Array) -> Array:
    """Returns the lower Cholesky factors L, shape (M, d, d), with F = L L'.

    Raises:
        ValueError: if a covariance is not positive definite. The message names the parameters to raise.
    """
    try:
        return np.asarray(np.linalg.cholesky(covariances), dtype=np.float64)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(covariances).min())
        raise ValueError(
            f"a covariance is not positive definite (smallest eigenvalue {smallest:.3g});"
            " within a state, a channel is constant or a combination of other channels:"
            " raise reg_covar or sensor_variance, or drop the channel"
        ) from None


def precision_factors(covariances: Array) -> Array:
    """Returns upper triangular factors R, shape (M, d, d), with inv(F) = R R'.

    The squared Mahalanobis distance of z is |(z - v) R|^2.
    """
    identity = np.eye(covariances.shape[-1])
    return np.stack([solve_triangular(L, identity, lower=True).T for L in cholesky_factors(covariances)])


def squared_mahalanobis(X: Array, means: Array, factors: Array) -> Array:
    """Returns the squared Mahalanobis distance of each sample to each Gaussian, shape (n, M).

    Args:
        X: samples, shape (n, d).
        means: shape (M, d).
        factors: shape (M, d, d), result of `precision_factors`.
    """
    distances = np.empty((len(X), len(means)))
    for i, (mean, R) in enumerate(zip(means, factors, strict=True)):
        whitened = (X - mean) @ R
        distances[:, i] = np.einsum("nd,nd->n", whitened, whitened)
    return distances


def log_normalizers(weights: Array, factors: Array) -> Array:
    """Returns log P_i - d/2 log(2 pi) - 1/2 log |F_i|, shape (M,); ``factors`` come from `precision_factors`."""
    half_log_precisions = np.log(np.einsum("mdd->md", factors)).sum(axis=1)
    with np.errstate(divide="ignore"):  # a weight may be zero
        normalizers: Array = np.log(weights) - 0.5 * factors.shape[-1] * LOG_2PI + half_log_precisions
    return normalizers


def log_densities(X: Array, weights: Array, means: Array, factors: Array) -> Array:
    """Returns log P_i N(x_j | v_i, F_i), shape (n, M), without a determinant, an inverse or an exponential."""
    return log_normalizers(weights, factors) - 0.5 * squared_mahalanobis(X, means, factors)


def log_density_coefficients(components: GaussianComponents, features: QuadraticFeatures) -> Array:
    """Returns C, shape (M, size), with C phi(z) = log P_i N(z | v_i, F_i)."""
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
    """Returns (n_i F_i + nu S_0) / (n_i + nu) + floor, with S_0 = prior_variance I, shape (M, d, d).

    Args:
        covariances: shape (M, d, d), weighted sample covariances F_i.
        counts: shape (M,), number n_i of samples behind each covariance.
        prior_count: nu >= 0, weight of the prior as a number of samples.
        prior_variance: variance of the spherical prior.
        floor: shape (d,), variance added to each channel (sensor noise and round-off).
        diagonal: whether to keep only the diagonal.
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
    """Number of free parameters of one Gaussian: d + d (d + 1) / 2, or 2 d with a diagonal covariance."""
    return 2 * d if diagonal else d + d * (d + 1) // 2
