"""The interface of a policy: what maps a measured wrench and depth to an action, and the action itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.states.contact_state_filter import Estimate
from skill.states.context_filter import ContextFollower


@dataclass(frozen=True)
class Action:
    """The action for one sample period.

    Attributes:
        turn: (2,), rotation vector of the peg relative to the hole about x and y of P, rad.
        feed: motion of the peg along its axis, m; negative goes into the hole.
        probabilities: (K,), probabilities of the contact states.
        contexts: (C,), probabilities of the contexts.
        support: kernel weight of the nearest sample of the most probable context over the minimum that demonstrated
            samples find in the other demonstrations, at most 1. A regressor that does not report its support has 1.
    """

    turn: Array
    feed: float
    probabilities: Array
    contexts: Array = field(default_factory=lambda: np.ones(1))
    support: float = 1.0


class StateFollower(Protocol):
    """Estimates the state from sample to sample; `ContactStateFilter` is one.

    A follower is immutable. Its caller stores the belief (M,), the log-probability of each state.
    """

    def initial_log_belief(self) -> Array:
        """Returns the belief before the first sample, (M,)."""

    def step(self, log_belief: ArrayLike, x: ArrayLike) -> Estimate:
        """Returns the estimate after one more sample of features ``x``."""


class RigPolicy(Protocol):
    """The interface that `MakeRig`, `run_trial` and practice require of a policy.

    A `ManipulationSkill` is one, and so is every `ControlLaw`. A policy acts on the measured wrench and depth, and on
    its own past motions. Its only memory is that of its two filters. It need not limit its actions: limits and the
    force guard stand between every policy and the motors. The controller reverses its turns where they
    make it worse (`back_off_step`).
    """

    @property
    def period_(self) -> float:
        """Duration of an action, s."""

    @property
    def n_states(self) -> int:
        """Number of states M of the filter."""

    @property
    def metadata_(self) -> Mapping[str, Any]:
        """Holds ``geometry`` if the policy serves one peg and hole only."""

    def state_names(self) -> list[str]:
        """Returns the names of the M states, for tables and figures."""

    def state_filter(self) -> StateFollower:
        """Returns the estimator of the state."""

    def measured_features(self, measured: ArrayLike) -> Array:
        """Returns the filter's features of one measurement (7,): fx fy fz (N) mx my mz (N m) z (m)."""

    def context_filter(self) -> ContextFollower:
        """Returns the estimator of the context; `SingleContext` for a policy without contexts."""

    def act(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, contexts: ArrayLike | None = None
    ) -> Action:
        """Returns the action for one measurement (7,) and the probabilities of the states (M,) and contexts (C,)."""


PolicyT = TypeVar("PolicyT", bound=RigPolicy)


@dataclass(frozen=True)
class WrappedPolicy(Generic[PolicyT]):
    """A `RigPolicy` that does what another one does; subclasses override what they change.

    Attributes:
        policy: the other policy; it is not changed.
    """

    policy: PolicyT

    @property
    def period_(self) -> float:
        """Duration of an action, s."""
        return self.policy.period_

    @property
    def n_states(self) -> int:
        """Number of states."""
        return self.policy.n_states

    @property
    def metadata_(self) -> Mapping[str, Any]:
        """Metadata of the policy."""
        return self.policy.metadata_

    def state_names(self) -> list[str]:
        """Returns the names of the states."""
        return self.policy.state_names()

    def state_filter(self) -> StateFollower:
        """Returns the state estimator of the policy."""
        return self.policy.state_filter()

    def measured_features(self, measured: ArrayLike) -> Array:
        """Returns the features of one measurement (7,) for the state estimator."""
        return self.policy.measured_features(measured)

    def context_filter(self) -> ContextFollower:
        """Returns the context estimator of the policy."""
        return self.policy.context_filter()

    def act(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, contexts: ArrayLike | None = None
    ) -> Action:
        """Returns the action of the policy."""
        return self.policy.act(measured, probabilities, contexts)
