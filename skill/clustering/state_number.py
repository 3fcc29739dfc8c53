"""Choice of the number of states by the Bayesian information criterion (BIC) at the effective sample size.

For independent samples, the number of states minimises -2 log L + K log N with K = M T + M - 1 parameters.

For demonstrations, log L and N are divided by the design effect tau, the number of samples that carry the information
of one independent sample (`skill.clustering.effective_sample_size`). Tau depends on the model under which it is
measured, because the part of the motion that a coarse model leaves unexplained is correlated. Therefore numbers are
compared in pairs. The smaller number M' is the null hypothesis, and tau is measured under it. The larger number M is
rejected unless

    2 (log L_M - log L_M') / tau_M' > (K_M - K_M') log(N / tau_M').

The search starts from the largest number and stops at the first that is not rejected. The result does not grow with
the sampling rate, because both sides of the inequality depend on the effective sample size only.

This number is that of components each of which is a state. If sets of components are to be the states
(`skill.clustering.component_sets`), the components need only describe the density, and too few do more harm than too
many: a component that covers parts of two states cannot be divided afterwards. Their number minimises the information
criterion of Akaike, which looks for the best description and not for the true number, -2 log L / tau + 2 K, with one
design effect for all numbers, the median of those under each.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.cluster_merging import Mixture
from skill.clustering.effective_sample_size import design_effect


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

    Args:
        candidates: mixture of maximum likelihood for each number of components.
        T: number of parameters of one component.
        Z: samples, shape (N, d).
        groups: shape (N,), demonstration of each sample; at least two demonstrations.
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
