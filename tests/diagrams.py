"""Helpers that inspect a diagram."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram


def unconnected_inputs(diagram: Diagram) -> set[tuple[str, str]]:
    """Returns (system, port) of every input port of a subsystem that has no value."""
    context = diagram.CreateDefaultContext()
    return {
        (system.get_name(), system.get_input_port(k).get_name())
        for system in diagram.GetSystems()
        for k in range(system.num_input_ports())
        if not system.get_input_port(k).HasValue(system.GetMyContextFromRoot(context))
    }


def unused_plant_inputs(*instances: str) -> set[tuple[str, str]]:
    """Returns (system, port) of the inputs of a plant for parts that these model instances do not have."""
    ports = {"actuation", "applied_generalized_force", "surface_speeds"}  # the last one in newer versions of Drake
    for instance in ("WorldModelInstance", "DefaultModelInstance", *instances):
        ports |= {f"{instance}_actuation", f"{instance}_desired_state"}
    return {("plant", port) for port in ports}


def state_of(simulator: Simulator) -> NDArray[np.float64]:
    """Returns the time and all continuous and discrete state of a simulator's context."""
    context = simulator.get_context()
    parts = [context.get_discrete_state(k).value() for k in range(context.num_discrete_state_groups())]
    return np.concatenate([[context.get_time()], context.get_continuous_state_vector().CopyToVector(), *parts])
