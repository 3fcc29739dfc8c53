"""The policy update: it corrects the stored actions of a skill by advantage-weighted regression.

Let G_t be the cost of a trial from a moment t to its end. Let V(x) and s(x) be the mean and the standard deviation of
that cost at features x, from a locally weighted regression over all rollouts. The advantage

    z_t = (V(x_t) - G_t) / s(x_t)

is the cost saved relative to the expected cost, in units of its usual variation at x. Each row has the weight
w = exp(z). The logarithm of each stored action at x changes by

    E_w[g | x] - E[g | x],

the local mean of the logarithms g of the factors with the weights w, minus the local mean without weights. The action
moves towards factors that cost less than expected. Where no factors were applied, or where they made no difference, it
stays the same. This is the weighted regression of the sources below, applied to the correction instead of the action.

The perturbed actions are not stored as additional samples, for two reasons. They are predictions from the same stored
samples, smoothed once more. And slow trials would contribute more samples than fast ones. Both reduce the turn.

Sources: Peters, Schaal, "Reinforcement learning by reward-weighted regression for operational space control", ICML
2007; Peng, Kumar, Zhang, Levine, "Advantage-weighted regression", arXiv 1910.00177, 2019. Their advantage is not
divided by s(x); here it is, because costs vary ten times more at the mouth than near the bottom.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from sklearn.base import clone

from skill.arrays import Array
from skill.manipulation_skill import ManipulationSkill
from skill.planning.imitation import FEED, N_TURNS
from skill.practice.exploration import Rollout
from skill.regression.locally_weighted_regression import LWRegressor

MIN_SPREAD = 1e-3  # in units of s; lower bound of the standard deviation of costs


LARGEST_ADVANTAGE = 2.0
"""Largest |z|; it limits the influence of a single trial."""

BANDWIDTH_FACTOR = 2.0
"""Bandwidth of the kernel that averages the factors, relative to that of the skill. It is larger than 1 because factors
vary over millimetres of depth and come from few trials."""


def advantages(rollouts: Sequence[Rollout], regressor: LWRegressor) -> Array:
    """Returns the advantages z (n,) of all rows of the rollouts; they are zero where all costs are the same.

    Args:
        rollouts: practice trials of one skill with perturbations.
        regressor: the regressor of that skill; V and s use its kernel.
    """
    X, P = _features_and_memberships(rollouts)
    G = np.concatenate([rollout.costs_to_go for rollout in rollouts])
    expected = clone(regressor).set_params(feature_scale=regressor.feature_scale_).fit(X, G, memberships=P)
    local = expected.predict_local(X, P)
    z: Array = (local.mean[:, 0] - G) / np.maximum(local.standard_deviation()[:, 0], MIN_SPREAD)
    return z


def advantage_weighted_update(skill: ManipulationSkill, rollouts: Sequence[Rollout]) -> ManipulationSkill:
    """Returns a skill with corrected actions; ``skill`` is not changed.

    Args:
        skill: the skill that was perturbed; its regressor is a `LWRegressor` with states.
        rollouts: practice trials of that skill.

    Raises:
        ValueError: if there are no rollouts, or the regressor is of another kind.
    """
    old = skill.regressor_
    if not rollouts:
        raise ValueError("there are no rollouts to learn from; expected at least one practice trial")
    if not isinstance(old, LWRegressor) or old.memberships_ is None:
        raise ValueError(f"the regressor of the skill is {old}; expected a LWRegressor that was fitted with states")
    weights = np.exp(np.clip(advantages(rollouts, old), -LARGEST_ADVANTAGE, LARGEST_ADVANTAGE))
    X, P = _features_and_memberships(rollouts)
    g = np.vstack([rollout.log_factors for rollout in rollouts])
    mean = LWRegressor(
        bandwidth=BANDWIDTH_FACTOR * old.bandwidth_,
        degree=0,
        n_neighbors=None,
        feature_scale=old.feature_scale_,
    )
    stored = old.X_ / old.feature_scale_
    weighted, unweighted = (
        mean.fit(X, g, memberships=P, sample_weight=w).predict(stored, memberships=old.memberships_)
        for w in (weights, None)
    )
    turn, feed = np.exp(weighted - unweighted).T
    factors = np.ones_like(old.y_)
    factors[:, :N_TURNS], factors[:, FEED] = turn[:, None], feed
    updated = copy.copy(skill)
    updated.regressor_ = LWRegressor.from_arrays({**old.to_arrays(), "y": old.y_ * factors})
    updated.metadata_ = {
        **skill.metadata_,
        "practice_trials": skill.metadata_.get("practice_trials", 0) + len(rollouts),
    }
    return updated


def _features_and_memberships(rollouts: Sequence[Rollout]) -> tuple[Array, Array]:
    """Returns the features (n, d) and memberships (n, K) of all rows."""
    return np.vstack([r.features for r in rollouts]), np.vstack([r.memberships for r in rollouts])
