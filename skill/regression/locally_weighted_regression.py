"""Locally weighted regression with contact states.

A linear model is fitted around each query to the nearest samples, weighted by distance and contact state.
"""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data

from skill.arrays import Array, standard_scale
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays
from skill.regression.leave_one_out import best_bandwidth
from skill.regression.local_model import (
    LocalPrediction,
    local_model,
    local_predictions,
    predictions_with_uncertainty,
)
from skill.regression.neighbourhood import RegressionNumbers, SearchNumbers, check_memberships, neighbourhood
from skill.regression.protocols import Explanation

MAX_QUERY = 1e100
"""Scaled queries are clipped to this magnitude, so that squared distances stay finite."""

RULES = {
    "bandwidth": ArrayRule(low=MIN_POSITIVE),
    "bandwidth_type": ArrayRule(holds="texts", choices=("fixed",)),
    "degree": ArrayRule(holds="integers", low=0, high=1),
    "ridge": ArrayRule(low=0.0),
    "n_neighbors": ArrayRule(holds="integers", low=-1),
    "feature_scale": ArrayRule(("d",), low=MIN_POSITIVE),
    "X": ArrayRule(("n", "d")),
    "y": ArrayRule(("n", "p")),
    "sample_weight": ArrayRule(("n",), positive=True),
    "rows": ArrayRule(("n",), holds="integers", low=0),
    "single_output": ArrayRule(holds="truth values"),
    "memberships": ArrayRule(("n", "K"), low=0.0, high=1.0 + 1e-6, optional=True),
    "feature_names": ArrayRule(("d",), holds="texts", optional=True),
}
"""The arrays of a stored `LWRegressor`: n samples, d features, p outputs, K contact states. ``n_neighbors`` is -1 for
all samples."""


