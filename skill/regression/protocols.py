"""What a `ManipulationSkill` needs of a regressor, and how one of this package explains a prediction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

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
