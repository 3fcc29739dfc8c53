"""Parts of skills to compare in sweeps: other regressors and states, and other choices of demonstrations.

All get the same features and samples. The samples are ordered by demonstration, so that folds without shuffling hold
out whole demonstrations, except for those at the edges of a fold; every regressor chooses its parameters by
cross-validation over such folds. Features and outputs are standardised where the regressor depends on their units.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
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

from benchmarks.rig.gaussian_mixture_regression import best_mixture, gmr_predict
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.gaussian_components import GaussianComponents
from skill.clustering.gaussian_states import GaussianStates
from skill.data.demonstration import Demonstration
from skill.manipulation_skill import ManipulationSkill
from skill.policy.imitation import Imitation, support_of
from skill.policy.prediction import Prediction, Query
from skill.policy.rig_policy import Action
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.estimate import Estimate

FOLDS = KFold(5)
MAX_GP_SAMPLES = 1500  # the cost of a Gaussian process grows with their cube
MAX_COMPONENTS = 30  # of the mixtures from which BIC chooses

Demonstrations = list[Demonstration]


def one_state() -> CompetitiveAgglomeration:
    """A single contact state; its gate still detects measurements unlike those of the demonstrations."""
    return CompetitiveAgglomeration(m_init=1)


def bad_left_out(demonstrations: Demonstrations) -> Demonstrations:
    """Chooses the good demonstrations."""
    return [d for d in demonstrations if d.good]


def bad_imitated(demonstrations: Demonstrations) -> Demonstrations:
    """Chooses all demonstrations and labels them good."""
    return [replace(d, good=True) for d in demonstrations]


def clocking_left_out(demonstrations: Demonstrations) -> Demonstrations:
    """Chooses all demonstrations, without the turns about the axis: their skill does not move the clocking stage."""
    return [replace(d, metadata={**d.metadata, "clocking": False}) for d in demonstrations]


def _mixture(Z: Array, random_state: int) -> GaussianMixture:
    """The mixture of smallest BIC with at most 30 components and at least 2 d samples per component."""
    most = min(MAX_COMPONENTS, len(Z) // (2 * Z.shape[1]))
    return best_mixture(Z, most, reg_covar=1e-4, random_state=random_state)


class MixtureRegressor(RegressorMixin, BaseEstimator):
    """Gaussian mixture regression (`gmr_predict`); the mixture of inputs and outputs is chosen by BIC."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: Array, y: Array) -> Self:
        """Fits inputs X (n, d) and outputs y (n, p)."""
        self.x_, self.y_ = StandardScaler().fit(X), StandardScaler().fit(y)
        self.mixture_ = _mixture(np.hstack([self.x_.transform(X), self.y_.transform(y)]), self.random_state)
        self.n_features_in_ = X.shape[1]
        return self

    def predict(self, X: Array) -> Array:
        """Outputs (n, p) for inputs (n, d)."""
        m, d = self.mixture_, self.n_features_in_
        outputs = np.arange(d, m.means_.shape[1])
        scaled = gmr_predict(m.means_, m.covariances_, m.weights_, self.x_.transform(X), np.arange(d), outputs)
        return np.asarray(self.y_.inverse_transform(scaled))


