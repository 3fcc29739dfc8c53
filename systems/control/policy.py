"""What the rig asks of whoever controls it; and control laws of one's own, in the place of a learnt skill."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.manipulation_skill import Action
from skill.states.contact_state_filter import Estimate


class StateFollower(Protocol):
    """Tells the state from sample to sample; `ContactStateFilter` is one.

    It is immutable: the belief (M,), the log-probability of each state, is kept by whoever runs it.
    """

    def initial_log_belief(self) -> Array:
        """Before the first sample, (M,)."""

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> Estimate:
        """The estimate after one more sample of features; changes nothing."""


class RigPolicy(Protocol):
    """What `MakeRig` and `run_trial` ask of whoever controls the rig.

    A `ManipulationSkill` is one, and so is every `ControlLaw`. A policy acts on the measured wrench and depth alone;
    what it must remember of the past, its `state_filter` does. Limits and the supervisor are not its business: they
    stand between any policy and the motors.
    """

    @property
    def period_(self) -> float:
        """Seconds over which an action is spread."""

    @property
    def n_states(self) -> int:
        """M, of the states that the filter tells apart."""

    @property
    def metadata_(self) -> Mapping[str, Any]:
        """``geometry``, if the policy serves for one peg and hole only."""

    def state_names(self) -> list[str]:
        """Of the M states, for tables and pictures."""

    def state_filter(self) -> StateFollower:
        """What tells the states from sample to sample."""

    def measured_features(self, measured: ArrayLike) -> Array:
        """What the filter sees of one measurement (7,): fx fy fz (N) mx my mz (N m) z (m)."""

    def act(self, measured: ArrayLike, probabilities: ArrayLike | None = None) -> Action:
        """The action for one measurement (7,) and the probabilities (M,) of the states."""


class ControlLaw(ABC):
    """A control law of one's own: a reflex, `act`, and if it needs memory, phases that `follow` walks through.

    The phase is the law's only memory. It takes the place of the contact state: recorded with every run, named in
    replays, and kept in the Context, so that one law serves many runs at once. A law that searches has a phase for
    each point of its pattern; a law without memory has one phase and overrides `act` alone.

    Attributes:
        phases: their names; a run begins in the first.
        period_: s, over which an action is spread; and the time between two samples.
        metadata_: empty: a law is not tied to a peg and hole.
    """

    phases: tuple[str, ...] = ("acting",)
    period_: float = 0.02
    metadata_: Mapping[str, Any] = {}

    @abstractmethod
    def act(self, measured: ArrayLike, probabilities: ArrayLike | None = None) -> Action:
        """The action for one measurement.

        Args:
            measured: (7,) fx fy fz (N) mx my mz (N m) on the peg about its tip, in P; z of the tip in H (m).
            probabilities: (M,), one for the present phase and zero for all others; None for the first phase.

        Returns:
            How to turn the peg relative to the hole and to feed it within ``period_``, as a skill would.
        """

    def follow(self, phase: int, measured: Array) -> int:
        """The phase at a measurement (7,), from that at the one before; a law without memory keeps the first."""
        return phase

    @property
    def n_states(self) -> int:
        """Number of phases."""
        return len(self.phases)

    def state_names(self) -> list[str]:
        """Of the phases."""
        return list(self.phases)

    def state_filter(self) -> PhaseFollower:
        """What follows the phases."""
        return PhaseFollower(self)

    def measured_features(self, measured: ArrayLike) -> Array:
        """The measurement (7,) itself."""
        return np.asarray(measured, dtype=float).reshape(-1)


class PhaseFollower:
    """A `StateFollower` that is certain: the phase that the law's `follow` says."""

    def __init__(self, law: ControlLaw) -> None:
        self._law = law

    def initial_log_belief(self) -> Array:
        """Log of one for the first phase, and of the least number for the others."""
        return self._certain(0)

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> Estimate:
        """The next phase; every sample is known.

        Raises:
            ValueError: if the law follows to a phase that it does not have.
        """
        phase = self._law.follow(int(np.argmax(log_belief)), np.asarray(x, dtype=float))
        if not 0 <= phase < self._law.n_states:
            raise ValueError(
                f"{type(self._law).__name__}.follow returned phase {phase}; expected one from 0 to"
                f" {self._law.n_states - 1}"
            )
        log_belief = self._certain(phase)
        return Estimate(log_belief, np.exp(log_belief), mahalanobis=0.0, known=True)

    def _certain(self, phase: int) -> Array:
        belief = np.full(self._law.n_states, -np.inf)
        belief[phase] = 0.0
        return belief
