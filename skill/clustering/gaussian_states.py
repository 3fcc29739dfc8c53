"""Gaussian states: prediction (posteriors, densities, gate, marginals) and storage."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from skill.array_schema import MAX_MAGNITUDE, MIN_POSITIVE, ArrayRule, check_arrays
from skill.arrays import Array
from skill.clustering.gaussian_components import (
    GaussianComponents,
    log_normalizers,
    parameters_per_component,
    precision_factors,
    squared_mahalanobis,
)
from skill.clustering.prototype_competition import log_squared_distances
from skill.clustering.state_number import bayesian_information_criterion
from skill.clustering.student_tails import distance_gate, tailed_log_densities
from skill.data.strict_json import parse_object

NUMERIC_DTYPE = re.compile(r"[<|>=][biuf][1248]")
"""The types of parameters that are arrays, as `numpy.dtype.str` names them."""

FACTOR_ERROR = 1e-2
"""Largest element of R' F R - I that rounding explains for stored precision factors."""

ROUNDING = 1e-9
"""Relative size of an element that rounding explains."""

UNKNOWN = -1
"""Label of a sample that belongs to no state."""

MAX_VALUE = 1e100
"""Values of samples are clipped to this magnitude, so that squared distances stay finite."""

RULES = {
    "means": ArrayRule(("M", "d")),
    "weights": ArrayRule(("M",), low=0.0, high=1.0 + 1e-6),
    "covariances": ArrayRule(("M", "d", "d")),
    "precision_factors": ArrayRule(("M", "d", "d")),
    "design_effect": ArrayRule(low=MIN_POSITIVE),
    "degrees_of_freedom": ArrayRule(low=1.0, optional=True),
    "distance": ArrayRule(holds="texts", choices=("fmle", "gk", "euclid")),
    "parameters": ArrayRule(holds="texts", optional=True),
}
"""The arrays of `GaussianStates.to_arrays`: M states in d channels."""


