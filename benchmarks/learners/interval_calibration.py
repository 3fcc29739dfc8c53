"""Prediction intervals that hold on new demonstrations.

The intervals of a local model come from the residuals around it: they know noise, but neither the bias of smoothing
nor what differs from one demonstration to the next. On outputs with little noise that is most of the error.
Predictions of left-out demonstrations tell how much too narrow (or wide) the intervals are, and one factor per
output puts that right: conformal prediction with normalised scores, cross-validated over groups.

Source: Lei, G'Sell, Rinaldo, Tibshirani, Wasserman, "Distribution-free predictive inference for regression", JASA
113, 2018, section 5.2; Barber, Candes, Ramdas, Tibshirani, "Predictive inference with the jackknife+", Annals of
Statistics 49, 2021, for left-out folds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone

from skill.arrays import Array
from skill.regression.bandwidth_selection import GroupedSamples
from skill.regression.local_model import LocalPrediction
from skill.regression.locally_weighted_regression import LWRegressor


def conformal_factors(
    regressor: LWRegressor,
    X: ArrayLike,
    y: ArrayLike,
    groups: ArrayLike,
    *,
    level: float = 0.95,
    memberships: ArrayLike | None = None,
    n_splits: int = 5,
) -> Array:
    """Standard deviations on either side that cover left-out demonstrations.

    Coverage is that of the average sample of a new demonstration; single demonstrations may fare better or worse.

    Args:
        regressor: all settings are taken from it; it is not changed.
        X: (n, d).
        y: (n,) or (n, p).
        groups: (n,), the demonstration of each sample.
        level: nominal coverage.
        memberships: (n, K), see ``LWRegressor``.
        n_splits: folds, at most the number of groups.

    Returns:
        (p,) factors for ``conformal_interval``.

    Raises:
        ValueError: if ``level`` is not within (0, 1) or there are fewer than two groups.
    """
    if not 0.0 < level < 1.0:
        raise ValueError(f"level = {level}; expected a probability between 0 and 1, such as 0.95")
    data = GroupedSamples.checked(X, y, groups, memberships, None, n_splits)
    scores = np.empty_like(data.y)
    for train, test in data.folds:
        model = data.fit(clone(regressor), train)
        local = model.predict_local(data.X[test], None if data.P is None else data.P[test])
        deviation = local.standard_deviation()
        residual = np.abs(local.mean - data.y[test])
        # Where neither varies the score is zero; where only the residual does, nothing finite would cover it.
        scores[test] = np.divide(residual, deviation, out=np.zeros_like(residual), where=deviation > 0)
    n = len(scores)
    rank = min(1.0, np.ceil((n + 1) * level) / n)
    factors: Array = np.quantile(scores, rank, axis=0, method="higher")
    return factors


def conformal_interval(local: LocalPrediction, factors: ArrayLike) -> tuple[Array, Array]:
    """Bounds (lower, upper), each (m, p), at the level that the factors (p,) were made for."""
    half = np.asarray(factors, dtype=float) * local.standard_deviation()
    return local.mean - half, local.mean + half
