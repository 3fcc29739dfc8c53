"""Hand-written control laws, which control the rig in place of a learnt skill."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.policy import Action
from skill.states.contact_state_filter import Estimate
from skill.states.context_filter import ContextFollower, SingleContext


class ControlLaw(ABC):
    """A hand-written `RigPolicy`: `act` maps a measurement to an action, and `follow` walks through phases.

    The phase is the only memory of a law. It takes the place of the contact state: every run records it, replays show
    its name, and the Context stores it, so that one law serves many runs at once. A law that searches has one phase
    for each point of its pattern. A law without memory has one phase and overrides `act` alone.

    Attributes:
        phases: names of the phases; a run begins in the first.
        period_: duration of an action and time between two samples, s.
        metadata_: empty, because a law is not tied to a peg and hole.
    """

    phases: tuple[str, ...] = ("acting",)
    period_: float = 0.02
    metadata_: Mapping[str, Any] = {}

    @abstractmethod
    def act(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, contexts: ArrayLike | None = None
    ) -> Action:
        """Returns the action for one measurement.

        Args:
            measured: (7,), fx fy fz (N) mx my mz (N m) on the peg about its tip, in P; z of the tip in H (m).
            probabilities: (M,), 1 for the present phase and 0 for the others; None for the first phase.
            contexts: not used; a law has a single context.

        Returns:
            The turn of the peg relative to the hole and the feed for one ``period_``.
        """

    def follow(self, phase: int, measured: Array) -> int:
        """Returns the phase at a measurement (7,), given the phase before it; by default the same phase."""
        return phase

    @property
    def n_states(self) -> int:
        """Number of phases."""
        return len(self.phases)

    def state_names(self) -> list[str]:
        """Returns the names of the phases."""
        return list(self.phases)

    def state_filter(self) -> PhaseFollower:
        """Returns the `StateFollower` of the phases."""
        return PhaseFollower(self)

    def context_filter(self) -> ContextFollower:
        """Returns the follower of a single context."""
        return SingleContext()

    def measured_features(self, measured: ArrayLike) -> Array:
        """Returns the measurement (7,) itself."""
        return np.asarray(measured, dtype=float).reshape(-1)


class PhaseFollower:
    """A `StateFollower` that gives probability 1 to the phase that the law's `follow` returns."""

    def __init__(self, law: ControlLaw) -> None:
        self._law = law

    def initial_log_belief(self) -> Array:
        """Returns the log-probabilities (M,) at the start: 0 for the first phase, -inf for the others."""
        return self._certain(0)

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> Estimate:
        """Returns the next phase as an estimate; every sample counts as known.

        Raises:
            ValueError: if `follow` returns a phase that the law does not have.
        """
        phase = self._law.follow(int(np.argmax(log_belief)), np.asarray(x, dtype=float))
        if not 0 <= phase < self._law.n_states:
            raise ValueError(
                f"{type(self._law).__name__}.follow returned phase {phase}; expected 0 to {self._law.n_states - 1}"
            )
        log_belief = self._certain(phase)
        return Estimate(log_belief, np.exp(log_belief), mahalanobis=0.0, known=True)

    def _certain(self, phase: int) -> Array:
        belief = np.full(self._law.n_states, -np.inf)
        belief[phase] = 0.0
        return belief
