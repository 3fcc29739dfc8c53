"""The engines that simulate a trial: the bodies and their contact; all other systems of the rig are the same."""

from __future__ import annotations

from importlib import import_module

from pydrake.systems.framework import DiagramBuilder

from models.scenario import Scenario
from skill.policy import RigPolicy
from systems.plant.contact_plant import HydroelasticRig
from systems.rig import MakeRig, WireRig
from systems.rig_diagram import RigDiagram

DRAKE, MUJOCO = "drake", "mujoco"
ENGINES = (DRAKE, MUJOCO)


def require_engine(engine: str) -> None:
    """Checks that an engine is installed.

    Raises:
        ModuleNotFoundError: if it is not.
    """
    if engine == MUJOCO:
        import_module("mujoco")


def make_rig(engine: str, scenario: Scenario, policy: RigPolicy) -> RigDiagram:
    """Builds the rig of a resolved scenario with the bodies of an engine of ``ENGINES``.

    Raises:
        ValueError: see `MakeRig`.
        ModuleNotFoundError: if the engine is not installed.
    """
    if engine == DRAKE:
        return MakeRig(scenario, policy)
    from systems.plant.mujoco_model import MujocoContact
    from systems.plant.mujoco_plant import MujocoPlant

    builder = DiagramBuilder()
    return WireRig(builder, scenario, policy, MujocoPlant.AddToBuilder(builder, scenario, MujocoContact()))


class RigBench:
    """Holds the rig that was built last, for trials that differ only in what `RigDiagram.set_trial` replaces.

    Drake 1.51 keeps each diagram with Python systems in its process, and building one takes as long as 50 ms of a
    trial. A rig of another engine than Drake is built for each trial.
    """

    def __init__(self) -> None:
        self._rig: RigDiagram | None = None
        self._built_for: object = None

    def rig(self, cell: object, engine: str, scenario: Scenario, policy: RigPolicy) -> RigDiagram:
        """Returns a rig for a trial.

        Args:
            cell: equal for trials whose scenarios, engine and policy differ only in what a seed draws.
            engine: one of ``ENGINES``.
            scenario: of the trial, resolved.
            policy: that acts; an equal one acts in a rig that was built before.

        Raises:
            ValueError: see `MakeRig`.
            ModuleNotFoundError: if the engine is not installed.
        """
        if self._rig is None or self._built_for != cell:
            self._rig = None  # also if the next one cannot be built
            rig = make_rig(engine, scenario, policy)
            if not isinstance(rig.plant, HydroelasticRig):
                return rig
            self._rig, self._built_for = rig, cell
        return self._rig
