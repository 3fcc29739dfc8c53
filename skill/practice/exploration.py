"""Exploration: perturbed policies, the cost of a trial, and the rollouts that a policy update learns from.

A practice trial performs the skill with its turn and its feed multiplied by factors. The factors are drawn anew for
each trial and vary along the depth. The features, the factors and the cost of each moment form a `Rollout`;
`skill.practice.policy_update` computes a better skill from rollouts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from compiled import compiled
from skill.arrays import Array
from skill.data.geometry import PegHoleGeometry
from skill.data.rig_run import RigRun
from skill.features.measurement import measurement
from skill.features.responses import rig_observations
from skill.features.wrench_features import MEASURED
from skill.manipulation_skill import ManipulationSkill
from skill.policy import Action, PolicyT, WrappedPolicy
from skill.states.estimate import Estimate, estimates

LARGEST_TURN, LARGEST_FEED = 2.5, 1.5
"""Largest factors on turn and feed; the smallest are their reciprocals."""

KNOT_SPACING = 5e-3
"""Approximate distance of the knots of a perturbation along the depth, m."""

REFERENCE_FORCE = 25.0
"""Lateral force that doubles the cost of a step, N."""

FAILURE = 5.0
"""Cost of a failure, s."""


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
    return math.exp(np.interp(depth, depths, turn)), math.exp(np.interp(depth, depths, feed))


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
