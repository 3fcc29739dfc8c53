"""Before against after on the same trials: the change of the median, its interval, and whether it may be chance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import wilcoxon

RESAMPLES = 10_000


@dataclass(frozen=True)
class PairedChange:
    """Of one quantity over n trials, each made twice.

    Attributes:
        before: median.
        after: median.
        change: after / before - 1, of the medians; negative where it fell.
        lower: end of the interval of ``change``.
        upper: the other end.
        p_value: of Wilcoxon's signed-rank test, two-sided, that the differences are centred on zero.
    """

    before: float
    after: float
    change: float
    lower: float
    upper: float
    p_value: float


def paired_change(before: ArrayLike, after: ArrayLike, *, level: float = 0.95, random_state: int = 0) -> PairedChange:
    """Compares medians by a bootstrap over the trials, both measurements of a trial drawn together.

    Args:
        before: (n,), positive.
        after: (n,), of the same trials in the same order.
        level: of the percentile interval.
        random_state: of the bootstrap.

    Raises:
        ValueError: if the shapes differ, there are fewer than two trials, or a number before is not positive.
    """
    a, b = np.asarray(before, dtype=float), np.asarray(after, dtype=float)
    if a.ndim != 1 or a.shape != b.shape or len(a) < 2:
        raise ValueError(f"before has shape {a.shape} and after {b.shape}; expected (n,) both, n at least 2")
    if not (np.isfinite(a).all() and np.isfinite(b).all() and (a > 0).all()):
        raise ValueError("before and after: expected finite numbers, those before positive")
    drawn = np.random.default_rng(random_state).integers(len(a), size=(RESAMPLES, len(a)))
    ratios = np.median(b[drawn], axis=1) / np.median(a[drawn], axis=1) - 1.0
    lower, upper = np.quantile(ratios, [0.5 * (1.0 - level), 0.5 * (1.0 + level)])
    middle = float(np.median(a)), float(np.median(b))
    same = np.array_equal(a, b)  # of nothing but ties Wilcoxon's test knows no probability
    return PairedChange(
        before=middle[0],
        after=middle[1],
        change=middle[1] / middle[0] - 1.0,
        lower=float(lower),
        upper=float(upper),
        p_value=1.0 if same else float(wilcoxon(a, b).pvalue),
    )
