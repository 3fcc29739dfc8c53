"""How many states the evidence supports: the Bayesian information criterion at the effective sample size.

Independent samples: the number of least criterion -2 log L + K log N, with K = M T + M - 1 parameters.

Demonstrations: log L and N are both divided by the design effect tau, the number of samples that count as one
(`skill.clustering.effective_sample_size`). It depends on the model it is measured under, since what a coarse model
leaves unexplained is correlated; so numbers are compared in pairs, each larger one against the next smaller
as the null hypothesis, with the tau measured under that null: the state is given up unless

    2 (log L_M - log L_M') / tau_M' > (K_M - K_M') log(N / tau_M').

Starting from the most and giving up states while the evidence does not support them stops at a number that
does not grow with the sampling rate: both sides of the inequality only know the effective sample size.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.cluster_merging import Mixture
from skill.clustering.effective_sample_size import design_effect


def mixture_parameters(M: int, T: int) -> int:
    """Free parameters of M components of T parameters each and their weights."""
    return M * T + M - 1


def bayesian_information_criterion(log_likelihood: float, M: int, T: int, N: int, design_effect: float = 1.0) -> float:
    """-2 log L / tau + K log(N / tau), in nats of independent evidence; smaller is better."""
    K = mixture_parameters(M, T)
    return -2.0 * log_likelihood / design_effect + K * float(np.log(max(N / design_effect, 2.0)))


def number_of_independent(candidates: dict[int, Mixture], T: int, N: int) -> int:
    """The number of components of least criterion, every sample counting in full."""
    criteria = {M: bayesian_information_criterion(mixture.log_likelihood, M, T, N) for M, mixture in candidates.items()}
    return min(criteria, key=criteria.__getitem__)


def number_of_demonstrated(
    candidates: dict[int, Mixture], T: int, Z: Array, groups: NDArray[np.intp]
) -> tuple[int, float]:
    """The number of components the demonstrations support, and the design effect under it.

    Args:
        candidates: the likeliest mixture of each number of components.
        T: parameters of one component.
        Z: samples, shape (N, d).
        groups: shape (N,), the demonstration of each sample, at least two different ones.
    """
    N = len(Z)
    numbers = sorted(candidates, reverse=True)
    for M, fewer in pairwise(numbers):
        tau = design_effect(Z, candidates[fewer].components, groups)
        with_state, without = (
            bayesian_information_criterion(candidates[m].log_likelihood, m, T, N, tau) for m in (M, fewer)
        )
        if with_state < without:
            return M, design_effect(Z, candidates[M].components, groups)
    last = numbers[-1]
    return last, design_effect(Z, candidates[last].components, groups)