class SubsetGaussianProcess(RegressorMixin, BaseEstimator):
    """A Gaussian process with one length scale per feature, on at most `MAX_GP_SAMPLES` random samples."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: Array, y: Array) -> Self:
        """Fits inputs X (n, d) and outputs y (n, p)."""
        rng = np.random.default_rng(self.random_state)
        kept = rng.permutation(len(X))[:MAX_GP_SAMPLES]
        kernel = ConstantKernel(1.0) * RBF(np.ones(X.shape[1]), (1e-2, 1e3)) + WhiteKernel(0.1)
        process = GaussianProcessRegressor(kernel, normalize_y=True, random_state=self.random_state)
        self.model_ = make_pipeline(StandardScaler(), process)
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", ConvergenceWarning
            )  # the length scale of an irrelevant feature ends at its bound
            self.model_.fit(X[kept], y[kept])
        return self

    def predict(self, X: Array) -> Array:
        """Outputs (n, p) for inputs (n, d)."""
        return np.asarray(self.model_.predict(X))


class MixtureStates(GaussianStates):
    """Contact states from a Gaussian mixture; BIC chooses their number, as if all samples were independent."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: Array, y: Any = None, groups: Any = None, phase: Any = None) -> Self:
        """Fits samples X (n, d); ``y``, ``groups`` and ``phase`` are ignored."""
        scaler = StandardScaler().fit(X)
        mixture = _mixture(scaler.transform(X), self.random_state)
        self.n_features_in_ = X.shape[1]
        scale = scaler.scale_
        self._set_states(
            GaussianComponents(
                mixture.weights_,
                scaler.inverse_transform(mixture.means_),
                scale[:, None] * mixture.covariances_ * scale,
            )
        )
        return self


class ShuffledNeighbour(RegressorMixin, BaseEstimator):
    """The action of a random demonstrated sample: a control in which states and features predict nothing."""

    def __init__(self, random_state: int = 0) -> None:
        self.random_state = random_state

    def fit(self, X: Array, y: Array) -> Self:
        """Fits inputs X (n, d) and shuffled outputs y (n, p)."""
        order = np.random.default_rng(self.random_state).permutation(len(y))
        self.model_ = make_pipeline(StandardScaler(), KNeighborsRegressor(1)).fit(X, y[order])
        return self

    def predict(self, X: Array) -> Array:
        """Outputs (n, p) for inputs (n, d)."""
        return np.asarray(self.model_.predict(X))


class RandomSign(ManipulationSkill):
    """The skill with a random sign of each turn: a control of what the direction of the turns is worth."""

    def act(self, measured: ArrayLike, estimate: Estimate | None = None) -> Action:
        """The action of the skill with a sign that the bits of the measurement decide."""
        action = super().act(measured, estimate)
        bits = np.asarray(measured, dtype=float).view(np.uint64)
        return replace(action, turn=np.random.default_rng(bits).choice([-1.0, 1.0]) * action.turn)


class BareImitation(Imitation):
    """Imitation that neither pools nor limits the turns."""

    def predict(self, query: Query) -> Prediction:
        """Returns what the regression says."""
        assert isinstance(self.regressor, LWRegressor)
        predictions, log_support = self.regressor.predict_with_support(query.X, query.P)
        return Prediction(predictions[0], support_of(self.min_log_support, float(log_support[0])), limited=False)


class Extrapolating(ManipulationSkill):
    """The skill that turns as the regression says, however far it extrapolates."""

    def imitation(self) -> Imitation:
        """What predicts the actions."""
        return BareImitation(self.regressor_, self.sources_, self.min_log_support_)


def nearest_neighbours() -> GridSearchCV:
    """Nearest neighbours; cross-validation chooses their number and weighting."""
    grid = {
        "kneighborsregressor__n_neighbors": [1, 3, 5, 10, 20, 40, 80],
        "kneighborsregressor__weights": ["uniform", "distance"],
    }
    return GridSearchCV(make_pipeline(StandardScaler(), KNeighborsRegressor()), grid, cv=FOLDS)


def network(random_state: int = 0) -> GridSearchCV:
    """A network with two hidden layers; cross-validation chooses their width and the weight decay."""
    model = MLPRegressor(max_iter=400, early_stopping=True, n_iter_no_change=20, random_state=random_state)
    scaled = TransformedTargetRegressor(make_pipeline(StandardScaler(), model), transformer=StandardScaler())
    grid = {
        "regressor__mlpregressor__hidden_layer_sizes": [(32, 32), (100, 100)],
        "regressor__mlpregressor__alpha": [1e-4, 1e-2, 1.0],
    }
    return GridSearchCV(scaled, grid, cv=FOLDS)
