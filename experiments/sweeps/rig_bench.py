"""Keeps a rig for trials that differ only in what their seeds draw."""

from __future__ import annotations

from models.scenario import Scenario
from skill.policy import RigPolicy
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram


class RigBench:
    """Holds the rig that was built last, for trials that differ only in what `RigDiagram.set_trial` replaces.

    Drake 1.51 keeps each diagram with Python systems in its process, and building one takes as long as 50 ms of a
    trial.
    """

    def __init__(self) -> None:
        self._rig: RigDiagram | None = None
        self._built_for: object = None

    def rig(self, cell: object, scenario: Scenario, policy: RigPolicy) -> RigDiagram:
        """Returns a rig for a trial.

        Args:
            cell: equal for trials whose scenarios and policy differ only in what a seed draws.
            scenario: of the trial, resolved.
            policy: that acts; an equal one acts in a rig that was built before.

        Raises:
            ValueError: see `MakeRig`.
            ModuleNotFoundError: if the engine is not installed.
        """
        if self._rig is None or self._built_for != cell:
            self._rig = None  # also if the next one cannot be built
            self._rig, self._built_for = MakeRig(scenario, policy), cell
        return self._rig
