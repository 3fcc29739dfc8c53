"""What a planner knows: local forward models, the desired next state, and the bounds that each state keeps.

All three are locally weighted. At features x, with probabilities Q of the contact states, sample i of the
demonstrations has the weight

    w_i = exp(-|x - x_i|^2 / 2 h^2) sum_k Q_k P_ik.

* *Forward model.* The change y of the loads over one horizon is linear in the own motion u of that time. With
  a = (1, u), the coefficients are those of the weighted ridge regression on the samples near x (a varying-coefficient
  model: Hastie, Tibshirani, J. R. Stat. Soc. B 55(4), 1993),

      y = B'a + e,    B = (sum_i w_i a_i a_i' + n_0 I)^-1 sum_i w_i a_i y_i'.

  Features, motions and changes are in units of their standard deviations over all samples, so that n_0 acts like n_0
  samples with the mean and the spread of all: far from all samples, the prediction is the mean of all samples.
* *Desired next state.* The weights vote for the state that follows, each vote times the value of that state
  (`StateGraph.values`: how probably and how soon it leads to insertion; bad demonstrations count in it). The weighted
  mean of the samples that the winner follows gives the wrench with which it begins, and the time until then.
* *Bounds.* In each state, the good demonstrations keep each load between two quantiles, ``BOUNDS``.

Bad demonstrations teach the forward model and the values, not the bounds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array, standard_scale
from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays
from skill.policy.prediction import DesiredState
from skill.policy.transitions import FORCES, Transitions

PRIOR_SAMPLES = 3.0
"""n_0. The choice matters only where the weights add up to a few samples."""

MAX_LOAD = 40.0
"""N; the samples with a larger load, or change of a load, are impacts and jams of bad demonstrations, which the guard
of the rig does not allow. A moment is large without a jam where its lever is long, so that only forces count."""

LEAST_LOG_WEIGHT = -20.0
"""Logarithm of the least weight of a vote, relative to the greatest. Without it, samples of other states would decide
where no follower of the present state has a value."""

VALUE_TIME = 2.0
"""tau of the values of the states, s: about the time of an insertion."""

BOUNDS = (0.025, 0.975)
"""Quantiles of the loads of good demonstrations, between which the planner tries to keep."""

RULES = {
    "bandwidth": ArrayRule(low=MIN_POSITIVE),
    "features": ArrayRule(("n", "d")),
    "inputs": ArrayRule(("n", "q")),
    "outputs": ArrayRule(("n", "p")),
    "feature_spread": ArrayRule(("d",), low=MIN_POSITIVE),
    "input_spread": ArrayRule(("q",), low=MIN_POSITIVE),
    "output_spread": ArrayRule(("p",), low=MIN_POSITIVE),
    "output_mean": ArrayRule(("p",)),
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


@dataclass(frozen=True)
class PlanningModel:
    """The model of the module.

    Attributes:
        bandwidth: h, in standard deviations of the features; a scalar array.
        features, inputs, outputs: (n, d), (n, 3), (n, 5), of the forward model, in units of their standard deviations.
        feature_spread, input_spread, output_spread: these standard deviations, (d,), (3,), (5,).
        output_mean: (5,), N, which is subtracted from the outputs.
        largest_input: (3,), largest |u| of the samples: turn about x and y (rad) and feed (m).
        next_states, changes, times: see `Transitions`.
        memberships: (n, K), probabilities of the contact states.
        values: (K + 2,), values of the states, of the insertion (1) and of another end (0).
        lower, upper: (K, 5), bounds of the loads in each state, N.
    """

    bandwidth: Array
    features: Array
    inputs: Array
    outputs: Array
    feature_spread: Array
    input_spread: Array
    output_spread: Array
    output_mean: Array
    largest_input: Array
    next_states: NDArray[np.intp]
    changes: Array
    times: Array
    memberships: Array
    values: Array
    lower: Array
    upper: Array

    @classmethod
    def learnt(
        cls, rows: Transitions, *, features: Array, memberships: Array, values: Array, bandwidth: float = 1.0
    ) -> Self:
        """Learns from transitions.

        Args:
            rows: n samples.
            features: (n, d), their features.
            memberships: (n, K), probabilities of the contact states.
            values: (K,), values of the states.
            bandwidth: h.

        Raises:
            ValueError: if no sample is good and below ``MAX_LOAD``.
        """
        kept = np.abs(np.hstack([rows.loads[:, FORCES], rows.outputs])).max(axis=1) <= MAX_LOAD
        shown = kept & rows.good
        if not shown.any():
            raise ValueError(f"no sample of a good demonstration with a load below {MAX_LOAD:g} N; expected some")
        X, U, Y = features[kept], rows.inputs[kept], rows.outputs[kept]
        scale_X, scale_U, scale_Y, centre = standard_scale(X), standard_scale(U), standard_scale(Y), Y.mean(axis=0)
        weights = memberships[shown] + MIN_POSITIVE  # a state that no good one visits has the bounds of all states
        bounds = [np.quantile(rows.loads[shown], BOUNDS, axis=0, weights=w, method="inverted_cdf") for w in weights.T]
        lower, upper = np.moveaxis(np.array(bounds), 1, 0)
        return cls(
            bandwidth=np.array(bandwidth),
            features=X / scale_X,
            inputs=U / scale_U,
            outputs=(Y - centre) / scale_Y,
            feature_spread=scale_X,
            input_spread=scale_U,
            output_spread=scale_Y,
            output_mean=centre,
            largest_input=np.maximum(np.abs(U).max(axis=0), MIN_POSITIVE),
            next_states=rows.next_states[kept],
            changes=rows.changes[kept],
            times=rows.times[kept],
            memberships=memberships[kept],
            values=np.concatenate([values, [1.0, 0.0]]),
            lower=lower,
            upper=upper,
        )

    def log_weights(self, features: Array, states: Array) -> Array:
        """Returns the logarithms of the weights (n,) of the samples at features (d,) with state probabilities (K,)."""
        distance = ((self.features - features / self.feature_spread) ** 2).sum(axis=1)
        shared = np.maximum(self.memberships @ states, np.finfo(float).tiny)
        found: Array = np.log(shared) - distance / (2.0 * float(self.bandwidth) ** 2)
        return found

    @cached_property
    def _moments(self) -> Array:
        """(n, f), of each sample: a a' and a y'."""
        A, n = np.column_stack([np.ones(len(self.inputs)), self.inputs]), len(self.inputs)
        own, answers = A[:, :, None] * A[:, None, :], A[:, :, None] * self.outputs[:, None, :]
        return np.hstack([own.reshape(n, -1), answers.reshape(n, -1)])

    def forward(self, log_weights: Array) -> tuple[Array, Array]:
        """Returns a (5,), N, and B (5, 3), N/rad and N/m: the change of the loads over one horizon is a + B u."""
        q, p = 1 + len(self.input_spread), len(self.output_spread)
        sums = np.exp(log_weights)[None] @ self._moments
        S = sums[:, : q * q].reshape(-1, q, q) + PRIOR_SAMPLES * np.eye(q)
        found = np.linalg.solve(S, sums[:, q * q :].reshape(-1, q, p))[0]
        drift = self.output_mean + self.output_spread * found[0]
        return drift, self.output_spread[:, None] * found[1:].T / self.input_spread

    def desired(self, log_weights: Array) -> DesiredState:
        """Returns the desired next state."""
        relative = log_weights - log_weights.max()
        weights = np.where(relative > LEAST_LOG_WEIGHT, np.exp(relative), 0.0)
        votes = np.bincount(self.next_states, weights, minlength=len(self.values)).astype(float)
        worth = votes * self.values
        if not worth.any():  # nothing leads to insertion from here: what the demonstrations do, then
            worth = votes
        state = int(worth.argmax())
        of_state = np.where(self.next_states == state, weights, 0.0)
        of_state /= of_state.sum()
        share = float(worth[state] / worth.sum())
        return DesiredState(state, share, of_state @ self.changes, float(of_state @ self.times))

    def bounds(self, states: Array) -> tuple[Array, Array]:
        """Returns the bounds (5,), (5,) of the loads, N, with state probabilities (K,)."""
        return states @ self.lower, states @ self.upper

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The model as plain arrays, which can be stored without pickle."""
        return {name: getattr(self, name) for name in RULES}

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
        return cls(**{name: np.asarray(arrays[name]) for name in RULES})
