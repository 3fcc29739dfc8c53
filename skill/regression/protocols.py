"""What a regressor can offer to a `ManipulationSkill`, beyond ``fit`` and ``predict`` of scikit-learn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array


@dataclass(frozen=True)
class Explanation:
    """Explanation of one prediction of a regressor.

    Attributes:
        neighbours: (k,), row numbers of the training samples, in order of decreasing weight.
        weights: (k,), their kernel weights, including the probability of a shared state, over the greatest.
        influence: (k,), the equivalent kernel: the prediction is sum_i influence_i y_i.
        prediction: (p,), the predicted outputs.
        lower: (p,), lower bound of the prediction interval.
        upper: (p,), upper bound of the prediction interval.
        level: nominal coverage of the interval.
        support: effective number of samples: the sum of ``weights``.
        log_w_max: logarithm of the greatest kernel weight; very negative far from all samples.
    """

    neighbours: NDArray[np.intp]
    weights: Array
    influence: Array
    prediction: Array
    lower: Array
    upper: Array
    level: float
    support: float
    log_w_max: float


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
class ExplainableRegressor(Protocol):
    """A regressor that can explain a prediction."""

    def explain(self, x: Array, membership: Array, level: float) -> Explanation:
        """Explains the prediction at one query (d,) with contact-state probabilities (K,)."""
