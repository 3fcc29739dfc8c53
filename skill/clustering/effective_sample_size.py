"""How many independent samples a set of demonstrations is worth.

Consecutive samples of a trajectory repeat each other: the offset, the tilt and the axis of one demonstration
hardly change within a state, however fast it is sampled. A likelihood that multiplies the densities of all
samples therefore sees more evidence than there is, and sees ever more of it the higher the sampling rate.
What does not repeat are the demonstrations, so their spread measures the true evidence, as in survey sampling
(Kish, "Survey Sampling", 1965, the design effect) and in cluster-robust covariances (Liang and Zeger,
Biometrika 73, 1986).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.expectation_maximization import BLOCK
from skill.clustering.gaussian_components import (
    GaussianComponents,
    QuadraticFeatures,
    log_density_coefficients,
    precision_factors,
)


def design_effect(Z: Array, components: GaussianComponents, groups: NDArray[np.intp]) -> float:
    """How many times larger the variance of the parameters is than it were if the samples were independent.

    With s_kjt the score (derivative of the log-likelihood) of parameter k at sample t of demonstration j, in
    units of its standard deviation, this is the mean over the parameters of sum_j (sum_t s_kjt)^2 / sum_jt 1,
    that is tr(H^-1 J) / K with H the information of one sample and J the variance of the demonstrations'
    summed scores. It is 1 for independent samples and as large as the length of a visit if nothing changes
    during the visit.

    For a Gaussian the standardised scores are w = R'(z - v) for the mean and (w w' - I) / sqrt(2) for the
    covariance, both weighted by the posterior, so that only the group's weighted moments are needed.

    Args:
        Z: samples, shape (N, d).
        components: M Gaussians, fitted to Z.
        groups: shape (N,), the demonstration of each sample, at least two different ones.

    Returns:
        The design effect, at least 1.
    """
    d = Z.shape[1]
    M = len(components)
    features = QuadraticFeatures(d)
    C = log_density_coefficients(components, features)
    R = precision_factors(components.covariances)
    identity = np.eye(d)
    order = np.argsort(groups, kind="stable")
    starts = np.flatnonzero(np.diff(groups[order])) + 1
    squares = np.zeros(M)
    cardinalities = np.zeros(M)
    segments = np.split(order, starts)
    for rows in segments:
        sums = np.zeros((M, features.size))
        for start in range(0, len(rows), BLOCK):
            phi = features.transform(Z[rows[start : start + BLOCK]])
            H = C @ phi
            H -= H.max(axis=0)
            np.exp(H, out=H)
            H /= H.sum(axis=0)
            sums += H @ phi.T
        totals, means, covariances = features.moments(sums)
        shift = means - components.means
        mean_score = totals[:, None] * np.einsum("mab,ma->mb", R, shift)
        spread = covariances + shift[:, :, None] * shift[:, None, :]
        covariance_score = totals[:, None, None] * (R.transpose(0, 2, 1) @ spread @ R - identity)
        squares += np.square(mean_score).sum(axis=1) + 0.5 * np.square(covariance_score).sum(axis=(1, 2))
        cardinalities += totals
    parameters = d + d * (d + 1) // 2
    # The scores of all demonstrations sum to zero at the maximum, which hides one of them.
    unbiased = len(segments) / (len(segments) - 1)
    return max(1.0, unbiased * float(np.mean(squares / np.maximum(cardinalities, 1.0))) / parameters)
