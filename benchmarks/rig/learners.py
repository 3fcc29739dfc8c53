"""Other learners in the place of ours: each a part of a `ManipulationSkill`, given the same features and samples.

Samples come demonstration by demonstration, so that unshuffled folds hold out whole demonstrations, but for the one at
each fold's edge; every learner chooses its parameters by cross-validation over such folds. Features and outputs are
standardised for those whose answer depends on their units.
"""

from __future__ import annotations

import warnings
from typing import Any, Self

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.compose import TransformedTargetRegressor
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.mixture import GaussianMixture
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.neighbors import KNeighborsRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from benchmarks.learners.gaussian_mixture_regression import gmr_predict
from skill.clustering.gaussian_components import GaussianComponents
from skill.clustering.gaussian_states import GaussianStates

FOLDS = KFold(5)
LARGEST_GP = 1500  # samples; its cost grows with their cube
MAX_STATES = 30  # components that BIC chooses from


def best_mixture(Z: np.ndarray, random_state: int) -> GaussianMixture:
    """Of least BIC among one to thirty components."""
    mixtures = [
        GaussianMixture(k, reg_covar=1e-4, random_state=random_state).fit(Z)
        for k in range(1, min(MAX_STATES, len(Z) // (2 * Z.shape[1])) + 1)
    ]
    return min(mixtures, key=lambda mixture: mixture.bic(Z))


class MixtureRegressor(RegressorMixin, BaseEstimator):
    """Gaussian mixture regression (`gmr_predict`) over an ordinary mixture of inputs and outputs, chosen by BIC."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: np.ndarray, y: np.ndarray) -> Self:
        self.x_, self.y_ = StandardScaler().fit(X), StandardScaler().fit(y)
        self.mixture_ = best_mixture(np.hstack([self.x_.transform(X), self.y_.transform(y)]), self.random_state)
        self.n_features_in_ = X.shape[1]
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        m, d = self.mixture_, self.n_features_in_
        outputs = np.arange(d, m.means_.shape[1])
        found = gmr_predict(m.means_, m.covariances_, m.weights_, self.x_.transform(X), np.arange(d), outputs)
        return np.asarray(self.y_.inverse_transform(found))


class SubsetGaussianProcess(RegressorMixin, BaseEstimator):
    """A Gaussian process with a length scale a feature, on at most `LARGEST_GP` samples drawn at random."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: np.ndarray, y: np.ndarray) -> Self:
        rng = np.random.default_rng(self.random_state)
        kept = rng.permutation(len(X))[:LARGEST_GP]
        kernel = ConstantKernel(1.0) * RBF(np.ones(X.shape[1]), (1e-2, 1e3)) + WhiteKernel(0.1)
        process = GaussianProcessRegressor(kernel, normalize_y=True, random_state=self.random_state)
        self.model_ = make_pipeline(StandardScaler(), process)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a feature that does not matter ends at its bound
            self.model_.fit(X[kept], y[kept])
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        return np.asarray(self.model_.predict(X))


class MixtureStates(GaussianStates):
    """Contact states from an ordinary Gaussian mixture, their number by BIC, every sample counting in full."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: np.ndarray, y: Any = None, groups: Any = None, phase: Any = None) -> Self:
        scaler = StandardScaler().fit(X)
        found = best_mixture(scaler.transform(X), self.random_state)
        self.n_features_in_ = X.shape[1]
        scale = scaler.scale_
        self._set_states(
            GaussianComponents(
                found.weights_, scaler.inverse_transform(found.means_), scale[:, None] * found.covariances_ * scale
            )
        )
        return self


def nearest_neighbours() -> GridSearchCV:
    """The number of neighbours and their weighting by cross-validation."""
    grid = {
        "kneighborsregressor__n_neighbors": [1, 3, 5, 10, 20, 40, 80],
        "kneighborsregressor__weights": ["uniform", "distance"],
    }
    return GridSearchCV(make_pipeline(StandardScaler(), KNeighborsRegressor()), grid, cv=FOLDS)


def network(random_state: int = 0) -> GridSearchCV:
    """Two hidden layers, their width and the weight decay by cross-validation."""
    model = MLPRegressor(max_iter=400, early_stopping=True, n_iter_no_change=20, random_state=random_state)
    scaled = TransformedTargetRegressor(make_pipeline(StandardScaler(), model), transformer=StandardScaler())
    grid = {
        "regressor__mlpregressor__hidden_layer_sizes": [(32, 32), (100, 100)],
        "regressor__mlpregressor__alpha": [1e-4, 1e-2, 1.0],
    }
    return GridSearchCV(scaled, grid, cv=FOLDS)
