"""Intervals and paired tests of the benchmarks and of the scoreboard."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

from skill.arrays import Array

RESAMPLES, EXACT = 10_000, 14
MAX_DRAWS = 4_000_000
"""Largest number of signs that are drawn at once; 32 MB."""


def wilson(successes: int, n: int) -> tuple[float, float]:
    """95 % confidence interval of a probability (Wilson, Journal of the American Statistical Association 22, 1927)."""
    interval = binomtest(successes, n).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar(better: int, worse: int) -> float:
    """p-value of the exact test that two policies insert equally often in the trials that both performed.

    Only the trials in which one of them fails count (McNemar, Psychometrika 12, 1947).

    Args:
        better: number of trials in which only the one inserted.
        worse: number of trials in which only the other inserted.
    """
    return float(binomtest(better, better + worse).pvalue) if better + worse else 1.0


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


def over_sets(shares: Sequence[float], *, seed: int = 0) -> tuple[float, float, float]:
    """Mean of the shares of the sets, with the 95 % interval of a bootstrap over sets."""
    found = np.asarray(shares, dtype=float)
    means = np.random.default_rng(seed).choice(found, (RESAMPLES, len(found))).mean(axis=1)
    lower, upper = np.quantile(means, [0.025, 0.975])
    return float(found.mean()), float(lower), float(upper)


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
    sums = _flipped_sums(found, np.random.default_rng(seed))
    return float((1 + (np.abs(sums) >= threshold).sum()) / (1 + RESAMPLES))


def _flipped_sums(differences: Array, rng: np.random.Generator) -> Array:
    """The sums (RESAMPLES,) with random signs."""
    rows = max(1, MAX_DRAWS // len(differences))
    counts = [min(rows, RESAMPLES - start) for start in range(0, RESAMPLES, rows)]
    return np.concatenate([rng.choice((-1.0, 1.0), (count, len(differences))) @ differences for count in counts])
