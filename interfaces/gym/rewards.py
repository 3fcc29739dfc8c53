"""The rewards of the environment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from models.scenario import Scenario
from skill.data.outcome import UNPHYSICAL, Outcome

BROKEN = (Outcome.FAULT, *UNPHYSICAL)


@dataclass(frozen=True)
class Transition:
    """What a step has changed.

    Attributes:
        depth_before: measured depth of the tip before the step, m.
        depth: after the step, m.
        load: measured load after the step, N.
        duration: of the step, s.
        remaining: time that the trial has left, s.
        outcome: how the trial has ended; None if it goes on or its time is over.
    """

    depth_before: float
    depth: float
    load: float
    duration: float
    remaining: float
    outcome: Outcome | None


Reward = Callable[[Transition], float]
"""Returns the reward of a step."""


def sparse_reward(step: Transition) -> float:
    """Returns 1 for the step in which the peg is inserted, else 0."""
    return float(step.outcome is Outcome.INSERTED)


@dataclass(frozen=True)
class DenseReward:
    """Progress, less time and load, and what the end is worth.

    With the measured depth d (m), the measured load F (N) and the duration T (s) of the step,

        r = (d' - d)/D - TIME_COST T - LOAD_COST T max(0, F' - F_soft)
            + 1                    if the peg is inserted,
            - 1                    at a fault, and if the simulation diverges or fails,
            - TIME_COST (time left)  at any end but insertion.

    D is the way from the start to full depth, so that the progress of an insertion adds up to 1. F_soft is
    `ForceGuardParameters.soft_force`. The last term makes it useless to end an episode early. The progress is the
    difference of a potential, which does not change what is best in the long run (Ng, Harada and Russell 1999, without
    discount).

    Args:
        scenario: the way and the soft force.
    """

    scenario: Scenario

    TIME_COST = 0.02  # in units of 1/s
    LOAD_COST = 0.01  # in units of 1/(N s)

    def __call__(self, step: Transition) -> float:
        """Returns the reward of a step."""
        way = self.scenario.full_depth + self.scenario.start.height
        excess = max(0.0, step.load - self.scenario.controller.guard.soft_force)
        reward = (step.depth - step.depth_before) / way
        reward -= step.duration * (self.TIME_COST + self.LOAD_COST * excess)
        if step.outcome is Outcome.INSERTED:
            return reward + 1.0
        if step.outcome is not None:
            reward -= self.TIME_COST * step.remaining + float(step.outcome in BROKEN)
        return reward


REWARDS: dict[str, Callable[[Scenario], Reward]] = {"dense": DenseReward, "sparse": lambda scenario: sparse_reward}
"""What makes the rewards for a scenario, by their names."""
