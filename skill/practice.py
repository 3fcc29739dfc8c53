"""Practice: a skill explores in perturbed trials, and their costs correct its stored actions.

*Exploration.* A practice trial performs the skill with its turn and its feed multiplied by factors. The factors are
drawn anew for each trial and vary along the depth. The features, the factors and the cost of each moment form a
`Rollout`.

*Update.* Let G_t be the cost of a trial from a moment t to its end. Let V(x) and s(x) be the mean and the standard
deviation of that cost at features x, from a locally weighted regression over all rollouts. The advantage

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
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import clone

from compiled import compiled
from skill.arrays import Array
from skill.data.geometry import PegHoleGeometry
from skill.data.rig_run import RigRun
from skill.features.measurement import MEASURED, measurement, rig_observations
from skill.manipulation_skill import ManipulationSkill
from skill.policy.imitation import FEED, N_TURNS
from skill.policy.rig_policy import Action, PolicyT, WrappedPolicy
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.estimate import Estimate, estimates

LARGEST_TURN, LARGEST_FEED = 2.5, 1.5
"""Largest factors on turn and feed; the smallest are their reciprocals."""

KNOT_SPACING = 5e-3
"""Approximate distance of the knots of a perturbation along the depth, m."""

REFERENCE_FORCE = 25.0
"""Lateral force that doubles the cost of a step, N."""

FAILURE = 5.0
"""Cost of a failure, s."""

MIN_SPREAD = 1e-3  # in units of s; lower bound of the standard deviation of costs

LARGEST_ADVANTAGE = 2.0
"""Largest |z|; it limits the influence of a single trial."""

BANDWIDTH_FACTOR = 2.0
"""Bandwidth of the kernel that averages the factors, relative to that of the skill. It is larger than 1 because factors
vary over millimetres of depth and come from few trials."""


@dataclass(frozen=True)
class Perturbation:
    """Factors on the actions of a policy as functions of the depth.

    The logarithms of the factors are interpolated linearly between knots, and constant beyond the outermost knots.

    Attributes:
        depths: (k,), depths of the knots, m, increasing.
        turn: (k,), logarithm of the factor on the turn at each knot.
        feed: (k,), logarithm of the factor on the feed at each knot.
    """

    depths: Array
    turn: Array
    feed: Array

    def log_factors(self, depth: float | Array) -> Array:
        """Returns the logarithms of the factors on turn and feed, (..., 2), at depths (...), m."""
        return np.stack([np.interp(depth, self.depths, values) for values in (self.turn, self.feed)], axis=-1)

    def opposite(self) -> Perturbation:
        """Returns the perturbation with the reciprocal factors."""
        return Perturbation(self.depths, -self.turn, -self.feed)


def draw_perturbation(rng: np.random.Generator, full_depth: float) -> Perturbation:
    """Draws a perturbation with knots from the mouth to ``full_depth`` (m).

    The logarithms are uniform between the limits and independent from knot to knot. Their mean is zero, so that
    exploration alone does not shift the actions.
    """
    depths = np.linspace(0.0, full_depth, 1 + max(1, round(full_depth / KNOT_SPACING)))
    turn, feed = np.log([LARGEST_TURN, LARGEST_FEED])
    return Perturbation(depths, turn * rng.uniform(-1, 1, len(depths)), feed * rng.uniform(-1, 1, len(depths)))


@dataclass(frozen=True)
class PerturbedPolicy(WrappedPolicy[PolicyT]):
    """A policy whose turn and feed are multiplied by the factors of a perturbation.

    Attributes:
        perturbation: factors on its actions.
    """

    perturbation: Perturbation

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """Returns the action of the policy with its turn and feed multiplied by the factors at the measured depth."""
        action = self.policy.act(measured, estimate)
        p = self.perturbation
        turn, feed = factors_at(-float(np.asarray(measured)[-1]), p.depths, p.turn, p.feed)
        return replace(action, turn=turn * action.turn, feed=feed * action.feed)


@compiled
def factors_at(depth: float, depths: Array, turn: Array, feed: Array) -> tuple[float, float]:
    """Returns the factors on turn and feed at a depth, m; the arrays are those of a `Perturbation`."""
    return math.exp(interpolated(depth, depths, turn)), math.exp(interpolated(depth, depths, feed))


@compiled
def interpolated(x: float, places: Array, values: Array) -> float:
    """Returns `numpy.interp` of one finite number, whose own compilation takes a second."""
    if x <= places[0]:
        return float(values[0])
    for k in range(1, len(places)):
        if x < places[k]:
            slope = (values[k] - values[k - 1]) / (places[k] - places[k - 1])
            return float(slope * (x - places[k - 1]) + values[k - 1])
    return float(values[-1])


def step_costs(run: RigRun) -> Array:
    """Returns the cost (n,) of each row of a run, s: its duration, increased by lateral force and by failure.

    A step of duration T under a lateral force f costs T (1 + (f / ``REFERENCE_FORCE``)^2). A trial under a constant
    lateral force of that size therefore costs twice its duration. Backing off costs its duration. A trial that does not
    insert costs ``FAILURE`` in addition, and ``FAILURE`` times the missing share of the depth: where no trial inserts,
    a deeper one still costs less.

    The cost of a row is that of the step to the next row. The last row holds the cost of a failure, or zero.

    Args:
        run: a rig run whose metadata hold its geometry.
    """
    lateral = np.linalg.norm(run.samples[["fx", "fy"]].to_numpy()[:-1], axis=1)
    steps = np.diff(run.samples["time"].to_numpy()) * (1.0 + (lateral / REFERENCE_FORCE) ** 2)
    if run.result["inserted"]:
        return np.append(steps, 0.0)
    hole_depth = PegHoleGeometry.from_metadata(run.metadata, "rig run").hole_depth
    reached = float(run.samples["depth"].iloc[-1]) / hole_depth
    return np.append(steps, FAILURE * (2.0 - min(max(reached, 0.0), 1.0)))


@dataclass(frozen=True)
class Rollout:
    """Features, factors and costs of one practice trial, n rows.

    Attributes:
        features: (n, d), features of the regressor.
        memberships: (n, K), probabilities of the contact states as filtered on the rig.
        log_factors: (n, 2), logarithms of the factors on turn and feed.
        costs: (n,), cost of each step, s.
    """

    features: Array
    memberships: Array
    log_factors: Array
    costs: Array

    @property
    def costs_to_go(self) -> Array:
        """(n,), cost from each row to the end of the trial, s."""
        return np.cumsum(self.costs[::-1])[::-1]


def rollout_of(run: RigRun, policy: PerturbedPolicy[ManipulationSkill]) -> Rollout:
    """Computes the rollout of a recorded run.

    The record holds the measurements; features, filtered states and factors follow from them as on the rig. Rows in
    which the peg was backed off are left out, because the factors had no effect there. Their costs are added to
    the row before them.

    Args:
        run: the recorded run.
        policy: the perturbed skill that controlled it.
    """
    samples, skill = run.samples, policy.policy
    measured = measurement(samples[list(MEASURED[:-1])].to_numpy(dtype=float), samples["depth"].to_numpy(dtype=float))
    features = skill.features_.transform(measured)
    observed = rig_observations(measured, samples[["target_pitch", "target_yaw"]].to_numpy(dtype=float))
    found = list(estimates(skill.estimator(), observed))
    memberships = np.array([e.states for e in found])
    back_off = samples["back_off"].to_numpy() > 0.5
    acted = ~np.append(back_off[1:], back_off[-1])  # a command is recorded one row after the measurement it responds to
    costs_to_go = np.cumsum(step_costs(run)[::-1])[::-1][acted]
    return Rollout(
        features=features[acted],
        memberships=memberships[acted],
        log_factors=policy.perturbation.log_factors(-measured[acted, -1]),
        costs=-np.diff(costs_to_go, append=0.0),  # includes the costs of the rows left out
    )


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
