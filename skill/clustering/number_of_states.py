"""Choice of the number of states by the Bayesian information criterion (BIC) at the effective sample size.

For independent samples, the number of states minimises -2 log L + K log N with K = M T + M - 1 parameters.

For demonstrations, log L and N are divided by the design effect tau, the number of samples that carry the information
of one independent sample (`design_effect`). Tau depends on the model under which it is measured, because the part of
the motion that a coarse model leaves unexplained is correlated. Therefore numbers are compared in pairs. The smaller
number M' is the null hypothesis, and tau is measured under it. The larger number M is rejected unless

    2 (log L_M - log L_M') / tau_M' > (K_M - K_M') log(N / tau_M').

The search starts from the largest number and stops at the first that is not rejected. The result does not grow with
the sampling rate, because both sides of the inequality depend on the effective sample size only.

This number is that of components each of which is a state. If sets of components are to be the states
(`skill.clustering.component_sets`), the components need only describe the density, and too few do more harm than too
many: a component that covers parts of two states cannot be divided afterwards. Their number minimises the information
criterion of Akaike, which looks for the best description and not for the true number, -2 log L / tau + 2 K, with one
design effect for all numbers, the median of those under each.

Consecutive samples of a trajectory repeat each other. Within a state, the offset, the tilt and the axis of one
demonstration hardly change, however high the sampling rate is. A likelihood that multiplies the densities of all
samples therefore overestimates the evidence, and the more so the higher the sampling rate is. Demonstrations are
independent of each other, so their spread measures the true evidence, as in survey sampling (Kish, "Survey Sampling",
1965: the design effect) and in cluster-robust covariances (Liang and Zeger, Biometrika 73, 1986).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array, sequences
from skill.clustering.component_merging import Mixture
from skill.clustering.expectation_maximization import posterior_blocks
from skill.clustering.gaussian_components import (
    GaussianComponents,
    MixtureDensities,
    precision_factors,
    score_variances,
)


def mixture_parameters(M: int, T: int) -> int:
    """Number of free parameters of M components with T parameters each, and of their weights."""
    return M * T + M - 1


def bayesian_information_criterion(log_likelihood: float, M: int, T: int, N: int, design_effect: float = 1.0) -> float:
    """Returns -2 log L / tau + K log(N / tau); smaller is better.

    Args:
        log_likelihood: log L of all samples, in nats.
        M: number of components.
        T: number of parameters of one component.
        N: number of samples.
        design_effect: tau. N / tau is raised to 2 if it is smaller.
    """
    K = mixture_parameters(M, T)
    return -2.0 * log_likelihood / design_effect + K * float(np.log(max(N / design_effect, 2.0)))


def number_of_independent(candidates: dict[int, Mixture], T: int, N: int) -> int:
    """Returns the number of components of minimum BIC for N independent samples; T as in the BIC."""
    criteria = {M: bayesian_information_criterion(mixture.log_likelihood, M, T, N) for M, mixture in candidates.items()}
    return min(criteria, key=criteria.__getitem__)


def number_for_density(candidates: dict[int, Mixture], T: int, Z: Array, groups: NDArray[np.intp]) -> tuple[int, float]:
    """Returns the number of components that describe the density, and the design effect under this mixture.

    The arguments are those of `number_of_demonstrated`.
    """
    effects = {M: design_effect(Z, mixture.components, groups) for M, mixture in candidates.items()}
    tau = float(np.median(list(effects.values())))
    criteria = {
        M: -2.0 * mixture.log_likelihood / tau + 2.0 * mixture_parameters(M, T) for M, mixture in candidates.items()
    }
    M = min(criteria, key=criteria.__getitem__)
    return M, effects[M]


def number_of_demonstrated(
    candidates: dict[int, Mixture], T: int, Z: Array, groups: NDArray[np.intp]
) -> tuple[int, float]:
    """Returns the number of components that the demonstrations support, and the design effect under this mixture.

    Args:
        candidates: mixture of maximum likelihood for each number of components.
        T: number of parameters of one component.
        Z: samples, shape (N, d).
        groups: shape (N,), demonstration of each sample; at least two demonstrations.
    """
    N = len(Z)
    numbers = sorted(candidates, reverse=True)
    for M, fewer in pairwise(numbers):
        tau = design_effect(Z, candidates[fewer].components, groups)
        larger, smaller = (
            bayesian_information_criterion(candidates[m].log_likelihood, m, T, N, tau) for m in (M, fewer)
        )
        if larger < smaller:
            break
    else:
        M = numbers[-1]
    return M, design_effect(Z, candidates[M].components, groups)


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
        for phi, posteriors, _, weights in posterior_blocks(Z[rows], densities):
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
    parameters = d + d * (d + 1) // 2
    unbiased = len(demonstrations) / (len(demonstrations) - 1)
    return float(max(1.0, unbiased * float(np.mean(squares / np.maximum(cardinalities, 1.0))) / parameters))
