"""Locally weighted regression with contact states.

A linear model is fitted around each query to the nearest samples, weighted by distance and contact state.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import _check_sample_weight, check_is_fitted, validate_data

from compiled import compiled
from skill.arrays import Array, standard_scale
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays
from skill.regression.leave_one_out import StoredSamples
from skill.regression.local_model import (
    LocalPrediction,
    equivalent_kernel,
    equivalent_kernels,
    local_predictions,
    normalised_weights,
    scaled_weights,
    weighted_output,
)
from skill.regression.neighbourhood import (
    Kernel,
    KernelNeighbourhood,
    SearchNumbers,
    check_memberships,
    kernel_numbers,
    neighbourhood_of_one,
)
from skill.regression.protocols import Explanation

MAX_QUERY = 1e100
"""Scaled queries are clipped to this magnitude, so that squared distances stay finite."""

RULES = {
    "bandwidth": ArrayRule(low=MIN_POSITIVE),
    "bandwidth_type": ArrayRule(holds="texts", choices=("fixed", "adaptive")),
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
        bandwidth: h, in units of the scaled features; for ``bandwidth_type="adaptive"``, in units of the distance to
            the farthest neighbour used. "auto" selects it in ``fit`` by the leave-one-out error of at most 500
            samples, among candidates that go on while the best is the first or the last. Where samples resemble their
            neighbours in time, this is too narrow: use `select_bandwidth`.
        bandwidth_type: "fixed" or "adaptive".
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
        marginal_variance_: (p,), overall variance of the outputs.

    References:
        Atkeson, Moore, Schaal, "Locally weighted learning", Artificial Intelligence Review 11, 1997.
    """

    _parameter_constraints: dict[str, list[Any]] = {
        "bandwidth": [Interval(Real, 0, None, closed="neither"), StrOptions({"auto"})],
        "bandwidth_type": [StrOptions({"fixed", "adaptive"})],
        "degree": [Interval(Integral, 0, 1, closed="both")],
        "ridge": [Interval(Real, 0, None, closed="left")],
        "n_neighbors": [Interval(Integral, 1, None, closed="left"), None],
        "feature_scale": [StrOptions({"standard"}), "array-like", None],
    }

    def __init__(
        self,
        bandwidth: float | str = "auto",
        *,
        bandwidth_type: str = "fixed",
        degree: int = 1,
        ridge: float = 1e-2,
        n_neighbors: int | None = 200,
        feature_scale: ArrayLike | str | None = "standard",
    ) -> None:
        self.bandwidth = bandwidth
        self.bandwidth_type = bandwidth_type
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
            self._selected = self._stored.best_bandwidth(self._kernel(1.0), ridge=self.ridge, degree=self.degree)
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
        queries, Q = self._queries(X, memberships)
        if len(queries) == 1:
            return self._shaped(self._predict_one(queries[0], None if Q is None else Q[0])[0][None])
        out = np.empty((len(queries), self.y_.shape[1]))
        for block, found, x, log_w in self._neighbourhood.blocks(queries, Q, self._kernel()):
            weights, _, ridge = normalised_weights(log_w, self.ridge)
            kernel = equivalent_kernels(queries[block], x, weights, ridge, self.degree)
            out[block] = (kernel[:, None, :] @ self.y_[found])[:, 0, :]
        return self._shaped(out)

    def predict_local(self, X: ArrayLike, memberships: ArrayLike | None = None) -> LocalPrediction:
        """Predictions with uncertainty and support; arguments as for ``predict``."""
        return self._local(*self._queries(X, memberships))

    def predict_with_support(self, X: ArrayLike, memberships: ArrayLike | None = None) -> tuple[Array, Array]:
        """Predictions as by ``predict``, and the logarithm of the greatest kernel weight of each query, (m,).

        This logarithm is zero at a sample of the same state, and very negative far from all samples.
        """
        queries, Q = self._queries(X, memberships)
        found = [self._predict_one(query, None if Q is None else Q[k]) for k, query in enumerate(queries)]
        return self._shaped(np.array([value for value, *_ in found])), np.array([support for *_, support in found])

    def support_between(self, groups: ArrayLike) -> Array:
        """Logarithm of the greatest kernel weight (n,) that each sample finds in the other groups.

        This estimates the support that a new demonstration would find.

        Args:
            groups: (n,), the demonstration of each sample of ``X_``; at least two.
        """
        _, group, sizes = np.unique(np.asarray(groups), return_inverse=True, return_counts=True)
        best = np.empty(len(self.X_))
        for block, found, _, log_w in self._neighbourhood.blocks(
            self.X_, self.memberships_, self._kernel(), extra=int(sizes.max())
        ):
            own = group[found] == group[block, None]
            best[block] = np.where(own, -np.inf, log_w).max(axis=1)
        return best

    def explain(self, x: ArrayLike, membership: ArrayLike | None = None, level: float = 0.95) -> Explanation:
        """Explains the prediction at one query (d,).

        Args:
            x: the query.
            membership: (K,), contact-state probabilities of the query, or None.
            level: nominal coverage of the interval.
        """
        q = None if membership is None else np.asarray(membership)[None]
        queries, Q = self._queries(np.asarray(x, dtype=float)[None], q)
        local = self._local(queries, Q)
        lower, upper = local.interval(level)
        _, found, x, log_w = next(self._neighbourhood.blocks(queries, Q, self._kernel()))
        weights, log_w_max, ridge = normalised_weights(log_w, self.ridge)
        influence = equivalent_kernels(queries, x, weights, ridge, self.degree)
        order = np.argsort(-weights[0], kind="stable")
        order = order[weights[0, order] > 0]
        return Explanation(
            neighbours=self.rows_[found[0, order]],
            weights=weights[0, order],
            influence=influence[0, order],
            prediction=local.mean[0],
            lower=lower[0],
            upper=upper[0],
            level=level,
            support=float(local.support[0]),
            log_w_max=float(log_w_max[0]),
        )

    def numbers(self, *, with_states: bool = True) -> RegressionNumbers:
        """The fitted estimator for compiled functions, with its contact states or without them."""
        check_is_fitted(self)
        bandwidth, adaptive, k = kernel_numbers(self._kernel(), len(self.X_))
        return RegressionNumbers(
            search=self._neighbourhood.numbers if with_states else self._neighbourhood.stateless,
            feature_scale=np.array(self.feature_scale_, dtype=float),
            y=self.y_,
            bandwidth=bandwidth,
            adaptive=adaptive,
            k=k,
            ridge=float(self.ridge),
            degree=int(self.degree),
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted estimator as plain arrays, which can be stored without pickle."""
        check_is_fitted(self)
        arrays: dict[str, NDArray[Any]] = {
            "bandwidth": np.array(self.bandwidth_),
            "bandwidth_type": np.array(self.bandwidth_type),
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
            bandwidth_type=str(arrays["bandwidth_type"]),
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

    def _build(self) -> None:
        """Computes what follows from the stored samples."""
        self.marginal_variance_ = self.y_.var(axis=0)
        self._neighbourhood = KernelNeighbourhood(self.X_, self.memberships_, self.sample_weight_)
        self._stored = StoredSamples(self.X_, self.y_, self.memberships_, self.sample_weight_, self._neighbourhood)

    def _queries(self, X: ArrayLike, memberships: ArrayLike | None) -> tuple[Array, Array | None]:
        """Checks queries; returns the scaled queries (m, d) and their memberships (m, K)."""
        if (
            # A fast path for controllers, which skips the general checks.
            isinstance(X, np.ndarray)
            and type(X) is np.ndarray
            and hasattr(self, "_neighbourhood")
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
        queries = np.minimum(np.maximum(queries * self.feature_scale_, -MAX_QUERY), MAX_QUERY)
        if memberships is None:
            return queries, None
        if self.memberships_ is None:
            raise ValueError("queries have memberships but the samples have none: give memberships to fit too")
        return queries, check_memberships(memberships, len(queries), self.memberships_.shape[1])

    def _predict_one(self, query: Array, q: Array | None) -> tuple[Array, NDArray[np.intp], Array, float]:
        """Returns what `local_prediction` does at one scaled query (d,)."""
        if q is None:
            return local_prediction(self.numbers(with_states=False), query, np.ones(1))
        return local_prediction(self.numbers(), query, np.array(q))

    def _kernel(self, bandwidth: float | None = None) -> Kernel:
        chosen = self.bandwidth_ if bandwidth is None else bandwidth
        return Kernel(chosen, self.bandwidth_type == "adaptive", self.n_neighbors)

    def _local(self, queries: Array, Q: Array | None) -> LocalPrediction:
        parts = [
            local_predictions(
                queries[block], x, self.y_[found], log_w, self.ridge, self.degree, self.marginal_variance_
            )
            for block, found, x, log_w in self._neighbourhood.blocks(queries, Q, self._kernel())
        ]
        return LocalPrediction(
            **{f.name: np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(LocalPrediction)}
        )

    def _shaped(self, values: Array) -> Array:
        return values[:, 0] if self.single_output_ else values


class RegressionNumbers(NamedTuple):
    """A fitted `LWRegressor` for compiled functions.

    Attributes:
        search: the samples.
        feature_scale: (d,).
        y: (n, p), outputs.
        bandwidth: see `kernel_numbers`.
        adaptive: likewise.
        k: likewise.
        ridge: penalty of the slope.
        degree: 0 or 1.
    """

    search: SearchNumbers
    feature_scale: Array
    y: Array
    bandwidth: float
    adaptive: bool
    k: int
    ridge: float
    degree: int


@compiled
def local_prediction(p: RegressionNumbers, query: Array, q: Array) -> tuple[Array, NDArray[np.intp], Array, float]:
    """Returns the prediction (p,) at one query, and rows (k,), weights (k,) and greatest log weight of its samples.

    Args:
        p: the regressor.
        query: (d,), scaled features.
        q: (K,), contact-state probabilities of the query.
    """
    rows, log_w = neighbourhood_of_one(p.search, query, q, p.bandwidth, p.adaptive, p.k)
    weights, log_w_max, ridge = scaled_weights(log_w, p.ridge)
    kernel = equivalent_kernel(query, p.search.points[rows], weights, ridge, p.degree)
    return weighted_output(kernel, p.y, rows), rows, weights, log_w_max


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
