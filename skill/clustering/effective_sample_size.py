"""Effective sample size of a set of demonstrations.

Consecutive samples of a trajectory repeat each other. Within a state, the offset, the tilt and the axis of one
demonstration hardly change, however high the sampling rate is. A likelihood that multiplies the densities of all
samples therefore overestimates the evidence, and the more so the higher the sampling rate is. Demonstrations are
independent of each other, so their spread measures the true evidence, as in survey sampling (Kish, "Survey Sampling",
1965: the design effect) and in cluster-robust covariances (Liang and Zeger, Biometrika 73, 1986).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.expectation_maximization import MixtureDensities, e_step
from skill.clustering.gaussian_components import GaussianComponents, parameters_per_component, precision_factors
from skill.clustering.student_tails import score_variances
from skill.sequences import sequences


def design_effect(Z: Array, components: GaussianComponents, groups: NDArray[np.intp]) -> float:
    """Returns the variance of the parameters relative to their variance if all samples were independent.

    Let s_kjt be the score (derivative of the log-likelihood) of parameter k at sample t of demonstration j, divided
    by its standard deviation. The design effect is the mean over the parameters of sum_j (sum_t s_kjt)^2 / sum_jt 1.
    This equals tr(H^-1 J) / K for K parameters, where H is the information of one sample and J the variance of the
    summed scores of a demonstration. It is 1 for independent samples, and equal to the length of a visit if nothing
    changes during the visit. The scores of all J demonstrations sum to zero at the maximum of the likelihood; the
    factor J / (J - 1) corrects the resulting bias.

    For a Gaussian, the standardised scores are y = R'(z - v) for the mean and (y y' - I) / sqrt(2) for the covariance,
    both weighted by the posterior. For a Student distribution they are w y and (w y y' - I) / sqrt(2), with the
    weight w of the sample, divided by the square roots of `score_variances`. They need only the weighted moments of
    each demonstration.

    Args:
        Z: samples, shape (N, d).
        components: M Gaussians or Student distributions, fitted to Z.
        groups: shape (N,), demonstration of each sample; at least two demonstrations.

    Returns:
        The design effect, at least 1.
    """
    d = Z.shape[1]
    M = len(components)
    densities = MixtureDensities(components)
    R = precision_factors(components.covariances)
    identity = np.eye(d)
    usual, of_diagonal = score_variances(d, components.degrees)
    demonstrations = list(sequences(groups))
    squares = np.zeros(M)
    cardinalities = np.zeros(M)
    for rows in demonstrations:
        sums = np.zeros((M, densities.features.size))
        counts = np.zeros(M)
        for phi, posteriors, _, weights in e_step(Z[rows], densities):
            counts += posteriors.sum(axis=1)
            sums += (posteriors if weights is None else posteriors * weights) @ phi.T
        totals, means, covariances = densities.features.moments(sums)
        shift = means - components.means
        mean_score = totals[:, None] * np.einsum("mab,ma->mb", R, shift)
        spread = totals[:, None, None] * (covariances + shift[:, :, None] * shift[:, None, :])
        covariance_score = R.transpose(0, 2, 1) @ spread @ R - counts[:, None, None] * identity
        diagonal = np.square(np.einsum("mdd->md", covariance_score)).sum(axis=1)
        off_diagonal = np.square(covariance_score).sum(axis=(1, 2)) - diagonal
        squares += (np.square(mean_score).sum(axis=1) + 0.5 * off_diagonal) / usual + 0.5 * diagonal / of_diagonal
        cardinalities += counts
    parameters = parameters_per_component(d, diagonal=False)
    unbiased = len(demonstrations) / (len(demonstrations) - 1)
    return float(max(1.0, unbiased * float(np.mean(squares / np.maximum(cardinalities, 1.0))) / parameters))
