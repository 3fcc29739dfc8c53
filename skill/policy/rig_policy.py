"""The interface of a policy: what maps a measurement and an estimate to an action, and the action itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.states.estimate import Estimate, Estimator


@dataclass(frozen=True)
class Action:
    """The action for one sample period.

    Attributes:
        turn: (2,), rotation vector of the peg relative to the hole about x and y of P, rad.
        feed: motion of the peg along its axis, m; negative goes into the hole.
        support: kernel weight of the nearest sample over the minimum that demonstrated
            samples find in the other demonstrations, at most 1. A policy that does not report its support has 1.
        spin: turn of the peg relative to the hole about z of P, rad; a rig without clocking stage cannot do it.
    """

    turn: Array
    feed: float
    support: float = 1.0
    spin: float = 0.0


class RigPolicy(Protocol):
    """The interface that `MakeRig`, `run_trial` and practice require of a policy.

    A `ManipulationSkill` is one, and so is every `ControlLaw`. A policy acts on a measurement and on what its estimator
    believes; this estimate is its only memory. It need not limit its actions: limits and the force guard stand between
    every policy and the motors. The controller reverses its turns where they make it worse (`back_off_step`).
    """

    @property
    def period_(self) -> float:
        """Duration of an action, s."""

    @property
    def metadata_(self) -> Mapping[str, Any]:
        """Holds ``geometry`` if the policy serves one peg and hole only."""

    def state_names(self) -> list[str]:
        """Returns the names of the K states of its estimates, for tables and figures."""

    def estimator(self) -> Estimator | None:
        """Returns the estimator of what the policy acts on; None for a policy that acts on measurements alone."""

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """Returns the action for one measurement (7,), fx fy fz (N) mx my mz (N m) z (m), and the estimate at it."""


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
    def metadata_(self) -> Mapping[str, Any]:
        """Metadata of the policy."""
        return self.policy.metadata_

    def state_names(self) -> list[str]:
        """Returns the names of the states."""
        return self.policy.state_names()

    def estimator(self) -> Estimator | None:
        """Returns the estimator of the policy."""
        return self.policy.estimator()

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """Returns the action of the policy."""
        return self.policy.act(measured, estimate)


class CarriedOver(WrappedPolicy[RigPolicy]):
    """A policy that serves other pegs and holes than the one it was made for."""

    @property
    def metadata_(self) -> Mapping[str, Any]:
        """Empty: the policy is not tied to a peg and hole."""
        return {}
