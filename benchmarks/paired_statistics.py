"""Intervals and paired tests of the benchmarks."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

RESAMPLES, EXACT = 10_000, 14


def wilson(successes: int, n: int) -> tuple[float, float]:
    """95 % confidence interval of a probability (Wilson, Journal of the American Statistical Association 22, 1927)."""
    interval = binomtest(successes, n).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar(a: Sequence[dict[str, Any]], b: Sequence[dict[str, Any]]) -> float:
    """p-value of the exact test that two policies insert equally often in the trials that both performed.

    Only the trials in which one of them fails count (McNemar, Psychometrika 12, 1947).
    """
    other = {row["seed"]: row["inserted"] for row in b}
    pairs = [(row["inserted"], other[row["seed"]]) for row in a if row["seed"] in other]
    better, worse = sum(x and not y for x, y in pairs), sum(y and not x for x, y in pairs)
    return float(binomtest(better, better + worse).pvalue) if better + worse else 1.0


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
    if len(found) <= EXACT:
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(found))))
        return float((np.abs(signs @ found) >= abs(found.sum()) - 1e-9).mean())
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), (RESAMPLES, len(found)))
    return float((1 + (np.abs(signs @ found) >= abs(found.sum()) - 1e-9).sum()) / (1 + RESAMPLES))
