"""What a planner knows: local forward models, the desired next state, and the bounds that each state keeps.

All three are locally weighted. At features x, with probabilities Q of the contact states, sample i of
the demonstrations has the weight

    w_i = exp(-|x - x_i|^2 / 2 h^2) sum_k Q_k P_ik.

* *Forward model.* The change of the loads over one horizon is linear in the own motion u of that time, with the
  coefficients of `skill.regression.response_model`: l' = l + a + B u.
* *Desired next state.* The weights vote for the state that follows, each vote times the value of that state
  (`StateGraph.values`: how probably and how soon it leads to insertion; bad demonstrations count in it). The weighted
  mean of the samples that the winner follows gives the wrench with which it begins, and the time until then.
* *Bounds.* In each state, the good demonstrations keep each load between two quantiles, ``BOUNDS``.

Bad demonstrations teach the forward model and the values, not the bounds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted

from skill.arrays import Array, standard_scale
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays
from skill.planning.prediction import DesiredState
from skill.planning.transitions import Transitions
from skill.regression.response_model import (
    RESPONSE_RULES,
    ResponseModel,
    ResponseSamples,
    response_arrays,
    restored_responses,
)

MAX_LOAD = 40.0
"""N; the samples with a larger load, or change of a load, are impacts and jams of bad demonstrations, which the guard
of the rig does not allow."""

FORCES = [0, 1, 4]
"""The components of the ``LOADS`` that are forces. A moment is large without a jam where its lever is long."""

LEAST_LOG_WEIGHT = -20.0
"""Logarithm of the least weight of a vote, relative to the greatest. Without it, samples of other states would decide
where no follower of the present state has a value."""

VALUE_TIME = 2.0
"""tau of the values of the states, s: about the time of an insertion."""

BOUNDS = (0.025, 0.975)
"""Quantiles of the loads of good demonstrations, between which the planner tries to keep."""

RULES = {
    "bandwidth": ArrayRule(low=MIN_POSITIVE),
    **RESPONSE_RULES,
    "largest_input": ArrayRule(("q",), low=MIN_POSITIVE),
    "next_states": ArrayRule(("n",), holds="integers", low=0),
    "changes": ArrayRule(("n", "p")),
    "times": ArrayRule(("n",), low=0.0),
    "memberships": ArrayRule(("n", "K"), low=0.0, high=1.0 + 1e-6),
    "values": ArrayRule(("V",), low=0.0, high=1.0),
    "lower": ArrayRule(("K", "p")),
    "upper": ArrayRule(("K", "p")),
}
"""The arrays of a stored `PlanningModel`: n samples, K states."""


class PlanningModel(BaseEstimator):
    """The model of the module.

    Args:
        bandwidth: h, positive, in standard deviations of the features.

    Attributes:
        samples_: the forward model's features, inputs and outputs in units of their standard deviations.
        scales_: these standard deviations; ``centre_``: (5,), mean of the outputs, N.
        largest_input_: (3,), largest |u| of the samples: turn about x and y (rad) and feed (m).
        next_states_, changes_, times_: see `Transitions`.
        memberships_: (n, K), probabilities of the contact states.
        values_: (K + 2,), values of the states, of the insertion (1) and of another end (0).
        lower_, upper_: (K, 5), bounds of the loads in each state, N.
    """

    def __init__(self, *, bandwidth: float = 1.0) -> None:
        self.bandwidth = bandwidth

    def fit(self, rows: Transitions, *, memberships: ArrayLike, values: Array) -> Self:
        """Learns from transitions.

        Args:
            rows: n samples.
            memberships: (n, K), probabilities of the contact states.
            values: (K,), values of the states.

        Raises:
            ValueError: if no sample is good and below ``MAX_LOAD``.
        """
        P = np.asarray(memberships, dtype=float)
        kept = np.abs(np.hstack([rows.loads[:, FORCES], rows.outputs])).max(axis=1) <= MAX_LOAD
        shown = kept & rows.good
        if not shown.any():
            raise ValueError(f"no sample of a good demonstration with a load below {MAX_LOAD:g} N; expected some")
        X, U, Y = rows.features[kept], rows.inputs[kept], rows.outputs[kept]
        self.scales_ = standard_scale(X), standard_scale(U), standard_scale(Y)
        self.centre_ = Y.mean(axis=0)
        self.largest_input_ = np.maximum(np.abs(U).max(axis=0), MIN_POSITIVE)
        self.next_states_, self.changes_, self.times_ = rows.next_states[kept], rows.changes[kept], rows.times[kept]
        self.memberships_ = P[kept]
        self.values_ = np.concatenate([values, [1.0, 0.0]])
        weights = P[shown] + MIN_POSITIVE  # a state that no good demonstration visits has the bounds of all states
        bounds = [np.quantile(rows.loads[shown], BOUNDS, axis=0, weights=w, method="inverted_cdf") for w in weights.T]
        self.lower_, self.upper_ = np.moveaxis(np.array(bounds), 1, 0)
        self._store(ResponseSamples(X / self.scales_[0], U / self.scales_[1], (Y - self.centre_) / self.scales_[2]))
        return self

    def log_weights(self, features: Array, states: Array) -> Array:
        """Returns the logarithms of the weights (n,) of the samples at features (d,) with state probabilities (K,)."""
        distance = ((self.samples_.X - features / self.scales_[0]) ** 2).sum(axis=1)
        shared = np.maximum(self.memberships_ @ states, np.finfo(float).tiny)
        found: Array = np.log(shared) - distance / (2.0 * self.bandwidth**2)
        return found

    def forward(self, log_weights: Array) -> tuple[Array, Array]:
        """Returns a (5,), N, and B (5, 3), N/rad and N/m: the change of the loads over one horizon is a + B u."""
        found = self._model.coefficients(np.exp(log_weights)[None])[0]
        _, of_U, of_Y = self.scales_
        return self.centre_ + of_Y * found[0], of_Y[:, None] * found[1:].T / of_U

    def desired(self, log_weights: Array) -> DesiredState:
        """Returns the desired next state."""
        relative = log_weights - log_weights.max()
        weights = np.where(relative > LEAST_LOG_WEIGHT, np.exp(relative), 0.0)
        votes = np.bincount(self.next_states_, weights, minlength=len(self.values_))
        worth = votes * self.values_
        if not worth.any():  # nothing leads to insertion from here: what the demonstrations do, then
            worth = votes
        state = int(worth.argmax())
        of_state = np.where(self.next_states_ == state, weights, 0.0)
        of_state /= of_state.sum()
        return DesiredState(
            state, float(worth[state] / worth.sum()), of_state @ self.changes_, float(of_state @ self.times_)
        )

    def bounds(self, states: Array) -> tuple[Array, Array]:
        """Returns the bounds (5,), (5,) of the loads, N, with state probabilities (K,)."""
        return states @ self.lower_, states @ self.upper_

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted model as plain arrays, which can be stored without pickle."""
        check_is_fitted(self)
        return {
            "bandwidth": np.array(float(self.bandwidth)),
            **response_arrays(self.samples_, self.scales_, self.centre_),
            "largest_input": self.largest_input_,
            "next_states": self.next_states_,
            "changes": self.changes_,
            "times": self.times_,
            "memberships": self.memberships_,
            "values": self.values_,
            "lower": self.lower_,
            "upper": self.upper_,
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores a model from ``to_arrays``; its plans are bit-identical.

        Raises:
            ValueError: if an array is missing, unknown, or does not fit the others.
        """
        sizes = check_arrays(arrays, RULES, "PlanningModel.to_arrays")
        if sizes["V"] != sizes["K"] + 2:
            raise ValueError(f"array 'values' has {sizes['V']} numbers, expected {sizes['K']} of states and 2 of ends")
        last = int(np.max(arrays["next_states"]))
        if last >= sizes["V"]:
            raise ValueError(f"array 'next_states' goes up to {last}, expected below {sizes['V']}")
        if (np.asarray(arrays["lower"]) > arrays["upper"]).any():
            raise ValueError("array 'lower' is above 'upper'")
        self = cls(bandwidth=float(arrays["bandwidth"]))
        samples, self.scales_, self.centre_ = restored_responses(arrays)
        self.largest_input_ = np.array(arrays["largest_input"], dtype=float)
        self.next_states_ = np.array(arrays["next_states"], dtype=np.intp)
        for name in ("changes", "times", "memberships", "values", "lower", "upper"):
            setattr(self, f"{name}_", np.array(arrays[name], dtype=float))
        self._store(samples)
        return self

    def _store(self, samples: ResponseSamples) -> None:
        self.samples_ = samples
        self._model = ResponseModel(samples)
