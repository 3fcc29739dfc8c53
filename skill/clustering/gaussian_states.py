"""Prediction from a set of Gaussian states: posteriors, densities, gates, marginals, and their storage."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp
from scipy.stats import chi2
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.utils.validation import check_array, check_is_fitted, validate_data

from skill.arrays import Array
from skill.clustering.gaussian_components import (
    GaussianComponents,
    log_normalizers,
    precision_factors,
    squared_mahalanobis,
)
from skill.clustering.prototype_competition import log_squared_distances
from skill.clustering.state_number import bayesian_information_criterion

UNKNOWN = -1
"""Label of a sample that belongs to no state."""


class GaussianStates(ClusterMixin, BaseEstimator):
    """Fitted Gaussian states.

    Attributes:
        n_clusters_: M, the number of states.
        weights_: shape (M,), share of each state, largest first.
        means_: shape (M, d), in the units of the channels.
        covariances_: shape (M, d, d); diagonal matrices if that was asked for.
        precision_factors_: shape (M, d, d), upper triangular R with inv(F) = R R'.
        design_effect_: how many samples count as one independent sample.
        distance_: the distance that assigns samples: "fmle" is the Gaussian posterior.
    """

    weights_: Array
    means_: Array
    covariances_: Array
    precision_factors_: Array
    n_clusters_: int
    n_features_in_: int
    design_effect_: float
    distance_: str

    def _set_states(
        self, components: GaussianComponents, *, distance: str = "fmle", design_effect: float = 1.0
    ) -> None:
        self.weights_ = components.weights
        self.means_ = components.means
        self.covariances_ = components.covariances
        self.precision_factors_ = precision_factors(components.covariances)
        self.n_clusters_ = len(components)
        self.distance_ = distance
        self.design_effect_ = float(design_effect)

    def marginal(self, channels: ArrayLike | None = None) -> tuple[GaussianComponents, Array]:
        """The states seen through some channels only, the others marginalised out.

        Args:
            channels: k different indices in [0, d), or None for all.

        Returns:
            The components in these k channels, and their precision factors (M, k, k).

        Raises:
            ValueError: if an index is out of range or repeated.
        """
        check_is_fitted(self, "means_")
        if channels is None:
            return (
                GaussianComponents(self.weights_, self.means_, self.covariances_),
                self.precision_factors_,
            )
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
        components = GaussianComponents(self.weights_, self.means_[:, subset], covariances)
        return components, precision_factors(covariances)

    def _prepared(self, X: ArrayLike, channels: ArrayLike | None) -> tuple[Array, GaussianComponents, Array]:
        """Validated samples and the states in their channels."""
        components, factors = self.marginal(channels)
        if channels is None:
            return validate_data(self, X, dtype=np.float64, reset=False), components, factors
        checked: Array = check_array(X, dtype=np.float64)
        k = components.means.shape[1]
        if checked.shape[1] != k:
            raise ValueError(f"X has {checked.shape[1]} columns, expected {k}: one for each of channels={channels!r}")
        return checked, components, factors

    def _log_memberships(self, X: ArrayLike, channels: ArrayLike | None) -> tuple[Array, Array, Array]:
        """Log of unnormalised memberships, log-densities and squared Mahalanobis distances, each (n, M)."""
        Z, components, factors = self._prepared(X, channels)
        distances = squared_mahalanobis(Z, components.means, factors)
        densities = log_normalizers(components.weights, factors) - 0.5 * distances
        if self.distance_ == "fmle":
            return densities, densities, distances
        return -log_squared_distances(Z, components, self.distance_), densities, distances

    def predict(self, X: ArrayLike, channels: ArrayLike | None = None, gate: float | None = None) -> NDArray[np.intp]:
        """The state of each sample, shape (n,): the most probable, or -1 ("unknown") outside the gate.

        Args:
            X: shape (n, d), or (n, k) with k ``channels``.
            channels: indices of the k channels X holds; the others are marginalised out.
            gate: probability in (0, 1): a sample is unknown if the squared Mahalanobis distance to its
                state exceeds
                this quantile of chi-square with as many degrees of freedom as there are channels.
        """
        memberships, _, distances = self._log_memberships(X, channels)
        labels = np.argmax(memberships, axis=1)
        if gate is not None:
            nearest = distances[np.arange(len(labels)), labels]
            k = self.n_features_in_ if channels is None else np.asarray(channels).size
            labels[nearest > chi_square_gate(gate, k)] = UNKNOWN
        return labels

    def predict_proba(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Posterior of each state (membership for gk and euclid), shape (n, M); rows sum to one."""
        memberships, _, _ = self._log_memberships(X, channels)
        return np.exp(memberships - logsumexp(memberships, axis=1, keepdims=True))

    def score_samples(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Log-density of each sample under the mixture of all states, shape (n,), per unit volume of X."""
        _, densities, _ = self._log_memberships(X, channels)
        return np.asarray(logsumexp(densities, axis=1))

    def score(self, X: ArrayLike, y: Any = None, channels: ArrayLike | None = None) -> float:
        """Mean log-density of the samples."""
        return float(np.mean(self.score_samples(X, channels)))

    def mahalanobis(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Squared Mahalanobis distance of each sample to each state, shape (n, M)."""
        Z, components, factors = self._prepared(X, channels)
        return squared_mahalanobis(Z, components.means, factors)

    def bic(self, X: ArrayLike) -> float:
        """Bayesian information criterion of ``X`` at its effective sample size (smaller is better)."""
        log_likelihood = self.score_samples(X)
        d = self.n_features_in_
        off_diagonal = self.covariances_ * (1.0 - np.eye(d))
        T = 2 * d if not off_diagonal.any() else d + d * (d + 1) // 2
        return bayesian_information_criterion(
            float(log_likelihood.sum()), self.n_clusters_, T, len(log_likelihood), self.design_effect_
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted states as plain arrays, to be stored without pickling."""
        check_is_fitted(self, "means_")
        return {
            "weights": self.weights_.copy(),
            "means": self.means_.copy(),
            "covariances": self.covariances_.copy(),
            "precision_factors": self.precision_factors_.copy(),
            "design_effect": np.array(self.design_effect_),
            "distance": np.array(self.distance_),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores states that predict identically to the last bit; they cannot tell how they were fitted.

        Raises:
            ValueError: if an array is missing, has the wrong shape or is not finite.
        """
        expected = ("weights", "means", "covariances", "precision_factors", "design_effect", "distance")
        missing = [name for name in expected if name not in arrays]
        if missing:
            raise ValueError(f"arrays {missing} are missing; expected {list(expected)} of to_arrays()")
        means = np.array(arrays["means"], dtype=np.float64)
        if means.ndim != 2:
            raise ValueError(f"array 'means' has shape {means.shape}, expected (M, d)")
        M, d = means.shape
        shapes = {"weights": (M,), "covariances": (M, d, d), "precision_factors": (M, d, d)}
        values = {name: np.array(arrays[name], dtype=np.float64) for name in shapes}
        for name, shape in shapes.items():
            if values[name].shape != shape:
                raise ValueError(f"array '{name}' has shape {values[name].shape}, expected {shape}")
        for name, value in [("means", means), *values.items()]:
            if not np.isfinite(value).all():
                raise ValueError(f"array '{name}' is not finite; the file is damaged, fit and save again")
        states = cls()
        states.weights_, states.means_ = values["weights"], means
        states.covariances_, states.precision_factors_ = values["covariances"], values["precision_factors"]
        states.n_clusters_, states.n_features_in_ = M, d
        states.distance_ = str(arrays["distance"])
        states.design_effect_ = float(arrays["design_effect"])
        return states


def chi_square_gate(probability: float, degrees: int) -> float:
    """Squared Mahalanobis distance within which a share ``probability`` of a state's own samples lies."""
    if not 0.0 < probability < 1.0:
        raise ValueError(f"gate={probability!r}: expected a probability between 0 and 1, for example 0.999")
    return float(chi2.ppf(probability, degrees))
