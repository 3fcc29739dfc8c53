"""Discovery of contact states: Competitive Agglomeration with the fuzzy-maximum-likelihood distance."""

from __future__ import annotations

import warnings
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp
from scipy.stats import chi2
from sklearn.base import BaseEstimator, ClusterMixin
from sklearn.exceptions import ConvergenceWarning
from sklearn.utils import check_random_state
from sklearn.utils.validation import check_is_fitted, validate_data
from threadpoolctl import threadpool_limits

from skill.cluster_competition import Schedule, compete, exponential_schedule, ramp_schedule
from skill.cluster_initialization import components_of_partition, nearest_centre, phase_bins, seed_centres
from skill.cluster_merging import bayesian_information_criterion, merge_by_bic
from skill.expectation_maximization import CovariancePrior, expectation_maximization
from skill.gaussian_components import (
    Array,
    GaussianComponents,
    log_densities,
    precision_factors,
    squared_mahalanobis,
)


class CompetitiveAgglomeration(ClusterMixin, BaseEstimator):
    """Clusters samples into an unknown number of Gaussian states."""

    def __init__(
        self,
        *,
        m_init: int = 30,
        eta0: float | None = None,
        tau: float = 10.0,
        schedule: str = "exp",
        rise: int = 10,
        decay: int = 30,
        min_cardinality: float | None = None,
        covariance_type: str = "full",
        shrinkage: float | None = None,
        reg_covar: float = 1e-6,
        merge: str | None = "bic",
        init: Any = "auto",
        n_init: int | None = None,
        max_iter: int = 100,
        tol: float = 1e-3,
        random_state: Any = None,
    ) -> None:
        self.m_init = m_init
        self.eta0 = eta0
        self.tau = tau
        self.schedule = schedule
        self.rise = rise
        self.decay = decay
        self.min_cardinality = min_cardinality
        self.covariance_type = covariance_type
        self.shrinkage = shrinkage
        self.reg_covar = reg_covar
        self.merge = merge
        self.init = init
        self.n_init = n_init
        self.max_iter = max_iter
        self.tol = tol
        self.random_state = random_state

    # ------------------------------------------------------------------ fitting

    def fit(
        self, X: ArrayLike, y: Any = None, groups: ArrayLike | None = None, phase: ArrayLike | None = None
    ) -> Self:
        """Finds the states.

        Args:
            X: samples, shape (N, d), any units.
            y: ignored.
            groups: shape (N,), the demonstration of each sample.
            phase: shape (N,), normalised time of each sample within its demonstration, in [0, 1].
        """
        X_: Array = validate_data(self, X, dtype=np.float64, ensure_min_samples=2)
        phase_ = None if phase is None else np.asarray(phase, dtype=float)
        random_state = check_random_state(self.random_state)
        with threadpool_limits(1):
            return self._fit(X_, phase_, random_state)

    def _fit(self, X: Array, phase: Array | None, random_state: np.random.RandomState) -> Self:
        N, d = X.shape
        shift = X.mean(axis=0)
        spread = X.std(axis=0)
        constant = spread <= 10.0 * np.finfo(float).eps * np.maximum(np.abs(shift), np.finfo(float).tiny)
        scale = np.where(constant, 1.0, spread)
        Z = (X - shift) / scale
        g = float(np.mean(Z.var(axis=0))) or 1.0
        evidence = 1.0
        diagonal = self.covariance_type == "diag"
        prior = CovariancePrior(
            count=float(d + 1) if self.shrinkage is None else float(self.shrinkage),
            variance=g,
            floor=np.full(d, self.reg_covar * g),
            diagonal=diagonal,
        )
        eta0 = self.eta0 if self.eta0 is not None else (5.0 if phase is not None else 1.0)
        schedule: Schedule = (
            exponential_schedule(eta0, self.tau)
            if self.schedule == "exp"
            else ramp_schedule(eta0, self.tau, self.rise, self.decay)
        )
        least = self.min_cardinality if self.min_cardinality is not None else max(5.0, prior.parameters / 2)
        M = int(max(1, min(self.m_init, N // (2 * (d + 1)))))
        n_init = self.n_init if self.n_init is not None else (1 if phase is not None else 5)
        best: tuple[float, GaussianComponents] | None = None
        tol_em = 1e-6 * N
        for _ in range(n_init):
            labels = (
                phase_bins(phase)
                if phase is not None
                else nearest_centre(Z, seed_centres(Z, M, random_state))
            )
            components = components_of_partition(Z, labels, prior, evidence=evidence)
            components, history, rested = compete(
                Z,
                components,
                prior,
                schedule,
                evidence=evidence,
                least_cardinality=least,
                max_iter=self.max_iter,
                tol=self.tol * float(np.sqrt(g)),
            )
            path: list[tuple[int, float]] = []
            if self.merge == "bic":
                components, path = merge_by_bic(Z, components, prior, evidence=evidence)
                components, log_likelihood, converged = expectation_maximization(
                    Z, components, prior, evidence=evidence, max_iter=self.max_iter, tol=tol_em
                )
                rested = rested and converged
            else:
                _, log_likelihood, _ = expectation_maximization(
                    Z, components, prior, evidence=evidence, max_iter=1, tol=0.0
                )
            criterion = bayesian_information_criterion(
                log_likelihood, len(components), prior.parameters, N, evidence
            )
            if best is None or criterion < best[0]:
                best = criterion, components
                self.history_ = history.arrays()
                self.merge_path_ = np.asarray(path, dtype=float).reshape(-1, 2)
                self.converged_ = rested
        assert best is not None
        components = best[1]
        if not self.converged_:
            warnings.warn(
                f"did not come to rest within max_iter={self.max_iter} iterations; raise max_iter or tol",
                ConvergenceWarning,
                stacklevel=3,
            )
        order = np.argsort(-components.weights, kind="stable")
        self.n_iter_ = len(self.history_["eta"])
        self._set_components(
            components.weights[order],
            shift + scale * components.means[order],
            scale[:, None] * components.covariances[order] * scale,
        )
        self.labels_ = self.predict(X)
        return self

    def _set_components(self, weights: Array, means: Array, covariances: Array) -> None:
        self.weights_ = weights
        self.means_ = means
        self.covariances_ = covariances
        self.precision_factors_ = precision_factors(covariances)
        self.n_clusters_ = len(weights)

    # --------------------------------------------------------------- prediction

    def _log_densities(self, X: ArrayLike, channels: ArrayLike | None) -> tuple[Array, Array]:
        """Log-densities and squared Mahalanobis distances, both (n, M), of all or of the given channels."""
        X_, means, factors = self._marginal(X, channels)
        return log_densities(X_, self.weights_, means, factors), squared_mahalanobis(X_, means, factors)

    def _marginal(self, X: ArrayLike, channels: ArrayLike | None) -> tuple[Array, Array, Array]:
        check_is_fitted(self)
        if channels is None:
            return (
                validate_data(self, X, dtype=np.float64, reset=False),
                self.means_,
                self.precision_factors_,
            )
        subset = np.asarray(channels, dtype=np.intp)
        X_ = np.asarray(X, dtype=float)
        if X_.ndim != 2 or X_.shape[1] != len(subset):
            raise ValueError(
                f"X has shape {X_.shape}, expected (n, {len(subset)}):"
                f" one column for each of channels={subset.tolist()}"
            )
        return (
            X_,
            self.means_[:, subset],
            precision_factors(self.covariances_[:, subset[:, None], subset]),
        )

    def predict(
        self, X: ArrayLike, channels: ArrayLike | None = None, gate: float | None = None
    ) -> NDArray[np.intp]:
        """Most probable state of each sample, shape (n,); -1 for "unknown" outside the gate.

        Args:
            X: shape (n, d), or (n, len(channels)).
            channels: indices of the channels X holds; the others are marginalised out.
            gate: probability in (0, 1): samples farther from their state than this quantile of chi-square
                are unknown.
        """
        log_density, distance = self._log_densities(X, channels)
        labels = np.argmax(log_density, axis=1)
        if gate is not None:
            d = self.n_features_in_ if channels is None else len(np.asarray(channels))
            labels[distance[np.arange(len(labels)), labels] > chi2.ppf(gate, d)] = -1
        return labels

    def predict_proba(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Posterior probability of each state, shape (n, M); rows sum to one."""
        log_density, _ = self._log_densities(X, channels)
        return np.exp(log_density - logsumexp(log_density, axis=1, keepdims=True))

    def score_samples(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Log-density of each sample under the mixture, shape (n,)."""
        log_density, _ = self._log_densities(X, channels)
        return np.asarray(logsumexp(log_density, axis=1))

    def mahalanobis(self, X: ArrayLike, channels: ArrayLike | None = None) -> Array:
        """Squared Mahalanobis distance to every state, shape (n, M)."""
        return self._log_densities(X, channels)[1]

    # ------------------------------------------------------------------- saving

    def to_arrays(self) -> dict[str, Array]:
        """The fitted state as plain arrays."""
        check_is_fitted(self)
        return {"weights": self.weights_, "means": self.means_, "covariances": self.covariances_}

    @classmethod
    def from_arrays(cls, arrays: dict[str, Array]) -> Self:
        """Restores an estimator that predicts identically to the last bit."""
        model = cls()
        model._set_components(
            *(np.array(arrays[k], dtype=float) for k in ("weights", "means", "covariances"))
        )
        model.n_features_in_ = model.means_.shape[1]
        return model
