"""Student distributions as components of a mixture: Gaussians with heavy tails.

A multivariate Student distribution with location v, scale matrix F and nu degrees of freedom is a Gaussian whose
covariance is F / w with a random w, which follows a gamma distribution of mean one (Peel and McLachlan, "Robust mixture
modelling using the t distribution", Statistics and Computing 10, 2000). A sample at squared Mahalanobis distance q has
the expected weight (nu + d) / (nu + q) in the location and the scale. Samples far from all components, such as those of
an impact, therefore hardly change them. A mixture of Gaussians spends a component on such samples, which is so wide
that it covers several of the others.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaln
from scipy.stats import chi2, f

from skill.arrays import Array
from skill.clustering.gaussian_components import LOG_2PI

STUDENT_DEGREES = 4.0
"""Degrees of freedom of heavy tails, the fewest whole number for which the variance of the squares of samples is
borderline: a usual choice for robust estimation (Lange, Little and Taylor, JASA 84, 1989)."""


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