class GaussianStates(ClusterMixin, BaseEstimator):
    """Base class of clusterers whose result is a set of states, each a Gaussian or a Student distribution.

    Attributes:
        n_clusters_: number of states M.
        n_features_in_: number of channels d.
        weights_: shape (M,), share of the samples in each state, largest first.
        means_: shape (M, d), means in the units of the channels.
        covariances_: shape (M, d, d), covariances; scale matrices with finite degrees of freedom.
        degrees_of_freedom_: of the Student distributions; infinite for Gaussians.
        precision_factors_: shape (M, d, d), upper triangular R with inv(F) = R R'.
        design_effect_: number of samples that carry the information of one independent sample.
        distance_: distance that assigns samples to states: "fmle" (posterior), "gk" or "euclid".
    """

    weights_: Array
    means_: Array
    covariances_: Array
    precision_factors_: Array
    degrees_of_freedom_: float
    n_clusters_: int
    n_features_in_: int
    design_effect_: float
    distance_: str

    def _set_states(
        self, components: GaussianComponents, *, distance: str = "fmle", design_effect: float = 1.0
    ) -> None:
        """Sets the fitted attributes, except ``n_features_in_``."""
        self.weights_ = components.weights
        self.means_ = components.means
        self.covariances_ = components.covariances
        self.precision_factors_ = precision_factors(components.covariances)
        self.degrees_of_freedom_ = components.degrees
        self.n_clusters_ = len(components)
        self.distance_ = distance
        self.design_effect_ = float(design_effect)

    def marginal(self, channels: ArrayLike | None = None) -> tuple[GaussianComponents, Array]:
        """Returns the states in some channels, with the other channels marginalised out.

        Args:
            channels: k different channel indices from 0 to d - 1; None means all channels.

        Returns:
            The components in these k channels and their precision factors, shape (M, k, k).

        Raises:
            ValueError: if there is no index, or an index is out of range or repeated.
        """
        check_is_fitted(self, "means_")
        if channels is None:
            components = GaussianComponents(self.weights_, self.means_, self.covariances_, self.degrees_of_freedom_)
            return components, self.precision_factors_
        subset = np.asarray(channels)
        d = self.n_features_in_
        if (
            subset.ndim != 1
            or subset.size == 0
            or not np.issubdtype(subset.dtype, np.integer)
            or subset.min() < 0
            or subset.max() >= d
            or len(np.unique(subset)) != len(subset)
        ):
            raise ValueError(f"channels={channels!r}: expected different indices between 0 and {d - 1}")
        covariances = self.covariances_[:, subset[:, None], subset]
        components = GaussianComponents(self.weights_, self.means_[:, subset], covariances, self.degrees_of_freedom_)
        return components, precision_factors(covariances)

    def _validated(self, X: ArrayLike, channels: ArrayLike | None) -> tuple[Array, GaussianComponents, Array]:
        """Returns the checked and clipped samples, and the components and precision factors in their channels."""
        components, factors = self.marginal(channels)
        if channels is None:
            checked: Array = validate_data(self, X, dtype=np.float64, reset=False)
        else:
            checked = check_array(X, dtype=np.float64)
        k = components.means.shape[1]
        if checked.shape[1] != k:
            raise ValueError(f"X has {checked.shape[1]} columns, expected {k}: one for each of channels={channels!r}")
        return np.clip(checked, -MAX_VALUE, MAX_VALUE), components, factors

    def _log_memberships(self, X: ArrayLike, channels: ArrayLike | None) -> tuple[Array, Array, Array]:
        """Returns log memberships (not normalised), log-densities and squared Mahalanobis distances, each (n, M)."""
        return self._log_memberships_of(*self._validated(X, channels))

    def _log_memberships_of(
        self, Z: Array, components: GaussianComponents, factors: Array
    ) -> tuple[Array, Array, Array]:
        """The same for checked samples and the result of `marginal` for their channels."""
        distances = squared_mahalanobis(Z, components.means, factors)
        normalizers = log_normalizers(components.weights, factors)
        densities = tailed_log_densities(normalizers, distances, Z.shape[1], components.degrees)
        if self.distance_ == "fmle":
            return densities, densities, distances
        return -log_squared_distances(Z, components, self.distance_), densities, distances

    def predict(self, X: ArrayLike, channels: ArrayLike | None = None, gate: float | None = None) -> NDArray[np.intp]:
        """Returns the most probable state of each sample, shape (n,); -1 (unknown) outside the gate.

        Args:
            X: samples, shape (n, d), or (n, k) with k ``channels``.
            channels: indices of the k channels in X; the other channels are marginalised out. None means all.
            gate: probability in (0, 1). A sample is unknown if the squared Mahalanobis distance to its state exceeds
                `distance_gate` of this probability. None means no gate.
        """
        memberships, _, distances = self._log_memberships(X, channels)
        labels: NDArray[np.intp] = np.argmax(memberships, axis=1)
        if gate is not None:
            nearest = distances[np.arange(len(labels)), labels]
            k = self.n_features_in_ if channels is None else np.asarray(channels).size
            labels[nearest > distance_gate(gate, k, self.degrees_of_freedom_)] = UNKNOWN
        return labels

    def predict_proba(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Returns the posterior of each state (the membership for gk and euclid), shape (n, M); rows sum to one.

        Far away the posterior of the state with the smallest Mahalanobis distance is one, however improbable the sample
        is: `mahalanobis`, `score_samples` and the gate of `predict` tell how far it is. Values beyond 1e100 count as
        1e100.
        """
        memberships, _, _ = self._log_memberships(X, channels)
        return np.exp(memberships - logsumexp(memberships, axis=1, keepdims=True))

    def score_samples(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Returns the log-density of each sample under the mixture of all states, shape (n,)."""
        _, densities, _ = self._log_memberships(X, channels)
        return np.asarray(logsumexp(densities, axis=1))

    def score(self, X: ArrayLike, y: Any = None, channels: ArrayLike | None = None) -> float:
        """Returns the mean log-density of the samples; ``y`` is ignored."""
        return float(np.mean(self.score_samples(X, channels)))

    def mahalanobis(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Returns the squared Mahalanobis distance of each sample to each state, shape (n, M)."""
        Z, components, factors = self._validated(X, channels)
        return squared_mahalanobis(Z, components.means, factors)

    def bic(self, X: ArrayLike) -> float:
        """Returns the Bayesian information criterion of ``X`` at the effective sample size; smaller is better."""
        log_likelihood = self.score_samples(X)
        d = self.n_features_in_
        off_diagonal = self.covariances_ * (1.0 - np.eye(d))
        T = parameters_per_component(d, diagonal=not off_diagonal.any())
        return bayesian_information_criterion(
            float(log_likelihood.sum()), self.n_clusters_, T, len(log_likelihood), self.design_effect_
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Returns the fitted states and the constructor parameters as arrays that can be stored without pickle.

        The array "parameters" holds the parameters as JSON. A ``random_state`` object is stored as None.

        Raises:
            TypeError: if a parameter cannot be stored.
        """
        check_is_fitted(self, "means_")
        tails = {} if np.isinf(self.degrees_of_freedom_) else {"degrees_of_freedom": np.array(self.degrees_of_freedom_)}
        return {
            **tails,
            "weights": self.weights_.copy(),
            "means": self.means_.copy(),
            "covariances": self.covariances_.copy(),
            "precision_factors": self.precision_factors_.copy(),
            "design_effect": np.array(self.design_effect_),
            "distance": np.array(self.distance_),
            "parameters": np.array(json.dumps(self.get_params(deep=False), default=_to_json)),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores fitted states from the result of `to_arrays`.

        The restored states have the same parameters and predict identically to the last bit. The attributes that
        describe the fit, such as labels and history, are not restored. Arrays of earlier versions have no entry
        "parameters"; the parameters are then unknown, and `get_params` reports the defaults.

        Raises:
            ValueError: if an array is missing, unknown, has the wrong shape, is not finite or does not fit the others,
                or if a stored parameter is not a parameter of this class or out of range.
        """
        sizes = check_arrays(arrays, RULES, f"{cls.__name__}.to_arrays")
        names = ("weights", "means", "covariances", "precision_factors")
        values = {name: np.array(arrays[name], dtype=np.float64) for name in names}
        _check_components(values["weights"], values["covariances"], values["precision_factors"])
        states = cls(**cls._stored_parameters(arrays))
        states.weights_, states.means_ = values["weights"], values["means"]
        states.covariances_, states.precision_factors_ = values["covariances"], values["precision_factors"]
        states.n_clusters_, states.n_features_in_ = sizes["M"], sizes["d"]
        states.degrees_of_freedom_ = float(arrays.get("degrees_of_freedom", np.inf))
        states.distance_ = str(arrays["distance"])
        states.design_effect_ = float(arrays["design_effect"])
        return states

    @classmethod
    def _stored_parameters(cls, arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
        """Returns the constructor parameters in the arrays; empty for arrays of earlier versions."""
        if "parameters" not in arrays:
            return {}
        try:
            parameters = parse_object(str(arrays["parameters"]), _from_json)
        except ValueError as error:
            raise ValueError(f"array 'parameters': {error}") from error
        unknown = sorted(set(parameters) - set(cls().get_params(deep=False)))
        if unknown:
            raise ValueError(f"stored parameters {unknown} are not parameters of {cls.__name__}")
        cls(**parameters)._validate_params()
        for name, default in cls().get_params(deep=False).items():
            _check_parameter(name, parameters.get(name, default), default)
        return parameters


def _check_parameter(name: str, value: Any, default: Any) -> None:
    """Checks what scikit-learn does not: that truth values are no numbers, and the size of numbers."""
    if isinstance(default, bool) is not isinstance(value, bool):
        expected = "true or false" if isinstance(default, bool) else "no truth value"
        raise ValueError(f"parameter '{name}' is {value!r}, expected {expected}")
    if value is None or isinstance(value, str):
        return
    try:
        sizes = np.abs(np.asarray(value, dtype=float))
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"parameter '{name}' does not hold numbers") from None
    if not (sizes <= MAX_MAGNITUDE).all():
        raise ValueError(f"parameter '{name}' is up to {sizes.max():g}, expected at most {MAX_MAGNITUDE:g}")


def _to_json(value: Any) -> Any:
    """Converts a parameter that JSON does not know: arrays with their type, NumPy scalars, generators to None."""
    if isinstance(value, np.random.RandomState):
        return None
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "__array__"):
        array = np.asarray(value)
        return {"array": array.tolist(), "dtype": array.dtype.str}
    raise TypeError(f"a parameter of type {type(value).__name__} cannot be stored")


def _from_json(value: dict[str, Any]) -> Any:
    """Restores the arrays of `_to_json`."""
    if set(value) != {"array", "dtype"}:
        return value
    dtype = str(value["dtype"])
    if not NUMERIC_DTYPE.fullmatch(dtype):
        raise ValueError(f"an array of type {dtype[:40]!r}, expected numbers")
    return np.array(value["array"], dtype=dtype)


def _check_components(weights: Array, covariances: Array, factors: Array) -> None:
    """Checks that weights sum to one, and that precision factors belong to their covariances."""
    if abs(weights.sum() - 1.0) > 1e-6:
        raise ValueError(f"array 'weights' sums to {weights.sum():.6g}, expected 1")
    if np.abs(covariances - covariances.transpose(0, 2, 1)).max() > ROUNDING * np.abs(covariances).max():
        raise ValueError("array 'covariances' is not symmetric")
    below = np.abs(np.tril(factors, -1)).max()
    if below > ROUNDING * np.abs(factors).max() or np.einsum("mdd->md", factors).min() <= 0.0:
        raise ValueError("array 'precision_factors' is not upper triangular with a positive diagonal")
    with np.errstate(over="ignore", invalid="ignore"):
        products = factors.transpose(0, 2, 1) @ covariances @ factors
    if not np.abs(products - np.eye(factors.shape[-1])).max() < FACTOR_ERROR:
        raise ValueError("array 'precision_factors' does not belong to 'covariances'")
