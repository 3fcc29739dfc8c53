"""Calibration of prediction intervals, so that they have the nominal coverage on new demonstrations.

The interval of a local model is computed from the residuals around it. It contains the noise, but neither the bias of
smoothing nor the differences between demonstrations. On outputs with little noise these are most of the error.
Predictions of left-out demonstrations show by how much the intervals are too narrow or too wide, and one factor per
output corrects this: conformal prediction with normalised scores, cross-validated over groups.

Sources: Lei, G'Sell, Rinaldo, Tibshirani, Wasserman, "Distribution-free predictive inference for regression", JASA
113, 2018, section 5.2; for left-out folds Barber, Candes, Ramdas, Tibshirani, "Predictive inference with the
jackknife+", Annals of Statistics 49, 2021.
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
    """Half widths of the interval, in standard deviations, that cover the samples of left-out demonstrations.

    The coverage is an average over the samples of new demonstrations; that of a single demonstration may differ.

    Args:
        regressor: the regressor to calibrate; it is cloned, not changed.
        X: (n, d), inputs.
        y: (n,) or (n, p), outputs.
        groups: (n,), number of the demonstration of each sample.
        level: nominal coverage, between 0 and 1.
        memberships: (n, K), see ``LWRegressor``.
        n_splits: number of folds; at most the number of groups are used.

    Returns:
        The factors (p,) for ``conformal_interval``.

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
        # The score is zero where the deviation is zero: no finite factor would cover a residual there.
        scores[test] = np.divide(residual, deviation, out=np.zeros_like(residual), where=deviation > 0)
    n = len(scores)
    rank = min(1.0, np.ceil((n + 1) * level) / n)
    factors: Array = np.quantile(scores, rank, axis=0, method="higher")
    return factors


def conformal_interval(local: LocalPrediction, factors: ArrayLike) -> tuple[Array, Array]:
    """Lower and upper bound, each (m, p), at the level for which the factors (p,) were computed."""
    half = np.asarray(factors, dtype=float) * local.standard_deviation()
    return local.mean - half, local.mean + half
