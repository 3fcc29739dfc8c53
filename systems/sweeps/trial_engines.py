"""The engines that simulate a trial: the bodies and their contact; all other systems of the rig are the same."""

from __future__ import annotations

from importlib import import_module

from pydrake.systems.framework import DiagramBuilder

from models.scenario import Scenario
from skill.policy import RigPolicy
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
