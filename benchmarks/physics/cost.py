"""CPU time of the mechanics of the rig in each engine, alone, without sensors and control.

    python -m benchmarks.physics.cost [--json FILE]

A peg with a tilt of 3 degrees is lowered from 1 mm above the mouth and pressed with 10 N onto the mouth, for
``SECONDS``, by a constant force on the carriage: contact at the chamfer and the mouth, as in the slow part of a trial.
*CPU s a simulated second*: of the plant's steps. The engines take turns; the least of ``ROUNDS`` counts.
"""

from __future__ import annotations

import copy
import time
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from benchmarks.command_line import JsonFile, finish, run
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console
from models.scenario import ENGINES, TRIAL_STREAM, Scenario, resolve_scenario
from systems.plant.contact_plant import NominalBodies
from systems.rig import AddEngine

TILT, PUSH = np.radians(3.0), 10.0  # rad and N
SECONDS, ROUNDS = 1.0, 5


def cost(scenario: Scenario) -> tuple[float, float]:
    """Returns the CPU time of a simulated second, s, and the part of the time in contact, of a resolved scenario."""
    builder = DiagramBuilder()
    plant = AddEngine(builder, scenario)
    weight = NominalBodies.of(scenario).mass * 9.81
    force = builder.AddSystem(ConstantVectorSource([weight - PUSH]))
    angles = builder.AddSystem(ConstantVectorSource([TILT, 0.0, 0.0, 0.0]))
    builder.Connect(force.get_output_port(), plant.carriage_force)
    builder.Connect(angles.get_output_port(), plant.gimbal_equilibrium)
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    plant.set_start(context, carriage=scenario.sensor.height + 1e-3, angles=(TILT, 0.0))
    simulator.Initialize()
    touched, steps, cpu = 0, round(SECONDS / scenario.contact.time_step), 0.0
    for k in range(1, steps + 1):
        begun = time.process_time()
        simulator.AdvanceTo(k * scenario.contact.time_step)
        cpu += time.process_time() - begun
        touched += plant.contact_extent(context) > 0.0
    return cpu / SECONDS, touched / steps


def main(json: JsonFile = None) -> None:
    nominal = resolve_scenario(Scenario(), seed=0, stream=TRIAL_STREAM)
    scenarios = {}
    for name in ENGINES:
        scenarios[name] = copy.deepcopy(nominal)
        scenarios[name].contact.engine = name
        cost(scenarios[name])  # compiles
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in ENGINES}
    for _ in range(ROUNDS):
        for name in ENGINES:
            found[name].append(cost(scenarios[name]))
    least = {name: min(seconds for seconds, _ in values) for name, values in found.items()}
    table = plain_table("the rig's mechanics alone")
    for title in ("engine", "CPU s a simulated second", "of Drake's", "in contact"):
        table.add_column(title, justify="left" if title == "engine" else "right")
    rows: list[dict[str, Any]] = []
    for name in ENGINES:
        share = found[name][0][1]
        table.add_row(name, f"{least[name]:.3f}", f"{least[name] / least['drake']:.2f}", f"{100 * share:.0f} %")
        rows.append({"engine": name, "cpu_s": least[name], "contact": share})
    console.print(table)
    finish({"rows": rows}, json)


if __name__ == "__main__":
    run(main)
