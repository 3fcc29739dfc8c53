"""The virtual environment's mechanics, in the engine that a scenario names."""

from __future__ import annotations

from pydrake.systems.framework import DiagramBuilder

from models.scenario import Scenario
from systems.plant.contact_plant import AddVirtualPlant, HydroelasticPeg
from systems.plant.exact_peg import ExactPeg

PegPlant = HydroelasticPeg | ExactPeg
"""A free peg and a fixed block, without gravity; H and W coincide. Both have the same ports and queries."""


def AddPegPlant(builder: DiagramBuilder, scenario: Scenario) -> PegPlant:
    """Adds the mechanics of peg and hole."""
    if scenario.contact.engine == "drake":
        return AddVirtualPlant(builder, scenario)
    plant: ExactPeg = builder.AddNamedSystem("plant", ExactPeg(scenario))
    return plant
