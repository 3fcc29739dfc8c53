"""The policy on the rig of an environment: it does what it is told."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.policy import Action, RigPolicy, WrappedPolicy
from systems.control.policy import ControlLaw

SUPPORT = 3
"""Place of the support in a command."""


class Resting(ControlLaw):
    """A control law that never moves; its only state, `acting`, counts as known."""

    def act(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, contexts: ArrayLike | None = None
    ) -> Action:
        """Returns no turn and no feed."""
        return Action(np.zeros(2), 0.0, np.ones(1))


@dataclass(frozen=True)
class CommandedPolicy(WrappedPolicy[RigPolicy]):
    """A `RigPolicy` whose states and contexts are those of another policy, and whose action is a stored command.

    Attributes:
        policy: its state and context estimators run on the rig.
        command: (4,), the action of the next period: turn rates of the peg relative to the hole about x and y of P,
            rad/s; feed speed, m/s, negative into the hole; support, 0 to 1. It may be written to.
    """

    command: Array = field(default_factory=lambda: np.array([0.0, 0.0, 0.0, 1.0]))

    @property
    def period_(self) -> float:
        """One second, so that a turn is a rate and a feed is a speed: no division rounds them."""
        return 1.0

    def act(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, contexts: ArrayLike | None = None
    ) -> Action:
        """Returns the command."""
        pitch, yaw, feed, support = self.command.tolist()
        states = np.ones(self.n_states) / self.n_states if probabilities is None else np.asarray(probabilities)
        return Action(np.array([pitch, yaw]), feed, states, support=support)
