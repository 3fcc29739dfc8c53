"""Intervals and paired tests of the benchmarks and of the scoreboard.

What differs from one set of demonstrations to the next counts, not only what differs from trial to trial: another
person teaches another skill. A test flips signs of means over the trials of a set (Gail, Mark, Carroll, Green and Pee,
Statistics in Medicine 15, 1996); an interval takes the sets as the clusters of a sample of trials.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t

RESAMPLES, EXACT = 10_000, 14
MIN_UNITS = 6
"""Least number of units for which a flip of signs can reach 5 %: the least p of n differences is 2^(1-n)."""


def wilson(successes: float, n: float) -> tuple[float, float]:
    """95 % confidence interval of a probability (Wilson, Journal of the American Statistical Association 22, 1927)."""
    share, z2n = successes / n, float(norm.ppf(0.975)) ** 2 / n
    centre, half = share + z2n / 2.0, math.sqrt(z2n * (share * (1.0 - share) + z2n / 4.0))
    return max(0.0, (centre - half) / (1.0 + z2n)), min(1.0, (centre + half) / (1.0 + z2n))


def wilson_over_sets(successes: ArrayLike, trials: ArrayLike) -> tuple[float, float]:
    """95 % confidence interval of a probability that differs from set to set.

    It is Wilson's for the effective number of trials: as many independent ones as would vary as the shares of the sets
    do, reduced for the degrees of freedom of few sets (Korn and Graubard, Survey Methodology 24, 1998; with Wilson's
    interval: Franco, Little, Louis and Slud, Journal of Survey Statistics and Methodology 7, 2019).

    Args:
        successes: shape (k,), of each set, at least two.
        trials: shape (k,), of each set.
    """
    won, count = np.asarray(successes, dtype=float), np.asarray(trials, dtype=float)
    k, n = len(won), float(count.sum())
    share = float(won.sum()) / n
    variance = k / (k - 1) * float(((won - share * count) ** 2).sum()) / n**2
    effective = min(n, share * (1.0 - share) / variance) if variance > 0.0 else n
    effective *= float(norm.ppf(0.975) / t.ppf(0.975, k - 1)) ** 2
    return wilson(share * effective, effective)


def holm(p_values: Sequence[float]) -> list[float]:
    """Corrects p-values of several tests, so that the chance of any false positive stays below the level.

    The k-th smallest of n is multiplied by n - k + 1, and none is smaller than the one before it (Holm, Scandinavian
    Journal of Statistics 6, 1979).
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1)))
    return [float(value) for value in corrected]


def sign_flip_test(differences: ArrayLike, *, seed: int = 0) -> float:
    """Two-sided p-value of the hypothesis that the signs of independent differences are random.

    It is exact for up to ``EXACT`` differences that are not zero, and from ``RESAMPLES`` draws for more.
    """
    found = np.asarray(differences, dtype=float)
    found = found[found != 0]
    if len(found) == 0:
        return 1.0
    threshold = abs(found.sum()) - 1e-9
    if len(found) <= EXACT:
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(found))))
        return float((np.abs(signs @ found) >= threshold).mean())
    sums = np.random.default_rng(seed).choice((-1.0, 1.0), (RESAMPLES, len(found))) @ found
    return float((1 + (np.abs(sums) >= threshold).sum()) / (1 + RESAMPLES))
