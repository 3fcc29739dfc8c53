"""What a regressor can offer to a `ManipulationSkill`, beyond ``fit`` and ``predict`` of scikit-learn."""

from __future__ import annotations

from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array
from skill.regression.explanation import Explanation


class Regressor(Protocol):
    """A regressor with several outputs, as in scikit-learn."""

    def fit(self, X: Array, y: Array) -> Any:
        """Fits outputs (n, p) to features (n, d)."""

    def predict(self, X: Array) -> Any:
        """Predicted outputs (m, p) at queries (m, d)."""


@runtime_checkable
class StateRegressor(Protocol):
    """A regressor that takes contact states into account, and reports how well samples support a prediction."""

    def fit(self, X: Array, y: Array, memberships: Array) -> Self:
        """Fits outputs (n, p) to features (n, d) of samples with contact-state probabilities (n, K)."""

    def predict_with_support(self, X: Array, memberships: Array) -> tuple[Array, Array]:
        """Predictions (m, p), and the logarithm of the greatest kernel weight (m,) of each query."""

    def support_between(self, groups: ArrayLike) -> Array:
        """Logarithm of the greatest kernel weight (n,) that each sample finds in the other groups (n,)."""


@runtime_checkable
class LocalRegressor(StateRegressor, Protocol):
    """A regressor that can tell which samples a prediction uses; ``y_`` (n, p) are the outputs of all."""

    y_: Array

    def local_samples(self, X: Array, memberships: Array) -> tuple[NDArray[np.intp], Array]:
        """Numbers (k,) of the samples near one query (1, d), and their kernel weights (k,)."""


@runtime_checkable
class ExplainableRegressor(Protocol):
    """A regressor that can explain a prediction."""

    def explain(self, x: Array, membership: Array, level: float) -> Explanation:
        """Explains the prediction at one query (d,) with contact-state probabilities (K,)."""
