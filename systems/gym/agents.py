"""Agents for the environment: a policy of the rig, and what runs an episode."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import gymnasium
import numpy as np

from skill.arrays import Array
from skill.features.measurement import measurement
from skill.features.responses import rig_observations
from skill.policy import RigPolicy


class Agent(Protocol):
    """Chooses an action for each observation of an episode."""

    def reset(self) -> None:
        """Forgets the last episode."""

    def act(self, observation: Any) -> Array:
        """Returns the action for an observation."""


class PolicyAgent:
    """A `RigPolicy`, such as a skill, as an agent. It holds the memory of the policy's filters.

    In an environment that was made with ``policy=`` the same policy, its episodes are the trials of `run_trial`: every
    number of the record is equal. (With ``controller.gain`` other than 1 the rounding of the turns may differ.)

    Args:
        policy: that acts; not changed.
    """

    def __init__(self, policy: RigPolicy) -> None:
        self._policy = policy
        self._states, self._contexts = policy.state_filter(), policy.context_filter()
        self.reset()

    def reset(self) -> None:
        """Returns the filters to their start."""
        self._belief = self._states.initial_log_belief()
        self._memory = self._contexts.initial_memory()

    def act(self, observation: Mapping[str, Array]) -> Array:
        """Returns turn rates, feed speed and support (4,) for an observation of the kind "dict"."""
        measured = measurement(observation["wrench"], observation["depth"][0])
        state = self._states.step(self._belief, self._policy.measured_features(measured))
        context = self._contexts.step(self._memory, rig_observations(measured, observation["angles"]))
        self._belief, self._memory = state.log_belief, context.memory
        action = self._policy.act(measured, state.probabilities, context.probabilities)
        period = self._policy.period_
        return np.array([*(action.turn / period), action.feed / period, action.support])


def run_episode(
    env: gymnasium.Env[Any, Any], agent: Agent, *, trial: int | None = None
) -> tuple[float, dict[str, Any]]:
    """Runs one episode to its end.

    Args:
        env: the environment, wrapped or not.
        agent: is reset first.
        trial: number of the trial; None lets the environment draw one.

    Returns:
        The sum of the rewards, and the last ``info``.
    """
    agent.reset()
    observation, info = env.reset(options=None if trial is None else {"trial": trial})
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(agent.act(observation))
        total, over = total + float(reward), terminated or truncated
    return total, info
