"""One demonstration: build the virtual environment, simulate it, judge and return what was recorded."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from models.scenario import Scenario, dump_scenario
from skill.demonstration import Demonstration
from systems.demonstration_recorder import DemonstrationRecorder
from systems.provenance import versions
from systems.virtual_environment import MakeVirtualEnvironment


def run_demonstration(scenario: Scenario, *, meshcat: Meshcat | None = None) -> Demonstration:
    """Simulates a resolved scenario until the peg is in, the operator gives up, or the time is over."""
    environment = MakeVirtualEnvironment(scenario, meshcat=meshcat)
    simulator = Simulator(environment.diagram)
    environment.set_start(simulator.get_mutable_context())
    full_depth = scenario.full_depth
    withdrawn = 2.0 * scenario.start.height

    def monitor(context: Context) -> EventStatus:
        height = environment.peg_pose(context).translation()[2]
        if not np.isfinite(height):
            return EventStatus.ReachedTermination(environment.diagram, "diverged")
        if -height >= full_depth:
            return EventStatus.ReachedTermination(environment.diagram, "inserted")
        if height > withdrawn:
            return EventStatus.ReachedTermination(environment.diagram, "given up")
        return EventStatus.DidNothing()

    simulator.set_monitor(monitor)
    status = simulator.AdvanceTo(scenario.recorder.time_limit)
    samples = DemonstrationRecorder.samples(environment.log, simulator.get_context())
    outcome = status.message() if status.system() is not None else "time over"
    force = float(np.linalg.norm(samples[["fx", "fy", "fz"]].to_numpy(), axis=1).max())
    if outcome == "inserted" and force > scenario.recorder.rough_force:
        outcome = "inserted roughly"
    return Demonstration(
        samples=samples,
        good=outcome == "inserted",
        outcome=outcome,
        metadata={
            "seed": scenario.seed,
            "habit": scenario.operator.habit,
            "lowest_probe_energy_J": float(environment.energy_log.FindLog(simulator.get_context()).data()[1].min()),
            "geometry": asdict(scenario.geometry),
            "scenario": dump_scenario(scenario),
            "versions": versions(),
        },
    )
