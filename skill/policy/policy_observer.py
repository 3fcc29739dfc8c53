"""Follows what a policy would do while somebody else moves the peg."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from skill.features.measurement import observations
from skill.policy.rig_policy import Action, RigPolicy
from skill.states.estimate import Estimate


class Judgement(NamedTuple):
    """What a policy thinks of one sample: the most probable contact state, whether it is known, and the action."""

    state: int
    known: bool
    action: Action


class PolicyObserver:
    """Asks a policy at each sample of another's run, such as a person's demonstration.

    The estimator sees what it sees on the rig: the measured wrench and depth, and the turns of the peg, here those of
    the person's probe.

    Args:
        policy: that is asked; it is not changed.
    """

    def __init__(self, policy: RigPolicy) -> None:
        self.policy = policy
        self._estimator = policy.estimator()
        self._estimate = Estimate() if self._estimator is None else self._estimator.initial()
        self._turned = np.zeros(2)

    def watch(self, measured: ArrayLike, turn: ArrayLike) -> Judgement:
        """Returns what the policy thinks of the next sample.

        Args:
            measured: (7,), fx fy fz (N) mx my mz (N m) z (m), of the peg.
            turn: (2,), turn of the peg relative to the hole since the previous sample, about x and y of P, rad.
        """
        row = np.asarray(measured, dtype=float)
        self._turned = self._turned + np.asarray(turn, dtype=float)
        if self._estimator is not None:
            self._estimate = self._estimator.step(self._estimate.memory, observations(row, self._turned))
        action = self.policy.act(row, self._estimate)
        return Judgement(self._estimate.state, self._estimate.known, action)
