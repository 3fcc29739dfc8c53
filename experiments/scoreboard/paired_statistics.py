"""Intervals and paired tests of the benchmarks and of the scoreboard.

What differs from one set of demonstrations to the next counts, not only what differs from trial to trial: another
person teaches another skill. A test flips signs of means over the trials of a set (Gail, Mark, Carroll, Green and Pee,
Statistics in Medicine 15, 1996); an interval takes the sets as the clusters of a sample of trials.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm, t, wilcoxon

RESAMPLES, EXACT = 10_000, 14
LEVEL = 0.95
"""Level of the interval of a `PairedChange`."""
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


@dataclass(frozen=True)
class PairedChange:
    """Change of one quantity over n trials, each performed before and after.

    Attributes:
        before: median before.
        after: median after.
        change: after / before - 1, from the medians; negative for a decrease.
        lower: lower end of the percentile interval of ``change``.
        upper: upper end of the percentile interval of ``change``.
        p_value: two-sided p-value of Wilcoxon's signed-rank test; the null hypothesis is that the differences are
            centred on zero.
    """

    before: float
    after: float
    change: float
    lower: float
    upper: float
    p_value: float


def paired_change(before: ArrayLike, after: ArrayLike) -> PairedChange:
    """Compares two medians with a bootstrap over trials, which resamples both measurements of a trial together.

    Args:
        before: (n,), positive.
        after: (n,), of the same trials in the same order.

    Raises:
        ValueError: if the shapes differ, there are fewer than two trials, a number is NaN or infinite, or a number
            before is not positive.
    """
    a, b = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    is_comparable = a.shape == b.shape and a.ndim == 1 and len(a) > 1 and np.isfinite([a, b]).all() and (a > 0).all()
    if not is_comparable:
        raise ValueError(f"before {a} and after {b}: expected at least two finite numbers each, those before positive")
    drawn = np.random.default_rng(0).integers(len(a), size=(RESAMPLES, len(a)))
    ratios = np.median(b[drawn], axis=1) / np.median(a[drawn], axis=1) - 1.0
    lower, upper = np.quantile(ratios, [0.5 * (1.0 - LEVEL), 0.5 * (1.0 + LEVEL)])
    median_before, median_after = float(np.median(a)), float(np.median(b))
    same = np.array_equal(a, b)  # Wilcoxon's test is not defined if all differences are zero
    return PairedChange(
        before=median_before,
        after=median_after,
        change=median_after / median_before - 1.0,
        lower=float(lower),
        upper=float(upper),
        p_value=1.0 if same else float(wilcoxon(a, b).pvalue),
    )
