"""The policy on the rig of an environment: it does what it is told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skill.policy.rig_policy import Action, RigPolicy
from skill.states.estimate import Estimate, Estimator
from systems.law.control_law import ControlLaw


class CommandedPolicy(ControlLaw):
    """A law whose action is a stored command.

    Args:
        policy: whose estimator runs on the rig; None for none.

    Attributes:
        command: (5,), the action of the next period: turn rates of the peg relative to the hole about the axes of P,
            rad/s; feed speed, m/s, negative into the hole; support, 0 to 1. It may be written to.
        period_: one second, so that a turn is a rate and a feed is a speed: no division rounds them.
        metadata_: those of the policy.
    """

    period_ = 1.0

    def __init__(self, policy: RigPolicy | None) -> None:
        self._policy = policy
        self.command = np.array([0.0, 0.0, 0.0, 0.0, 1.0])
        self.metadata_: Mapping[str, Any] = {} if policy is None else policy.metadata_

    def estimator(self) -> Estimator | None:
        """Returns the estimator of the policy."""
        return None if self._policy is None else self._policy.estimator()

    def state_names(self) -> list[str]:
        """Returns the names of the states of the policy."""
        return super().state_names() if self._policy is None else self._policy.state_names()

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """Returns the command."""
        pitch, yaw, spin, feed, support = self.command.tolist()
        return Action(np.array([pitch, yaw]), feed, support, spin)
