"""Bandwidth and feature scaling for locally weighted regression, by cross-validation over whole
demonstrations.

Samples of one demonstration resemble their neighbours in time. Left out one by one, each is predicted from
its twin, and the narrowest bandwidth wins; so whole groups, the demonstrations, are left out together. The
error is that on new demonstrations, which is what a skill meets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.model_selection import GroupKFold

from skill.arrays import Array
from skill.regression.locally_weighted_regression import LWRegressor

Fold = tuple[NDArray[np.intp], NDArray[np.intp]]


@dataclass(frozen=True)
class BandwidthSelection:
    """The bandwidth chosen, and what it was chosen from.

    Attributes:
        bandwidth: the choice.
        bandwidths: (B,), the candidates, ascending.
        errors: (B,), mean over folds of the normalised mean squared error: each output's over its variance,
            so that outputs of different units count alike; 1 is the error of the overall mean.
        standard_errors: (B,), of these means, from the scatter between folds.
    """

    bandwidth: float
    bandwidths: Array
    errors: Array
    standard_errors: Array


@dataclass(frozen=True)
class FeatureScaleSelection:
    """The feature scale chosen.

    Attributes:
        feature_scale: (d,), to be given to ``LWRegressor`` with the bandwidth of the one that was passed in.
        error: normalised mean squared error there.
        initial_error: the error with the scale at the start.
        evaluations: how many scales were tried.
    """

    feature_scale: Array
    error: float
    initial_error: float
    evaluations: int


def select_bandwidth(
    regressor: LWRegressor,
    X: ArrayLike,
    y: ArrayLike,
    groups: ArrayLike,
    *,
    bandwidths: Sequence[float] | None = None,
    memberships: ArrayLike | None = None,
    sample_weight: ArrayLike | None = None,
    n_splits: int = 5,
    rule: str = "minimum",
) -> BandwidthSelection:
    """Chooses the bandwidth of least error on left-out groups.

    Args:
        regressor: everything but the bandwidth is taken from it; it is not changed.
        X: (n, d).
        y: (n,) or (n, p).
        groups: (n,), the demonstration of each sample.
        bandwidths: candidates; None for twelve from an eighth to four times the median distance to the
            farthest neighbour that enters (of the same multiples, if the kernel is adaptive).
        memberships: (n, K), see ``LWRegressor``.
        sample_weight: (n,), likewise; the errors are weighted by it too.
        n_splits: folds, at most the number of groups.
        rule: "minimum"; or "one_standard_error", the greatest bandwidth whose error is within one standard
            error of the least: smoother, where the data do not object (Breiman et al., "Classification and
            regression trees", 1984, section 3.4.3).

    Raises:
        ValueError: if there are fewer than two groups, a candidate is not positive or the rule is unknown.
    """
    if rule not in ("minimum", "one_standard_error"):
        raise ValueError(f"rule = {rule!r}; expected 'minimum' or 'one_standard_error'")
    data = GroupedSamples.checked(X, y, groups, memberships, sample_weight, n_splits)
    fitted = data.fit(clone(regressor), np.arange(len(data.X)))
    candidates = default_bandwidths(fitted) if bandwidths is None else np.sort(np.asarray(bandwidths, float))
    if candidates.size == 0 or not (np.isfinite(candidates).all() and candidates[0] > 0):
        raise ValueError(f"bandwidths = {bandwidths}; expected one or more positive numbers")
    errors = np.empty((len(data.folds), len(candidates)))
    for i, (train, test) in enumerate(data.folds):
        model = data.fit(clone(regressor), train)
        for j, bandwidth in enumerate(candidates):
            # The neighbour index knows nothing of the bandwidth, so one fit serves all.
            model.set_params(bandwidth=float(bandwidth))
            errors[i, j] = data.error(model, test)
    mean = errors.mean(axis=0)
    scatter = errors.std(axis=0, ddof=1) / np.sqrt(len(errors))
    best = int(mean.argmin())
    if rule == "one_standard_error":
        best = int(np.flatnonzero(mean <= mean[best] + scatter[best])[-1])
    return BandwidthSelection(float(candidates[best]), candidates, mean, scatter)


def select_feature_scale(
    regressor: LWRegressor,
    X: ArrayLike,
    y: ArrayLike,
    groups: ArrayLike,
    *,
    memberships: ArrayLike | None = None,
    sample_weight: ArrayLike | None = None,
    n_splits: int = 5,
    max_queries: int | None = 1000,
    min_gain: float = 1e-3,
    max_passes: int = 4,
    random_state: int = 0,
) -> FeatureScaleSelection:
    """Chooses the diagonal scaling of the features by coordinate descent on the error on left-out groups.

    Each feature's scale in turn is doubled or halved while that lowers the error; the factor shrinks to its
    square root after a pass without gain. Features that do not help shrink towards no influence, which is
    feature selection by degrees. The error so reached is optimistic, having been minimised: judge on other
    groups.

    Args:
        regressor: its feature scale is the start, its bandwidth is kept.
        X: (n, d).
        y: (n,) or (n, p).
        groups: (n,), the demonstration of each sample.
        memberships: (n, K), see ``LWRegressor``.
        sample_weight: (n,), likewise.
        n_splits: folds, at most the number of groups.
        max_queries: left-out samples used for the error, drawn at random; None for all.
        min_gain: relative lowering of the error below which a change is not worth it.
        max_passes: over all features.
        random_state: of the draw.
    """
    data = GroupedSamples.checked(X, y, groups, memberships, sample_weight, n_splits)
    if max_queries is not None and max_queries < len(data.X):
        data = data.thinned(max_queries, random_state)
    scale = data.fit(clone(regressor), np.arange(len(data.X))).feature_scale_.copy()
    evaluations = 0

    def error_of(trial: Array) -> float:
        nonlocal evaluations
        evaluations += 1
        model = clone(regressor).set_params(feature_scale=trial)
        return float(np.mean([data.error(data.fit(model, train), test) for train, test in data.folds]))

    best = initial = error_of(scale)
    factor = 2.0
    for _ in range(max_passes):
        gained = False
        for j in range(len(scale)):
            for change in (factor, 1.0 / factor):
                trial = scale.copy()
                trial[j] *= change
                error = error_of(trial)
                if error < best * (1.0 - min_gain):
                    scale, best, gained = trial, error, True
                    break
        if not gained:
            if factor < 1.5:
                break
            factor = np.sqrt(factor)
    return FeatureScaleSelection(scale, best, initial, evaluations)


def default_bandwidths(fitted: LWRegressor, n_queries: int = 100) -> Array:
    """Twelve candidates, from an eighth to four times the median radius of a neighbourhood."""
    multiples = np.geomspace(0.125, 4.0, 12)
    if fitted.bandwidth_type == "adaptive":
        return multiples
    queries = fitted.X_[:: max(1, len(fitted.X_) // n_queries)]
    k = len(fitted.X_) if fitted.n_neighbors is None else min(int(fitted.n_neighbors), len(fitted.X_))
    distances = np.linalg.norm(queries[:, None, :] - fitted.X_[None, :, :], axis=2)
    radius = float(np.median(np.partition(distances, k - 1, axis=1)[:, k - 1]))
    return multiples * (radius if radius > 0 else 1.0)


@dataclass(frozen=True)
class GroupedSamples:
    """Checked samples, folds of whole groups, and each output's variance."""

    X: Array
    y: Array
    P: Array | None
    weight: Array
    folds: list[Fold]
    variance: Array

    @classmethod
    def checked(
        cls,
        X: ArrayLike,
        y: ArrayLike,
        groups: ArrayLike,
        memberships: ArrayLike | None,
        sample_weight: ArrayLike | None,
        n_splits: int,
    ) -> GroupedSamples:
        """The samples, or a ValueError that says what is wrong with them."""
        samples, outputs, names = np.asarray(X, float), np.asarray(y, float), np.asarray(groups)
        outputs = outputs.reshape(len(outputs), -1)
        if samples.ndim != 2 or not len(samples) == len(outputs) == len(names) or names.ndim != 1:
            raise ValueError(
                f"X {samples.shape}, y {np.shape(y)}, groups {names.shape}; expected (n, d), (n[, p]), (n,)"
            )
        n_groups = len(np.unique(names))
        if n_groups < 2 or n_splits < 2:
            raise ValueError(
                f"{n_groups} groups and n_splits = {n_splits}; cross-validation over demonstrations needs at"
                " least two of each: record more demonstrations, or set the bandwidth by hand"
            )
        folds = list(GroupKFold(min(n_splits, n_groups)).split(samples, groups=names))
        weight = np.ones(len(samples)) if sample_weight is None else np.asarray(sample_weight, float)
        P = None if memberships is None else np.asarray(memberships, float)
        return cls(samples, outputs, P, weight, folds, outputs.var(axis=0))

    def thinned(self, n_queries: int, seed: int) -> GroupedSamples:
        """The same with ``n_queries`` samples left out in all: training samples all stay."""
        chosen = np.zeros(len(self.X), dtype=bool)
        chosen[np.random.default_rng(seed).choice(len(self.X), n_queries, replace=False)] = True
        folds = [(train, test[chosen[test]]) for train, test in self.folds]
        folds = [fold for fold in folds if len(fold[1])]
        return GroupedSamples(self.X, self.y, self.P, self.weight, folds, self.variance)

    def fit(self, model: LWRegressor, rows: NDArray[np.intp]) -> LWRegressor:
        """The model, fitted to the given rows."""
        P = None if self.P is None else self.P[rows]
        return model.fit(self.X[rows], self.y[rows], memberships=P, sample_weight=self.weight[rows])

    def error(self, model: LWRegressor, rows: NDArray[np.intp]) -> float:
        """Normalised mean squared error at left-out rows; outputs that never vary do not count."""
        P = None if self.P is None else self.P[rows]
        squares = (np.asarray(model.predict(self.X[rows], P)).reshape(len(rows), -1) - self.y[rows]) ** 2
        varies = self.variance > 0
        if not varies.any() or not self.weight[rows].any():
            return 0.0
        mean = np.average(squares, axis=0, weights=self.weight[rows])
        return float((mean[varies] / self.variance[varies]).mean())
