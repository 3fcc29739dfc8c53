"""Hand-written control laws, which control the rig in place of a learnt skill."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from skill.policy.rig_policy import Action
from skill.states.estimate import Estimate, Estimator


class ControlLaw(ABC):
    """A hand-written `RigPolicy`: `act` maps a measurement to an action.

    A law without memory overrides `act` alone. A law that remembers, such as a search, returns an `Estimator` as well,
    whose memory is stored in the Context, so that one law serves many runs at once. Its states are phases: every run
    records them, and replays show their names.

    Attributes:
        period_: duration of an action and time between two samples, s.
        metadata_: empty, because a law is not tied to a peg and hole.
    """

    period_: float = 0.02
    metadata_: Mapping[str, Any] = {}

    @abstractmethod
    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """Returns the action for one measurement.

        Args:
            measured: (7,), fx fy fz (N) mx my mz (N m) on the peg about its tip, in P; z of the tip in H (m).
            estimate: of the estimator at this measurement.

        Returns:
            The turn of the peg relative to the hole and the feed for one ``period_``.
        """

    def estimator(self) -> Estimator | None:
        """Returns None: the law acts on measurements alone."""
        return None

    def state_names(self) -> list[str]:
        """Returns the name that a run shows while the law acts."""
        return ["acting"]
