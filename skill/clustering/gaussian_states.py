"""Gaussian states: prediction (posteriors, densities, gate, marginals) and storage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_array, validate_data

from skill.arrays import Array
from skill.clustering.gaussian_components import (
    GaussianComponents,
    distance_gate,
    log_normalizers,
    precision_factors,
    squared_mahalanobis,
    tailed_log_densities,
)
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays

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
}
"""The arrays of `GaussianStates.to_arrays`: M states in d channels."""


class GaussianStates(ClusterMixin, BaseEstimator):
    """Fitted states, each a Gaussian or a Student distribution; base class of the clusterers that find such states.

    Attributes:
        n_clusters_: number of states M.
        n_features_in_: number of channels d.
        weights_: shape (M,), share of the samples in each state, largest first.
        means_: shape (M, d), means in the units of the channels.
        covariances_: shape (M, d, d), covariances; scale matrices with finite degrees of freedom.
        degrees_of_freedom_: of the Student distributions; infinite for Gaussians.
        precision_factors_: shape (M, d, d), upper triangular R with inv(F) = R R'.
        design_effect_: number of samples that carry the information of one independent sample.
    """

    weights_: Array
    means_: Array
    covariances_: Array
    precision_factors_: Array
    degrees_of_freedom_: float
    n_clusters_: int
    n_features_in_: int
    design_effect_: float

    def _set_states(self, components: GaussianComponents, *, design_effect: float = 1.0) -> None:
        """Sets the fitted attributes, except ``n_features_in_``."""
        self.weights_ = components.weights
        self.means_ = components.means
        self.covariances_ = components.covariances
        self.precision_factors_ = precision_factors(components.covariances)
        self.degrees_of_freedom_ = components.degrees
        self.n_clusters_ = len(components)
        self.design_effect_ = float(design_effect)

    def _check_fitted(self) -> None:
        if not hasattr(self, "means_"):  # scikit-learn's check would ask for a method `fit`
            raise NotFittedError(f"this {type(self).__name__} is not fitted yet; call 'fit' first")

    def marginal(self, channels: ArrayLike | None = None) -> tuple[GaussianComponents, Array]:
        """Returns the states in some channels, with the other channels marginalised out.

        Args:
            channels: k different channel indices from 0 to d - 1; None means all channels.

        Returns:
            The components in these k channels and their precision factors, shape (M, k, k).
        """
        self._check_fitted()
        if channels is None:
            components = GaussianComponents(self.weights_, self.means_, self.covariances_, self.degrees_of_freedom_)
            return components, self.precision_factors_
        subset = np.asarray(channels)
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

    def _log_densities(self, Z: Array, components: GaussianComponents, factors: Array) -> tuple[Array, Array]:
        """Returns log P_i p_i of checked samples, and their squared Mahalanobis distances, each (n, M)."""
        distances = squared_mahalanobis(Z, components.means, factors)
        normalizers = log_normalizers(components.weights, factors)
        return tailed_log_densities(normalizers, distances, Z.shape[1], components.degrees), distances

    def log_densities(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Returns the log-density of each sample in each state with its weight, log P_i p_i, shape (n, M)."""
        return self._log_densities(*self._validated(X, channels))[0]

    def predict(self, X: ArrayLike, channels: ArrayLike | None = None, gate: float | None = None) -> NDArray[np.intp]:
        """Returns the most probable state of each sample, shape (n,); -1 (unknown) outside the gate.

        Args:
            X: samples, shape (n, d), or (n, k) with k ``channels``.
            channels: indices of the k channels in X; the other channels are marginalised out. None means all.
            gate: probability in (0, 1). A sample is unknown if the squared Mahalanobis distance to its state exceeds
                `distance_gate` of this probability. None means no gate.
        """
        densities, distances = self._log_densities(*self._validated(X, channels))
        labels: NDArray[np.intp] = np.argmax(densities, axis=1)
        if gate is not None:
            nearest = distances[np.arange(len(labels)), labels]
            k = self.n_features_in_ if channels is None else np.asarray(channels).size
            labels[nearest > distance_gate(gate, k, self.degrees_of_freedom_)] = UNKNOWN
        return labels

    def predict_proba(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Returns the posterior of each state, shape (n, M); rows sum to one.

        Far away the posterior of the state with the smallest Mahalanobis distance is one, however improbable the sample
        is: `score_samples` and the gate of `predict` show how far it is. Values beyond 1e100 count as 1e100.
        """
        densities = self.log_densities(X, channels)
        return np.exp(densities - logsumexp(densities, axis=1, keepdims=True))

    def score_samples(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Returns the log-density of each sample under the mixture of all states, shape (n,)."""
        return np.asarray(logsumexp(self.log_densities(X, channels), axis=1))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Returns the fitted states as arrays that can be stored without pickle."""
        self._check_fitted()
        tails = {} if np.isinf(self.degrees_of_freedom_) else {"degrees_of_freedom": np.array(self.degrees_of_freedom_)}
        return {
            **tails,
            "weights": self.weights_.copy(),
            "means": self.means_.copy(),
            "covariances": self.covariances_.copy(),
            "precision_factors": self.precision_factors_.copy(),
            "design_effect": np.array(self.design_effect_),
        }

    @staticmethod
    def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> GaussianStates:
        """Restores fitted states from the result of `to_arrays`; they predict identically to the last bit.

        What describes the fit, such as its parameters, labels and history, is not restored.

        Raises:
            ValueError: if an array is missing, unknown, has the wrong shape, is not finite or does not fit the others.
        """
        sizes = check_arrays(arrays, RULES, "GaussianStates.to_arrays")
        names = ("weights", "means", "covariances", "precision_factors")
        values = {name: np.array(arrays[name], dtype=np.float64) for name in names}
        _check_components(values["weights"], values["covariances"], values["precision_factors"])
        states = GaussianStates()
        states.weights_, states.means_ = values["weights"], values["means"]
        states.covariances_, states.precision_factors_ = values["covariances"], values["precision_factors"]
        states.n_clusters_, states.n_features_in_ = sizes["M"], sizes["d"]
        states.degrees_of_freedom_ = float(arrays.get("degrees_of_freedom", np.inf))
        states.design_effect_ = float(arrays["design_effect"])
        return states


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
