"""Agents for the environment: a policy of the rig, and what runs an episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import gymnasium
import numpy as np

from skill.arrays import Array
from skill.features.measurement import measurement
from skill.policy.rig_policy import RigPolicy
from skill.states.estimate import Estimate


class Agent(Protocol):
    """Chooses an action for each observation of an episode."""

    def act(self, observation: Any) -> Array:
        """Returns the action for an observation."""


class PolicyAgent:
    """A `RigPolicy`, such as a skill, as an agent.

    In an environment that was made with ``policy=`` this policy, its episodes are the trials of `run_trial`: every
    number of the record is equal. (With ``controller.gain`` other than 1 the rounding of the turns may differ.) Its
    filters run on the rig, as in a trial, and the observation brings what they find. A filter of the agent's own would
    find slightly different probabilities: that on the rig stores the depth of one step of the plant later.

    Args:
        policy: that acts; not changed.
    """

    def __init__(self, policy: RigPolicy) -> None:
        self._policy = policy

    def act(self, observation: Mapping[str, Array]) -> Array:
        """Returns turn rates, feed speed and support (4,) or (5,) for an observation of the kind "dict"."""
        measured = measurement(observation["wrench"], observation["depth"][0])
        action = self._policy.act(measured, Estimate(observation["probabilities"]))
        period = self._policy.period_
        turn = np.append(action.turn, action.spin)[: len(observation["angles"])]
        return np.array([*(turn / period), action.feed / period, action.support])


def run_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, *, trial: int | None = None
) -> tuple[float, dict[str, Any]]:
    """Runs one episode to its end.

    Args:
        env: the environment, wrapped or not.
        agent: that acts.
        trial: number of the trial; None lets the environment draw one.

    Returns:
        The sum of the rewards, and the last ``info``.
    """
    observation, info = env.reset(options=None if trial is None else {"trial": trial})
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(agent.act(observation))
        total, over = total + float(reward), terminated or truncated
    return total, info
