"""Follows what a policy would do while somebody else moves the peg."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skill.features.responses import observations
from skill.policy import Action, RigPolicy


class Judgement(NamedTuple):
    """What a policy thinks of one sample.

    Attributes:
        state: number of the most probable contact state.
        known: whether the sample lies within the gate of its state.
        action: what the policy would do.
    """

    state: int
    known: bool
    action: Action


class PolicyObserver:
    """Runs the filters of a policy over the samples of another's run, such as a person's demonstration.

    The filters see what they see on the rig: the measured wrench and depth, and the turns of the peg, here those of the
    person's probe, from which contexts are learnt too.

    Args:
        policy: that is asked; it is not changed.

    Attributes:
        policy: the same.
    """

    def __init__(self, policy: RigPolicy) -> None:
        self.policy = policy
        self._states, self._contexts = policy.state_filter(), policy.context_filter()
        self._belief, self._memory = self._states.initial_log_belief(), self._contexts.initial_memory()
        self._turned = np.zeros(2)

    def watch(self, measured: ArrayLike, turn: ArrayLike) -> Judgement:
        """Returns what the policy thinks of the next sample.

        Args:
            measured: (7,), fx fy fz (N) mx my mz (N m) z (m), of the peg.
            turn: (2,), turn of the peg relative to the hole since the previous sample, about x and y of P, rad.

        Raises:
            ValueError: if a shape is wrong or a number is not finite.
        """
        row = np.asarray(measured, dtype=float)
        self._turned = self._turned + np.asarray(turn, dtype=float)
        estimate = self._states.step(self._belief, self.policy.measured_features(row))
        context = self._contexts.step(self._memory, observations(row, self._turned))
        self._belief, self._memory = estimate.log_belief, context.memory
        action = self.policy.act(row, estimate.probabilities, context.probabilities)
        return Judgement(int(np.argmax(estimate.probabilities)), estimate.known, action)
