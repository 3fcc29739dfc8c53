"""Imitation: the action of the good demonstrations in the same situation.

A regression over the demonstrated samples gives the action. Two things are made safe that a regression does not know:

* The context is followed only as far as it matters here (`skill.regression.partial_pooling`).
* A turn is not extrapolated. A jammed rig meets larger loads than any demonstration, and the slope of a local linear
  model, continued there, can cancel or even reverse a turn on which most demonstrations nearby agree. Each turn stays
  within the central half of what the neighbours did, from the first to the third quartile of their turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skill.arrays import Array
from skill.planning.prediction import Prediction, Query
from skill.regression.partial_pooling import relevance
from skill.regression.protocols import LocalRegressor, Regressor, StateRegressor
from skill.states.context_filter import pair_probabilities
from skill.states.context_mixture import ContextMixture

TURNS = slice(0, 2)
"""The outputs of the regressor that are turns."""

LOW_SUPPORT_SHARE = 0.01
"""Share of the demonstrated samples whose support, from the other demonstrations, counts as low."""


@dataclass(frozen=True)
class Imitation:
    """Predicts actions from demonstrated samples.

    Attributes:
        regressor: the fitted regressor of the actions.
        sources: (n, 2), demonstration number and time (s) of each of its samples.
        contexts: the contexts of the demonstrations; None if there is one.
        min_log_support: logarithm of the kernel weight below which support is low.
    """

    regressor: Regressor
    sources: Array
    contexts: ContextMixture | None
    min_log_support: float

    def predict(self, query: Query) -> Prediction:
        """Returns the prediction for one query."""
        regressor, (_, X, P, Q) = self.regressor, query
        if isinstance(regressor, LocalRegressor):
            followed, matters = self._followed(regressor, X, P, Q)
            samples = regressor.local_samples(X, pair_probabilities(P, followed))
            predicted = regressor.predict_from(samples)
            low, high = quartiles(regressor.y_[samples.rows, TURNS], samples.weights)
            action = predicted.copy()
            action[TURNS] = np.clip(predicted[TURNS], low, high)
            # Not to know the context, or not to need it, is no lack of samples.
            support = self._support(samples.log_w_max, followed.max())
            limited = bool((action != predicted).any())
            return Prediction(action, support, followed, matters, limited, samples)
        if isinstance(regressor, StateRegressor):
            predictions, log_support = regressor.predict_with_support(X, pair_probabilities(P, Q))
            return Prediction(predictions[0], self._support(float(log_support[0]), 1.0), Q, 1.0, limited=False)
        return Prediction(np.asarray(regressor.predict(X))[0], 1.0, Q, 0.0, limited=False)

    def _support(self, log_support: float, share: float) -> float:
        return math.exp(-max(0.0, self.min_log_support + math.log(share) - log_support))

    def _followed(self, regressor: LocalRegressor, X: Array, P: Array, Q: Array) -> tuple[Array, float]:
        """The contexts (1, C) that a query follows, and the relevance of the context."""
        if self.contexts is None:
            return Q, 1.0
        any_context = np.full_like(Q, 1.0 / Q.size)
        samples = regressor.local_samples(X, pair_probabilities(P, any_context))
        numbers = self.sources[samples.rows, 0]
        memberships = self.contexts.probabilities_of(numbers)
        matters = relevance(samples.weights, regressor.y_[samples.rows, TURNS], numbers, memberships)
        return matters * Q + (1.0 - matters) * any_context, matters


def quartiles(values: Array, weights: Array) -> tuple[Array, Array]:
    """Returns the first and third quartile (p,) of values (k, p) with weights (k,)."""
    low, high = np.quantile(values, [0.25, 0.75], axis=0, weights=weights, method="inverted_cdf")
    return low, high


def lowest_log_support(regressor: Regressor, demonstrations: Array) -> float:
    """Returns the logarithm of the kernel weight below which support is low.

    A share ``LOW_SUPPORT_SHARE`` of the samples find less in the other demonstrations. It is -inf for a regressor that
    does not report its support, for a single demonstration, and where more samples than that find nothing at all.

    Args:
        regressor: the fitted regressor.
        demonstrations: (n,), the number of the demonstration of each sample.
    """
    if not isinstance(regressor, StateRegressor) or len(np.unique(demonstrations)) < 2:
        return -math.inf
    with np.errstate(invalid="ignore"):  # between -inf and another number the quantile is NaN
        lowest = float(np.quantile(regressor.support_between(demonstrations), LOW_SUPPORT_SHARE))
    return -math.inf if math.isnan(lowest) else lowest
