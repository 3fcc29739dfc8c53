"""Selection of the feature scale of a locally weighted regression, by cross-validation over demonstrations.

Samples of one demonstration resemble their neighbours in time: if they were left out one by one, each would be
predicted from its neighbours. Demonstrations are therefore left out as a whole: the error is that on new ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import GroupKFold

from skill.arrays import Array
from skill.regression.locally_weighted_regression import LWRegressor

FOLDS = 5
"""Number of folds of the cross-validation over demonstrations."""

MIN_GAIN = 1e-3
"""Minimum relative decrease of the error for which the scale of a feature is changed."""

MAX_PASSES = 4
"""Maximum number of passes over all features."""

MAX_QUERIES = 1000
"""Maximum number of left-out samples used for the error, drawn at random."""


@dataclass(frozen=True)
class FeatureScaleSelection:
    """The selected feature scale.

    Attributes:
        feature_scale: (d,), for a regressor with the same bandwidth as the one that was given.
        error: normalised mean squared error with this scale. The error of each output is divided by its variance, so
            that units do not matter; the overall mean has the error 1.
        initial_error: normalised mean squared error with the initial scale.
        evaluations: number of scales evaluated.
    """

    feature_scale: Array
    error: float
    initial_error: float
    evaluations: int


def select_feature_scale(
    regressor: LWRegressor,
    X: Array,
    Y: Array,
    groups: NDArray[np.intp],
    *,
    memberships: Array,
    random_state: int | None = 0,
) -> FeatureScaleSelection:
    """Selects the scale of each feature by coordinate descent on the error on left-out groups.

    Each pass multiplies or divides the scale of each feature in turn by a factor, where that lowers the error. The
    factor starts at 2 and is replaced by its square root after a pass without gain. The scale of useless features
    shrinks. The resulting error is optimistic, because it was minimised: evaluate on other groups.

    Args:
        regressor: regressor with the initial feature scale and all other parameters; it is not changed.
        X: (n, d), features.
        Y: (n, p), outputs.
        groups: (n,), the demonstration of each sample; at least ``FOLDS``.
        memberships: (n, K), contact-state probabilities.
        random_state: seed of the draw of the left-out samples.
    """
    chosen = np.ones(len(X), dtype=bool)
    if len(X) > MAX_QUERIES:
        chosen[:] = False
        chosen[np.random.default_rng(random_state).choice(len(X), MAX_QUERIES, replace=False)] = True
    split = ((train, test[chosen[test]]) for train, test in GroupKFold(FOLDS).split(X, groups=groups))
    folds = [(train, test) for train, test in split if len(test)]
    variance = Y.var(axis=0)
    variance[variance == 0.0] = np.inf  # an output that does not vary has no error
    scale = clone(regressor).fit(X, Y, memberships).feature_scale_
    evaluations = 0

    def error_of(trial: Array) -> float:
        nonlocal evaluations
        evaluations += 1
        model, errors = clone(regressor).set_params(feature_scale=trial), []
        for train, test in folds:
            model.fit(X[train], Y[train], memberships[train])
            squares = (model.predict(X[test], memberships[test]) - Y[test]) ** 2
            errors.append((squares.mean(axis=0) / variance).mean())
        return float(np.mean(errors))

    best = initial = error_of(scale)
    factor = 2.0
    for _ in range(MAX_PASSES):
        gained = False
        for j in range(len(scale)):
            for change in (factor, 1.0 / factor):
                trial = scale.copy()
                trial[j] *= change
                error = error_of(trial)
                if error < best * (1.0 - MIN_GAIN):
                    scale, best, gained = trial, error, True
                    break
        if not gained:
            if factor < 1.5:
                break
            factor = np.sqrt(factor)
    return FeatureScaleSelection(scale, best, initial, evaluations)


def tuned_regressor(
    X: Array, Y: Array, groups: NDArray[np.intp], *, memberships: Array, random_state: int | None
) -> LWRegressor:
    """Returns the default regressor of a skill, not fitted; its feature scale predicts left-out demonstrations best.

    With fewer than ``FOLDS`` demonstrations, features are standardised.
    """
    regressor = LWRegressor(bandwidth=1.0, feature_scale="standard", ridge=1.0)
    if len(np.unique(groups)) >= FOLDS:
        selected = select_feature_scale(regressor, X, Y, groups, memberships=memberships, random_state=random_state)
        regressor.set_params(feature_scale=selected.feature_scale)
    return regressor
