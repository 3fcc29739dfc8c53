"""Practice: what a robot tries beyond its skill, what each step of it cost, and what a finished trial teaches.

A practice trial performs the skill with its turn and its feed multiplied by factors that are drawn anew for each trial
and vary along the depth. What was felt at each moment, what was tried there and what it cost in the end make an
`Experience`; `skill.practice.policy_update` turns experiences into a better skill.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.data.rig_run import RigRun
from skill.features.wrench_features import MEASURED
from skill.manipulation_skill import Action, ManipulationSkill


@dataclass(frozen=True)
class Perturbation:
    """Factors on the skill's actions over the depth, their logarithms interpolated linearly between knots.

    Attributes:
        depths: (k,), of the knots, m, increasing; beyond the outermost their factors hold on.
        turn: (k,), logarithm of the factor on the turn.
        feed: (k,), likewise on the feed.
    """

    depths: Array
    turn: Array
    feed: Array

    def log_factors(self, depth: float | Array) -> Array:
        """On turn and feed, (..., 2), at depths (...), m."""
        return np.stack([np.interp(depth, self.depths, values) for values in (self.turn, self.feed)], axis=-1)

    def opposite(self) -> Perturbation:
        """The reciprocal factors."""
        return Perturbation(self.depths, -self.turn, -self.feed)


@dataclass(frozen=True)
class ExplorationNoise:
    """How far practice departs from the skill.

    Attributes:
        turn: the largest factor on the turn, and one over it the least.
        feed: likewise on the feed.
        spacing: of the knots along the depth, m.
    """

    turn: float = 2.5
    feed: float = 1.5
    spacing: float = 5e-3

    def draw(self, rng: np.random.Generator, full_depth: float) -> Perturbation:
        """Logarithms uniform between the limits, independent from knot to knot, from the mouth to ``full_depth`` (m).

        On average they are zero: where practice leads is decided by what it costs, not by what it tries.
        """
        depths = np.linspace(0.0, full_depth, 1 + max(1, round(full_depth / self.spacing)))
        turn, feed = np.log([self.turn, self.feed])
        return Perturbation(depths, turn * rng.uniform(-1, 1, len(depths)), feed * rng.uniform(-1, 1, len(depths)))


class PerturbedPolicy(ManipulationSkill):
    """A skill that acts like another, but for a `Variation` of turn and feed."""

    perturbation: Perturbation

    @classmethod
    def of(cls, skill: ManipulationSkill, perturbation: Perturbation) -> Self:
        """Shares all parts with ``skill``, which is not changed."""
        varied = cls.__new__(cls)
        varied.__dict__.update(skill.__dict__)
        varied.perturbation = perturbation
        return varied

    def act(self, measured: ArrayLike, probabilities: ArrayLike | None = None) -> Action:
        """As `ManipulationSkill.act`, times the factors at the measured depth."""
        action = super().act(measured, probabilities)
        turn, feed = np.exp(self.perturbation.log_factors(-float(np.asarray(measured)[-1])))
        return Action(turn=turn * action.turn, feed=float(feed * action.feed), probabilities=action.probabilities)


@dataclass(frozen=True)
class Cost:
    """What a trial costs, in seconds: its time, and time's worth of force and of failure.

    A step of length T under a lateral force f costs T (1 + (f / force)^2), so that a trial which is everywhere pushed
    with ``force`` costs twice its time. Backing off costs the time that it takes. A peg that is not inserted costs
    ``failure``, and as much again for the share of the hole's depth that it lacks: where nothing inserts yet, to come
    deeper is still better than to stand still gently.

    Attributes:
        force: N, across the peg.
        failure: s.
    """

    force: float = 25.0
    failure: float = 5.0

    def of_steps(self, run: RigRun) -> Array:
        """(n,), s, of each row of a run, whose metadata have its geometry.

        That of a row is the cost up to the next; the last has none but a failure's.
        """
        lateral = np.linalg.norm(run.samples[["fx", "fy"]].to_numpy()[:-1], axis=1)
        steps = np.diff(run.samples["time"].to_numpy()) * (1.0 + (lateral / self.force) ** 2)
        if run.result["inserted"]:
            return np.append(steps, 0.0)
        reached = float(run.samples["depth"].iloc[-1]) / run.metadata["geometry"]["hole_depth"]
        return np.append(steps, self.failure * (2.0 - min(max(reached, 0.0), 1.0)))

    def of_run(self, run: RigRun) -> float:
        """The sum, s."""
        return float(self.of_steps(run).sum())


@dataclass(frozen=True)
class Rollout:
    """What one practice trial felt, tried and paid, n rows.

    Attributes:
        features: (n, d), of what was felt.
        memberships: (n, K), probabilities of the contact states, as the rig's estimator had filtered them.
        tried: (n, 2), logarithms of the factors on turn and feed.
        costs: (n,), s, of each step.
    """

    features: Array
    memberships: Array
    tried: Array
    costs: Array

    @property
    def costs_to_go(self) -> Array:
        """(n,), s, from each row to the end of the trial."""
        return np.cumsum(self.costs[::-1])[::-1]


def rollout_of(run: RigRun, skill: PerturbedPolicy, cost: Cost) -> Rollout:
    """Goes once more through a recorded run with the skill that made it.

    What was felt is on record; features, filtered states and factors follow from it as they did on the rig. Where the
    supervisor backed off nothing was tried, and the factors have no say: those rows are left out, their costs are
    borne by what led there.

    Args:
        run: of the rig.
        skill: that controlled it, with its variation.
        cost: of its steps.
    """
    samples = run.samples
    measured = samples[[*MEASURED[:-1], "depth"]].to_numpy(dtype=float, copy=True)
    measured[:, -1] *= -1.0  # MEASURED has the height
    features = skill.features_.transform(measured)
    memberships = np.empty((len(samples), skill.n_states))
    state_filter = skill.state_filter()
    belief = state_filter.initial_log_belief()
    for k, row in enumerate(measured):
        estimate = state_filter.step(belief, skill.measured_features(row))
        belief, memberships[k] = estimate.log_belief, estimate.probabilities
    guard = samples["guard"].to_numpy() > 0.5
    acted = ~np.append(guard[1:], guard[-1])  # a command is on record one row after what was felt
    # Each row that stays takes the costs of those left out behind it.
    totals = np.cumsum(cost.of_steps(run)[::-1])[::-1][acted]
    return Rollout(
        features=features[acted],
        memberships=memberships[acted],
        tried=skill.perturbation.log_factors(-measured[acted, -1]),
        costs=-np.diff(totals, append=0.0),
    )
