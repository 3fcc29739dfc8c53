"""The axes of a rig, and what can be asked of the mechanics that carry peg and hole, whatever their engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from models.scenario import Scenario
from skill.data.axes import AXES
from systems.plant.contact_forces import Contact


def stepper_axes(scenario: Scenario) -> tuple[str, ...]:
    """Returns the axes of the steppers of a rig: the first two of `AXES`, or all three with a clocking stage."""
    return AXES if scenario.rig.clocking_stage else AXES[:2]


class PegCarrier(Protocol):
    """Queries of what carries peg and hole, the rig or an arm.

    Every ``context`` is the root context of the diagram.
    """

    def set_start(self, context: Context, *, carriage: float, angles: Sequence[float]) -> None:
        """Sets the position of the carriage (m) and the angles (n,) of the axes of the block (rad)."""

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """Sets the height of the pivot and the friction of another resolved scenario.

        Args:
            context: of the diagram.
            trial: as the scenario of the plant, but for pivot and friction.
        """

    def tip_height(self, context: Context) -> float:
        """Returns the height of the centre of the peg's tip in W, m."""

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """Returns X_HP, the pose of the peg in the block."""

    def contact_extent(self, context: Context) -> float:
        """Returns a number that is cheap and grows with the contact in the plant's last step; 0 without contact."""

    def contacts(self, context: Context) -> list[Contact]:
        """Returns the single contacts of the plant's last step, at most five, the strongest first.

        Their normal forces, with friction, make up the contact wrench on the peg.
        """