class LWRegressor(RegressorMixin, BaseEstimator):
    """Locally weighted regression with one or more outputs; `fit` stores the samples.

    The kernel weight of sample i for query q is

        w_i = exp(-|m (x_i - q)|^2 / h^2) . s_i . sum_k Q_qk P_ik,

    with m the feature scale, h the bandwidth, s the sample weight, and P, Q the contact-state probabilities of samples
    and query. The last factor is the probability that both share their state. With one-hot P and Q each state has its
    own regressor; with P and Q from a classifier the regressors blend into each other.

    Args:
        bandwidth: h, in units of the scaled features. "auto" selects it in ``fit`` by the leave-one-out error of at
            most 500 samples, among candidates that go on while the best is the first or the last. Where samples
            resemble their neighbours in time, this is too narrow: leave out whole demonstrations, by scikit-learn's
            ``GroupKFold``.
        degree: 1 for the local linear model, 0 for the kernel mean.
        ridge: penalty on the squared slope, for scaled features and weights of at most 1; with the default scale it
            does not depend on the units of X.
        n_neighbors: number of nearest samples used; None for all. With memberships, these are the samples of greatest
            weight among the nearest of each state that the query may be in.
        feature_scale: m, (d,), positive; "standard" for the reciprocal standard deviation of each feature, one for a
            constant feature; None for ones.

    Attributes:
        X_: (n, d), the samples of positive weight, times ``feature_scale_``.
        y_: (n, p), their outputs.
        sample_weight_: (n,), their weights.
        bandwidth_: the bandwidth that is used; the selected one for "auto".
        rows_: (n,), their row numbers in the data given to ``fit``.
        memberships_: (n, K), their contact-state probabilities, or None.
        feature_scale_: (d,), the scale m.

    References:
        Atkeson, Moore, Schaal, "Locally weighted learning", Artificial Intelligence Review 11, 1997.
    """

    _parameter_constraints: dict[str, list[Any]] = {
        "bandwidth": [Interval(Real, 0, None, closed="neither"), StrOptions({"auto"})],
        "degree": [Interval(Integral, 0, 1, closed="both")],
        "ridge": [Interval(Real, 0, None, closed="left")],
        "n_neighbors": [Interval(Integral, 1, None, closed="left"), None],
        "feature_scale": [StrOptions({"standard"}), "array-like", None],
    }

    def __init__(
        self,
        bandwidth: float | str = "auto",
        *,
        degree: int = 1,
        ridge: float = 1e-2,
        n_neighbors: int | None = 200,
        feature_scale: ArrayLike | str | None = "standard",
    ) -> None:
        self.bandwidth = bandwidth
        self.degree = degree
        self.ridge = ridge
        self.n_neighbors = n_neighbors
        self.feature_scale = feature_scale

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        memberships: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
    ) -> Self:
        """Stores the samples and builds the index.

        Args:
            X: (n, d) features.
            y: (n,) or (n, p) outputs.
            memberships: (n, K), contact-state probabilities of the samples; rows sum to one.
            sample_weight: (n,), non-negative, multiplies the kernel; samples of weight zero are not stored.

        Raises:
            ValueError: if a parameter, a shape or a number is not valid, or memberships are not probabilities.
        """
        self._validate_params()
        checked: tuple[Array, Array] = validate_data(self, X, y, multi_output=True, y_numeric=True, dtype=np.float64)
        samples, outputs = checked[0], np.asarray(checked[1], dtype=float)
        self.single_output_ = outputs.ndim == 1
        outputs = outputs.reshape(len(samples), -1)
        P = None if memberships is None else check_memberships(memberships, len(samples), exact=True)
        weight = _check_sample_weight(sample_weight, samples, dtype=np.float64, ensure_non_negative=True)
        rows = np.flatnonzero(weight > 0)
        if rows.size == 0:
            raise ValueError("every sample_weight is zero; give at least one sample a positive weight")
        counts = None if sample_weight is None else weight[rows]
        self.feature_scale_ = resolved_scale(self.feature_scale, samples[rows], counts)
        self.X_ = np.ascontiguousarray(samples[rows] * self.feature_scale_)
        self.y_ = np.ascontiguousarray(outputs[rows])
        self.memberships_ = None if P is None else np.ascontiguousarray(P[rows])
        self.sample_weight_ = weight[rows]
        self.rows_ = rows
        self._build()
        if self.bandwidth == "auto":
            self._selected = 1.0
            self._selected = best_bandwidth(self.numbers())
        return self

    @property
    def bandwidth_(self) -> float:
        """The parameter, or what the last ``fit`` selected if that is "auto"."""
        return self._selected if self.bandwidth == "auto" else float(self.bandwidth)

    def predict(self, X: ArrayLike, memberships: ArrayLike | None = None) -> Array:
        """Predictions at queries, (m,) or (m, p) like ``y``.

        Args:
            X: (m, d).
            memberships: (m, K), contact-state probabilities of the queries, non-negative with row sums of at most one
                (less than one if the state may be unknown). None ignores the states.
        """
        return self.predict_with_support(X, memberships)[0]

    def predict_local(self, X: ArrayLike, memberships: ArrayLike | None = None) -> LocalPrediction:
        """Predictions with uncertainty and support; arguments as for ``predict``."""
        return predictions_with_uncertainty(*self._queries(X, memberships))

    def predict_with_support(self, X: ArrayLike, memberships: ArrayLike | None = None) -> tuple[Array, Array]:
        """Predictions as by ``predict``, and the logarithm of the greatest kernel weight of each query, (m,).

        This logarithm is zero at a sample of the same state, and very negative far from all samples.
        """
        predicted, support = local_predictions(*self._queries(X, memberships))
        return predicted[:, 0] if self.single_output_ else predicted, support

    def support_between(self, groups: ArrayLike) -> Array:
        """Logarithm of the greatest kernel weight (n,) that each sample finds in the other groups.

        This estimates the support that a new demonstration would find.

        Args:
            groups: (n,), the demonstration of each sample of ``X_``; at least two.
        """
        check_is_fitted(self)
        _, group, sizes = np.unique(np.asarray(groups), return_inverse=True, return_counts=True)
        p, best = self.numbers(), np.empty(len(self.X_))
        p = p._replace(k=min(p.k + int(sizes.max()), len(best)))
        for i, (query, q) in enumerate(zip(p.search.points, p.search.memberships, strict=True)):
            found, log_w = neighbourhood(p, query, q)
            best[i] = np.where(group[found] == group[i], -np.inf, log_w).max()
        return best

    def explain(self, x: ArrayLike, membership: ArrayLike | None = None, level: float = 0.95) -> Explanation:
        """Explains the prediction at one query (d,).

        Args:
            x: the query.
            membership: (K,), contact-state probabilities of the query, or None.
            level: nominal coverage of the interval.
        """
        q = None if membership is None else np.asarray(membership)[None]
        p, queries, Q = self._queries(np.asarray(x, dtype=float)[None], q)
        local = predictions_with_uncertainty(p, queries, Q)
        lower, upper = local.interval(level)
        found, weights, influence, _, log_w_max = local_model(p, queries[0], Q[0])
        order = np.argsort(-weights, kind="stable")
        order = order[weights[order] > 0]
        return Explanation(
            neighbours=self.rows_[found[order]],
            weights=weights[order],
            influence=influence[order],
            prediction=local.mean[0],
            lower=lower[0],
            upper=upper[0],
            level=level,
            support=float(local.support[0]),
            log_w_max=float(log_w_max),
        )

    def numbers(self, *, with_states: bool = True) -> RegressionNumbers:
        """The fitted estimator for compiled functions, with its contact states or without them."""
        n = len(self.X_)
        return RegressionNumbers(
            search=self._search if with_states else self._stateless,
            feature_scale=np.array(self.feature_scale_, dtype=float),
            y=self.y_,
            bandwidth=self.bandwidth_,
            k=n if self.n_neighbors is None else min(int(self.n_neighbors), n),
            ridge=float(self.ridge),
            degree=int(self.degree),
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted estimator as plain arrays, which can be stored without pickle."""
        check_is_fitted(self)
        arrays: dict[str, NDArray[Any]] = {
            "bandwidth": np.array(self.bandwidth_),
            "bandwidth_type": np.array("fixed"),
            "degree": np.array(int(self.degree)),
            "ridge": np.array(float(self.ridge)),
            "n_neighbors": np.array(-1 if self.n_neighbors is None else int(self.n_neighbors)),
            "feature_scale": self.feature_scale_,
            "X": self.X_,
            "y": self.y_,
            "sample_weight": self.sample_weight_,
            "rows": self.rows_,
            "single_output": np.array(self.single_output_),
        }
        if self.memberships_ is not None:
            arrays["memberships"] = self.memberships_
        if hasattr(self, "feature_names_in_"):
            arrays["feature_names"] = np.array([str(name) for name in self.feature_names_in_])
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores an estimator from ``to_arrays``; its predictions are bit-identical.

        Raises:
            ValueError: if an array is missing, unknown, or does not fit the others.
        """
        _check_stored(arrays)
        k, scale = int(arrays["n_neighbors"]), np.array(arrays["feature_scale"], dtype=float)
        self = cls(
            bandwidth=float(arrays["bandwidth"]),
            degree=int(arrays["degree"]),
            ridge=float(arrays["ridge"]),
            n_neighbors=None if k < 0 else k,
            feature_scale=scale,
        )
        self.feature_scale_ = scale
        self.X_ = np.array(arrays["X"], dtype=float, order="C")
        self.y_ = np.array(arrays["y"], dtype=float, order="C")
        self.sample_weight_ = np.array(arrays["sample_weight"], dtype=float)
        self.rows_ = np.array(arrays["rows"], dtype=np.intp)
        self.single_output_ = bool(arrays["single_output"])
        P = arrays.get("memberships")
        self.memberships_ = None if P is None else np.array(P, dtype=float, order="C")
        if "feature_names" in arrays:
            self.feature_names_in_ = np.array([str(name) for name in arrays["feature_names"]], dtype=object)
        self.n_features_in_ = self.X_.shape[1]
        self._build()
        return self

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def __getstate__(self) -> dict[str, Any]:
        """Leaves out the search, which is several times as large as the samples."""
        return {name: value for name, value in super().__getstate__().items() if name not in ("_search", "_stateless")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Copies the arrays: for the read-only ones of a mapped file all functions would be compiled again."""
        super().__setstate__({k: np.array(v) if isinstance(v, np.ndarray) else v for k, v in state.items()})
        if hasattr(self, "X_"):
            self._build()

    def _build(self) -> None:
        """Computes what follows from the stored samples."""
        self._search = self._stateless = SearchNumbers.of(self.X_, None, self.sample_weight_)
        if self.memberships_ is not None:
            self._search = SearchNumbers.of(self.X_, self.memberships_, self.sample_weight_)

    def _queries(self, X: ArrayLike, memberships: ArrayLike | None) -> tuple[RegressionNumbers, Array, Array]:
        """Checks queries; returns the regression, the scaled queries (m, d) and their memberships (m, K)."""
        if (
            # A fast path for controllers, which skips the general checks.
            isinstance(X, np.ndarray)
            and type(X) is np.ndarray
            and hasattr(self, "_search")
            and X.dtype == np.float64
            and X.ndim == 2
            and X.shape[1] == self.n_features_in_
            and len(X) > 0
            and not hasattr(self, "feature_names_in_")
            and np.isfinite(X).all()
        ):
            queries = X
        else:
            check_is_fitted(self)
            queries = validate_data(self, X, reset=False, dtype=np.float64)
        queries = np.ascontiguousarray(np.clip(queries * self.feature_scale_, -MAX_QUERY, MAX_QUERY))
        if memberships is None:
            return self.numbers(with_states=False), queries, np.ones((len(queries), 1))
        if self.memberships_ is None:
            raise ValueError("queries have memberships but the samples have none: give memberships to fit too")
        Q = check_memberships(memberships, len(queries), self.memberships_.shape[1])
        return self.numbers(), queries, np.ascontiguousarray(Q)


def resolved_scale(feature_scale: ArrayLike | str | None, X: Array, weights: Array | None) -> Array:
    """Returns the factors (d,) that a parameter asks for: numbers, "standard" (see `standard_scale`), or None for ones.

    Raises:
        ValueError: if they are not d positive, finite numbers.
    """
    if feature_scale is None:
        return np.ones(X.shape[1])
    if isinstance(feature_scale, str):
        return 1.0 / standard_scale(X, weights)
    scale = np.asarray(feature_scale, dtype=float)
    expected = f"expected {X.shape[1]} positive, finite numbers, one for each feature"
    if scale.shape != (X.shape[1],):
        raise ValueError(f"feature_scale has shape {scale.shape}; {expected}")
    if not (np.isfinite(scale).all() and (scale > 0).all()):
        raise ValueError(f"feature_scale is {scale}; {expected}")
    return scale


def _check_stored(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Checks the arrays of `LWRegressor.to_arrays`; a ValueError names the array, what was found and expected."""
    sizes = check_arrays(arrays, RULES, "LWRegressor.to_arrays")
    if int(arrays["n_neighbors"]) == 0:
        raise ValueError("array 'n_neighbors' is 0, expected -1 or a positive number")
    if bool(arrays["single_output"]) and sizes["p"] != 1:
        raise ValueError(f"array 'y' has {sizes['p']} outputs, expected one as 'single_output' says")
    if (np.diff(np.asarray(arrays["rows"]).astype(np.int64)) <= 0).any():
        raise ValueError("array 'rows' does not increase; expected the numbers of the samples")
    if "memberships" in arrays:
        check_memberships(arrays["memberships"], sizes["n"], exact=True)
