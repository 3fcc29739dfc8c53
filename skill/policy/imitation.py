"""Imitation: the action of the good demonstrations in the same situation.

A regression over the demonstrated samples gives the action, but a turn is not extrapolated. A jammed rig meets larger
loads than any demonstration, and the slope of a local linear model, continued there, can cancel or even reverse a turn
on which most demonstrations nearby agree. Each turn stays within the central half of what the neighbours did, from the
first to the third quartile of their turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compiled import compiled, compiled_within
from skill.arrays import Array
from skill.policy.prediction import NearSamples, Prediction, Query
from skill.regression.local_model import local_prediction
from skill.regression.locally_weighted_regression import MAX_QUERY, LWRegressor
from skill.regression.neighbourhood import RegressionNumbers
from skill.regression.protocols import Regressor

N_TURNS, FEED, SPIN = 2, 2, 3
"""Places of the outputs of the regressor: first turns about x and y, then the feed, and last the turn about z if the
demonstrations turn there."""

LOW_SUPPORT_SHARE = 0.01
"""Share of the demonstrated samples whose support, from the other demonstrations, counts as low."""


@dataclass(frozen=True)
class Imitation:
    """Predicts actions from demonstrated samples.

    Attributes:
        regressor: the fitted regressor of the actions.
        sources: (n, 2), demonstration number and time (s) of each of its samples.
        min_log_support: logarithm of the kernel weight below which support is low.
    """

    regressor: Regressor
    sources: Array
    min_log_support: float

    @cached_property
    def numbers(self) -> ImitationNumbers:
        """The demonstrated samples for compiled functions; the regressor is a `LWRegressor`."""
        assert isinstance(self.regressor, LWRegressor)
        return ImitationNumbers(self.regressor.numbers(), float(self.min_log_support))

    def predict(self, query: Query) -> Prediction:
        """Returns the prediction for one query."""
        regressor, (_, X, P) = self.regressor, query
        if isinstance(regressor, LWRegressor):
            shared = self.numbers.regressor.search.memberships.shape[1]
            if P.size != shared:
                raise ValueError(f"an estimate of {P.size} contact states; expected the {shared} of the skill")
            found = imitate(self.numbers, X[0], np.array(P[0]))
            return Prediction(found.action, found.support, found.limited, NearSamples(found.rows, found.weights))
        return Prediction(np.asarray(regressor.predict(X))[0], 1.0, limited=False)


class ImitationNumbers(NamedTuple):
    """An `Imitation` for compiled functions.

    Attributes:
        regressor: of the actions.
        min_log_support: see `Imitation`.
    """

    regressor: RegressionNumbers
    min_log_support: float


class Imitated(NamedTuple):
    """What the demonstrations do at one query; see `Prediction`.

    Attributes:
        action: (3,) or (4,).
        support: 0 to 1.
        limited: whether a turn was limited.
        rows: (k,), the samples nearby.
        weights: (k,), their weights, over the greatest.
    """

    action: Array
    support: float
    limited: bool
    rows: NDArray[np.intp]
    weights: Array


@compiled_within
def imitate(p: ImitationNumbers, x: Array, states: Array) -> Imitated:
    """Returns what the demonstrations do at features (d,) in states of the probabilities (K,)."""
    query = np.empty(len(x))
    for i in range(len(x)):
        query[i] = min(max(x[i] * p.regressor.feature_scale[i], -MAX_QUERY), MAX_QUERY)
    action, rows, weights, log_support = local_prediction(p.regressor, query, states)
    limited = False
    for i in range(len(action)):
        if i == FEED:
            continue
        low, high = quartiles_of(p.regressor.y[rows, i], weights)
        turn = min(max(action[i], low), high)
        limited = limited or turn != action[i]
        action[i] = turn
    return Imitated(action, support_of(p.min_log_support, log_support), limited, rows, weights)


@compiled_within
def support_of(min_log_support: float, log_support: float) -> float:
    """Returns the support, 0 to 1, of a greatest log weight."""
    return math.exp(-max(0.0, min_log_support - log_support))


@compiled
def quartiles_of(values: Array, weights: Array) -> tuple[float, float]:
    """Returns the first and third quartile of values (k,) with weights (k,): values of the inverse distribution."""
    order, total, low, high = np.argsort(values), 0.0, 0, 0
    sums = np.empty(len(values))
    for i in range(len(values)):
        total += weights[order[i]]
        sums[i] = total
    for i in range(len(values) - 1):
        low += sums[i] / total < 0.25
        high += sums[i] / total < 0.75
    return values[order[low]], values[order[high]]


def lowest_log_support(regressor: Regressor, demonstrations: Array) -> float:
    """Returns the logarithm of the kernel weight below which support is low.

    A share ``LOW_SUPPORT_SHARE`` of the samples find less in the other demonstrations. It is -inf for a regressor that
    does not report its support, for a single demonstration, and where more samples than that find nothing at all.

    Args:
        regressor: the fitted regressor.
        demonstrations: (n,), the number of the demonstration of each sample.
    """
    if not isinstance(regressor, LWRegressor) or len(np.unique(demonstrations)) < 2:
        return -math.inf
    with np.errstate(invalid="ignore"):  # between -inf and another number the quantile is NaN
        lowest = float(np.quantile(regressor.support_between(demonstrations), LOW_SUPPORT_SHARE))
    return -math.inf if math.isnan(lowest) else lowest
