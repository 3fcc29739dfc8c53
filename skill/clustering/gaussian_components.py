"""Components of a mixture, Gaussian or Student: log-densities and weighted moments as matrix products.

The *quadratic features* of a sample are phi(z) = (1, z_a, z_a z_b for a <= b). Every squared Mahalanobis distance
is linear in phi, and every weighted moment up to the second is a weighted sum of phi. The E step is therefore one
matrix product and the M step another. The cost is cancellation: the relative error is of the order of
eps * cond(F). For this reason samples are centred and scaled first. Prediction uses `squared_mahalanobis` instead.

A multivariate Student distribution with location v, scale matrix F and nu degrees of freedom is a Gaussian whose
covariance is F / w with a random w, which follows a gamma distribution of mean one (Peel and McLachlan, "Robust mixture
modelling using the t distribution", Statistics and Computing 10, 2000). A sample at squared Mahalanobis distance q has
the expected weight (nu + d) / (nu + q) in the location and the scale. Samples far from all components, such as those of
an impact, therefore hardly change them. A mixture of Gaussians spends a component on such samples, which is so wide
that it covers several of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.special import gammaln
from scipy.stats import chi2, f

from skill.arrays import Array

LOG_2PI = float(np.log(2.0 * np.pi))

STUDENT_DEGREES = 4.0
"""Degrees of freedom of heavy tails, the fewest whole number for which the variance of the squares of samples is
borderline: a usual choice for robust estimation (Lange, Little and Taylor, JASA 84, 1989)."""


@dataclass(frozen=True)
class GaussianComponents:
    """M weighted Gaussians or Student distributions in d channels.

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

    def retained(self, keep: NDArray[np.bool_]) -> GaussianComponents:
        """Returns the components selected by the mask ``keep`` (M,), their weights normalised again."""
        weights = self.weights[keep]
        return GaussianComponents(weights / weights.sum(), self.means[keep], self.covariances[keep], self.degrees)

    def rescaled(self, shift: Array, scale: Array) -> GaussianComponents:
        """Returns the components of samples shift + scale Z, largest weight first; ``shift``, ``scale`` (d,)."""
        order = np.argsort(-self.weights, kind="stable")
        return GaussianComponents(
            self.weights[order],
            shift + scale * self.means[order],
            scale[:, None] * self.covariances[order] * scale,
            self.degrees,
        )


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
        ValueError: if a covariance is not positive definite. The message names the parameter to raise.
    """
    try:
        return np.asarray(np.linalg.cholesky(covariances), dtype=np.float64)
    except np.linalg.LinAlgError:
        smallest = float(np.linalg.eigvalsh(covariances).min())
        raise ValueError(
            f"a covariance is not positive definite (smallest eigenvalue {smallest:.3g});"
            " within a state, a channel is constant or a combination of other channels:"
            " raise reg_covar, or drop the channel"
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


def log_density_coefficients(components: GaussianComponents, features: QuadraticFeatures) -> Array:
    """Returns C, shape (M, size), with C phi(z) = log P_i N(z | v_i, F_i)."""
    factors = precision_factors(components.covariances)
    precisions = factors @ factors.transpose(0, 2, 1)
    linear = np.einsum("mab,mb->ma", precisions, components.means)
    offset = np.einsum("ma,ma->m", linear, components.means)
    constant = log_normalizers(components.weights, factors) - 0.5 * offset
    return features.coefficients(-0.5 * precisions, linear, constant)


def tailed_log_densities(log_normalizers: Array, squared: Array, d: int, degrees: float) -> Array:
    """Returns the log-densities log P_i p(x_j | v_i, F_i), in the shape of ``squared``.

    Args:
        log_normalizers: log P_i - d/2 log(2 pi) - 1/2 log |F_i|; its shape broadcasts with ``squared``.
        squared: squared Mahalanobis distances.
        d: number of channels.
        degrees: degrees of freedom nu; infinite for Gaussians.
    """
    if np.isinf(degrees):
        return log_normalizers - 0.5 * squared
    ratio = gammaln(0.5 * (degrees + d)) - gammaln(0.5 * degrees) - 0.5 * d * (np.log(degrees * np.pi) - LOG_2PI)
    densities: Array = log_normalizers + ratio - 0.5 * (degrees + d) * np.log1p(squared / degrees)
    return densities


def tail_weights(squared: Array, d: int, degrees: float) -> Array:
    """Returns the expected weights (nu + d) / (nu + q) of samples at squared Mahalanobis distances q."""
    return (degrees + d) / (degrees + squared)


def distance_gate(probability: float, d: int, degrees: float = np.inf) -> float:
    """Returns the squared Mahalanobis distance that a share ``probability`` of a component's samples does not exceed.

    It is a quantile of the chi-square distribution for Gaussians. For Student distributions, it is d times one of the F
    distribution with d and nu degrees of freedom.

    Args:
        probability: between 0 and 1, exclusive.
        d: number of channels.
        degrees: degrees of freedom nu; infinite for Gaussians.

    Raises:
        ValueError: if the probability is out of range.
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"gate={probability!r}: expected a probability between 0 and 1, for example 0.999")
    return float(chi2.ppf(probability, d) if np.isinf(degrees) else d * f.ppf(probability, d, degrees))


def score_variances(d: int, degrees: float) -> tuple[float, float]:
    """Returns the variances of the scores of one sample, relative to those of a Gaussian.

    With the whitened sample y, the scores are w y_a for the location, w y_a y_b for the scale with a < b, and
    (w y_a^2 - 1) / sqrt(2) for a = b. w q / (nu + d) follows the beta distribution with parameters d / 2 and nu / 2,
    and is independent of the direction of y.

    Returns:
        (nu + d) / (nu + d + 2) for the first two kinds, and (nu + d - 1) / (nu + d + 2) for the third; 1 for Gaussians.
    """
    if np.isinf(degrees):
        return 1.0, 1.0
    return (degrees + d) / (degrees + d + 2.0), (degrees + d - 1.0) / (degrees + d + 2.0)


class MixtureDensities:
    """The densities of a mixture as functions of the quadratic features of samples."""

    def __init__(self, components: GaussianComponents) -> None:
        self.d = components.means.shape[1]
        self.degrees = components.degrees
        self.features = QuadraticFeatures(self.d)
        self._coefficients = log_density_coefficients(components, self.features)
        self._normalizers = log_normalizers(components.weights, precision_factors(components.covariances))[:, None]

    def at(self, phi: Array) -> tuple[Array, Array | None]:
        """Returns the log-densities log P_i p_i of samples with features ``phi`` (size, n), and their tail weights."""
        gaussian = self._coefficients @ phi
        if np.isinf(self.degrees):
            return gaussian, None
        squared = 2.0 * (self._normalizers - gaussian)
        densities = tailed_log_densities(self._normalizers, squared, self.d, self.degrees)
        return densities, tail_weights(squared, self.d, self.degrees)
