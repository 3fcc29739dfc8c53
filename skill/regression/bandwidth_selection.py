"""Selection of the bandwidth and the feature scale of a locally weighted regression, by cross-validation.

Whole groups, the demonstrations, are left out together. Samples of one demonstration resemble their neighbours in time:
if they were left out one by one, each would be predicted from its neighbours, and the narrowest bandwidth would be
selected. The error over groups is the error on new demonstrations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.model_selection import GroupKFold

from skill.arrays import Array
from skill.regression.leave_one_out import candidate_bandwidths, searched
from skill.regression.locally_weighted_regression import LWRegressor

FOLDS = 5
"""Number of folds of the cross-validation over demonstrations; at most one for each demonstration."""

MIN_GAIN = 1e-3
"""Minimum relative decrease of the error for which the scale of a feature is changed."""

MAX_PASSES = 4
"""Maximum number of passes over all features."""

Fold = tuple[NDArray[np.intp], NDArray[np.intp]]


@dataclass(frozen=True)
class BandwidthSelection:
    """The selected bandwidth, and the errors of all candidates.

    Attributes:
        bandwidth: the selected bandwidth.
        bandwidths: (B,), the candidates, ascending.
        errors: (B,), normalised mean squared error, averaged over the folds. The error of each output is divided by its
            variance, so that units do not matter; the overall mean has the error 1.
    """

    bandwidth: float
    bandwidths: Array
    errors: Array


@dataclass(frozen=True)
class FeatureScaleSelection:
    """The selected feature scale.

    Attributes:
        feature_scale: (d,), for an `LWRegressor` with the same bandwidth as the one that was given.
        error: normalised mean squared error with this scale.
        initial_error: normalised mean squared error with the initial scale.
        evaluations: number of scales evaluated.
    """

    feature_scale: Array
    error: float
    initial_error: float
    evaluations: int


def select_bandwidth(regressor: LWRegressor, X: ArrayLike, y: ArrayLike, groups: ArrayLike) -> BandwidthSelection:
    """Selects the bandwidth with the minimum error on left-out groups.

    The candidates are `default_bandwidths`, which go on while the best is the first or the last.

    Args:
        regressor: regressor with all other parameters; it is not changed.
        X: (n, d).
        y: (n,) or (n, p).
        groups: (n,), the demonstration of each sample.

    Raises:
        ValueError: if there are fewer than two groups, or a shape is wrong.
    """
    data = GroupedSamples.checked(X, y, groups, None)
    template = clone(regressor).set_params(bandwidth=1.0)  # any number: fits with "auto" would select one in vain
    # The neighbour index does not depend on the bandwidth, so one fit of a fold serves all candidates.
    models = [data.fit(clone(template), train) for train, _ in data.folds]

    def error_of(bandwidth: float) -> float:
        return float(
            np.mean(
                [
                    data.error(model.set_params(bandwidth=bandwidth), test)
                    for model, (_, test) in zip(models, data.folds, strict=True)
                ]
            )
        )

    initial = default_bandwidths(data.fit(clone(template), np.arange(len(data.X))))
    candidates, errors = searched(initial, lambda bandwidths: np.array([error_of(float(h)) for h in bandwidths]))
    return BandwidthSelection(float(candidates[errors.argmin()]), candidates, errors)


def select_feature_scale(
    regressor: LWRegressor,
    X: ArrayLike,
    y: ArrayLike,
    groups: ArrayLike,
    *,
    memberships: ArrayLike | None = None,
    max_queries: int = 1000,
    random_state: int = 0,
) -> FeatureScaleSelection:
    """Selects the scale of each feature by coordinate descent on the error on left-out groups.

    Each pass multiplies or divides the scale of each feature in turn by a factor, where that lowers the error. The
    factor starts at 2 and is replaced by its square root after a pass without gain. The scale of useless features
    shrinks. The resulting error is optimistic, because it was minimised: evaluate on other groups.

    Args:
        regressor: regressor with the initial feature scale and all other parameters; it is not changed. A bandwidth
            "auto" is selected once, for the initial scale.
        X: (n, d).
        y: (n,) or (n, p).
        groups: (n,), the demonstration of each sample.
        memberships: (n, K), see `LWRegressor`.
        max_queries: maximum number of left-out samples used for the error, drawn at random.
        random_state: seed of the draw.

    Raises:
        ValueError: if there are fewer than two groups, or a shape is wrong.
    """
    data = GroupedSamples.checked(X, y, groups, memberships)
    if max_queries < len(data.X):
        data = data.thinned(max_queries, random_state)
    template = clone(regressor)
    fitted = data.fit(clone(regressor), np.arange(len(data.X)))
    if fitted.get_params().get("bandwidth") == "auto":
        template.set_params(bandwidth=fitted.bandwidth_)
    scale = fitted.feature_scale_.copy()
    evaluations = 0

    def error_of(trial: Array) -> float:
        nonlocal evaluations
        evaluations += 1
        model = clone(template).set_params(feature_scale=trial)
        return float(np.mean([data.error(data.fit(model, train), test) for train, test in data.folds]))

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


def default_bandwidths(fitted: LWRegressor) -> Array:
    """The candidates (12,) for a fitted regressor; see `candidate_bandwidths`."""
    return candidate_bandwidths(fitted.X_, fitted.numbers())


@dataclass(frozen=True)
class GroupedSamples:
    """Checked samples, and folds of whole groups.

    Attributes:
        X: (n, d), features.
        y: (n, p), outputs.
        P: (n, K), contact-state probabilities, or None.
        folds: rows of the training samples and of the left-out samples, for each fold.
        variance: (p,), variance of each output.
    """

    X: Array
    y: Array
    P: Array | None
    folds: list[Fold]
    variance: Array

    @classmethod
    def checked(cls, X: ArrayLike, y: ArrayLike, groups: ArrayLike, memberships: ArrayLike | None) -> GroupedSamples:
        """Checks the samples and makes the folds; raises ValueError if they are not valid."""
        samples, outputs, names = np.asarray(X, float), np.asarray(y, float), np.asarray(groups)
        outputs = outputs.reshape(len(outputs), -1)
        if samples.ndim != 2 or not len(samples) == len(outputs) == len(names) or names.ndim != 1:
            raise ValueError(
                f"X {samples.shape}, y {np.shape(y)}, groups {names.shape}; expected (n, d), (n[, p]), (n,)"
            )
        n_groups = len(np.unique(names))
        if n_groups < 2:
            raise ValueError(
                f"{n_groups} groups; cross-validation over demonstrations needs at least two:"
                " record more demonstrations, or set the bandwidth by hand"
            )
        folds = list(GroupKFold(min(FOLDS, n_groups)).split(samples, groups=names))
        P = None if memberships is None else np.asarray(memberships, float)
        return cls(samples, outputs, P, folds, outputs.var(axis=0))

    def thinned(self, n_queries: int, seed: int) -> GroupedSamples:
        """Keeps ``n_queries`` of the left-out samples, drawn at random, and all training samples."""
        chosen = np.zeros(len(self.X), dtype=bool)
        chosen[np.random.default_rng(seed).choice(len(self.X), n_queries, replace=False)] = True
        folds = [(train, test[chosen[test]]) for train, test in self.folds]
        return replace(self, folds=[fold for fold in folds if len(fold[1])])

    def fit(self, model: LWRegressor, rows: NDArray[np.intp]) -> LWRegressor:
        """Fits a model to the given rows and returns it."""
        P = None if self.P is None else self.P[rows]
        return model.fit(self.X[rows], self.y[rows], memberships=P)

    def error(self, model: LWRegressor, rows: NDArray[np.intp]) -> float:
        """Normalised mean squared error at left-out rows; ignores outputs that do not vary."""
        P = None if self.P is None else self.P[rows]
        squares = (np.asarray(model.predict(self.X[rows], P)).reshape(len(rows), -1) - self.y[rows]) ** 2
        varies = self.variance > 0
        if not varies.any():
            return 0.0
        return float((squares.mean(axis=0)[varies] / self.variance[varies]).mean())


def tuned_regressor(
    X: Array, Y: Array, groups: NDArray[np.intp], *, memberships: Array, random_state: int
) -> LWRegressor:
    """Returns the default regressor of a skill, not fitted; its feature scale predicts left-out demonstrations best.

    With fewer than ``FOLDS`` demonstrations, features are standardised.
    """
    regressor = LWRegressor(bandwidth=1.0, feature_scale="standard", ridge=1.0)
    if len(np.unique(groups)) >= FOLDS:
        selected = select_feature_scale(regressor, X, Y, groups, memberships=memberships, random_state=random_state)
        regressor.set_params(feature_scale=selected.feature_scale)
    return regressor
