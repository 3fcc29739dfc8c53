"""Paired comparison of two policies on the same trials: change of the median, its interval, and Wilcoxon's test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import wilcoxon

RESAMPLES = 10_000
LEVEL = 0.95
"""Level of the interval."""


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
    if a.ndim != 1 or a.shape != b.shape or len(a) < 2:
        raise ValueError(f"before has shape {a.shape} and after {b.shape}; expected both (n,) with n at least 2")
    if not (np.isfinite(a).all() and np.isfinite(b).all() and (a > 0).all()):
        raise ValueError("before and after: expected finite numbers, and positive ones before")
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
