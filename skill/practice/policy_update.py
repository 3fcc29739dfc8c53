"""What practice leaves in the memory: remembered actions are corrected by what went better than was to be expected.

Let G_t be what a trial still cost from a moment on, and V(x) and s(x) the mean and the standard deviation of that cost
where x is felt, by a locally weighted regression over all that was tried. Then

    z_t = (V(x_t) - G_t) / s(x_t)

is how much better than expected it went from there, in units of what is usual there. What went well counts with the
weight w = exp(k z), and the logarithm of each remembered action at x grows by

    E_w[g | x] - E[g | x],

the local mean of the logarithms g of the factors that were tried, weighted and not: in similar circumstances the action
moves towards what went well and away from what went ill; where nothing was tried, or where it made no difference, it
stays. That is the weighted regression of the sources below, of the correction instead of the action. To add the
actions that were tried to the memory as samples of their own would not do: they are predictions of the same
memory, smoothed once more, and slow trials would leave more of them than fast ones; both shrink the turn.

Source: Peters, Schaal, "Reinforcement learning by reward-weighted regression for operational space control", ICML 2007;
Peng, Kumar, Zhang, Levine, "Advantage-weighted regression", arXiv 1910.00177, 2019, whose advantage has no s(x). It is
here because costs spread tenfold more at the mouth than near the bottom.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.base import clone

from skill.arrays import Array
from skill.manipulation_skill import ManipulationSkill
from skill.practice.exploration import Rollout
from skill.regression.locally_weighted_regression import LWRegressor

SAME = 1e-3  # in units of s; costs that spread less than this are the same


@dataclass(frozen=True)
class AdvantageWeighting:
    """How experience becomes memory.

    Attributes:
        greed: k, of the weights.
        most: |z| beyond this counts as this, so that no single trial rules.
        breadth: of the kernel that a correction is averaged with, over that of the skill; a factor is tried over
            millimetres of depth and in few trials.
    """

    inverse_temperature: float = 1.0
    advantage_clip: float = 2.0
    bandwidth_factor: float = 2.0


def advantages(rollouts: Sequence[Rollout], regressor: LWRegressor) -> Array:
    """The z (n,) of all rows of the experiences; zero where costs never varied.

    Args:
        rollouts: practice trials of one skill and its perturbations.
        regressor: whose notion of similarity, its kernel, V and s share.
    """
    X, P = _felt(rollouts)
    G = np.concatenate([e.costs_to_go for e in rollouts])
    expected = clone(regressor).set_params(feature_scale=regressor.feature_scale_).fit(X, G, memberships=P)
    V, s = expected.predict(X, memberships=P, return_std=True)
    z: Array = (V - G) / np.maximum(s, SAME)
    return z


def advantage_weighted_update(
    skill: ManipulationSkill, rollouts: Sequence[Rollout], weighting: AdvantageWeighting
) -> ManipulationSkill:
    """A skill that has learnt from practice; ``skill`` is not changed. Only the remembered actions differ.

    Args:
        skill: that was practised; its regressor is a `LWRegressor` with states.
        rollouts: practice trials of perturbations of it.
        weighting: how the rollouts are weighted.

    Raises:
        ValueError: if there is no experience, or the regressor is of another kind.
    """
    old = skill.regressor_
    if not rollouts:
        raise ValueError("no experience to learn from; expected at least one practice trial")
    if not isinstance(old, LWRegressor) or old.memberships_ is None:
        raise ValueError(f"the skill's regressor is {old}; expected a LWRegressor that was given states")
    z = advantages(rollouts, old)
    weights = np.exp(weighting.inverse_temperature * np.clip(z, -weighting.advantage_clip, weighting.advantage_clip))
    X, P = _felt(rollouts)
    g = np.vstack([e.tried for e in rollouts])
    mean = LWRegressor(
        bandwidth=weighting.bandwidth_factor * old.bandwidth,
        degree=0,
        n_neighbors=None,
        feature_scale=old.feature_scale_,
    )
    remembered = old.X_ / old.feature_scale_
    went_well, was_tried = (
        mean.fit(X, g, memberships=P, sample_weight=w).predict(remembered, memberships=old.memberships_)
        for w in (weights, None)
    )
    turn, feed = np.exp(went_well - was_tried).T
    learnt = copy.copy(skill)
    learnt.regressor_ = LWRegressor.from_arrays({**old.to_arrays(), "y": old.y_ * np.column_stack([turn, turn, feed])})
    learnt.metadata_ = {
        **skill.metadata_,
        "practice_trials": skill.metadata_.get("practice_trials", 0) + len(rollouts),
    }
    return learnt


def _felt(rollouts: Sequence[Rollout]) -> tuple[Array, Array]:
    """Features (n, d) and memberships (n, K) of all rows."""
    return np.vstack([e.features for e in rollouts]), np.vstack([e.memberships for e in rollouts])
