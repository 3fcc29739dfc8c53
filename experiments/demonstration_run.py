"""Demonstrations: simulation of the virtual environment, and evaluation of the record."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from experiments.provenance import versions
from experiments.trial.jamming import is_jammed
from experiments.trial.penetration import deepest_overlap
from models.exact_geometry import rotations_of_vectors
from models.scenario import Scenario, dump_scenario
from skill.data.demonstration import Demonstration
from skill.data.outcome import Ending, Outcome
from systems.law.faults import error_summary
from systems.plant.contact_plant import DIVERGENCE_FORCE
from systems.recording.demonstration_recorder import DemonstrationRecorder
from systems.virtual_environment import MakeVirtualEnvironment, PegEnvironment


class DemonstrationRun:
    """A demonstration in progress, simulated in parts and evaluated at the end.

    Args:
        scenario: resolved.
        environment: environment of that scenario; by default with the simulated operator and without a display.
    """

    def __init__(self, scenario: Scenario, environment: PegEnvironment | None = None) -> None:
        self._scenario = scenario
        self._environment: PegEnvironment = environment or MakeVirtualEnvironment(scenario)
        self.simulator = Simulator(self._environment.diagram)
        self._environment.set_start(self.simulator.get_mutable_context())
        # The monitor must not refer to this run: Drake would then keep both, with the record, for ever.
        self.simulator.set_monitor(partial(_monitor, scenario, self._environment))
        self.simulator.Initialize()

    def advance(self, time: float) -> Ending | None:
        """Simulates until ``time`` (s) or the end of the demonstration; returns how it ended, or None."""
        try:
            status = self.simulator.AdvanceTo(min(time, self._scenario.recorder.time_limit))
        except RuntimeError as error:  # Drake's solver failed
            return Ending(Outcome.DIVERGED, error_summary(error))
        if status.system() is not None:
            return Ending(Outcome(status.message()))
        return Ending(Outcome.TIME_OVER) if time >= self._scenario.recorder.time_limit else None

    def demonstration(self, ending: Ending, *, good: bool | None = None, **metadata: Any) -> Demonstration:
        """Returns the recorded demonstration.

        Args:
            ending: how the demonstration ended.
            good: whether the operator calls it good; None: it is good if the peg was inserted gently.
            **metadata: additional metadata.
        """
        scenario, context = self._scenario, self.simulator.get_context()
        outcome, detail = ending.outcome, ending.detail
        samples = DemonstrationRecorder.samples(self._environment.log, context)
        samples = samples[np.isfinite(samples.to_numpy()).all(axis=1)]  # the rows before a divergence
        contact = samples[["fx", "fy", "fz"]].to_numpy()
        force = float(np.linalg.norm(contact, axis=1).max())
        if force > DIVERGENCE_FORCE:
            outcome, detail, good = Outcome.DIVERGED, f"a contact force of {force:.3g} N", False
        if outcome is Outcome.TIME_OVER and is_jammed(samples["time"].to_numpy(), -samples["z"].to_numpy(), contact):
            outcome = Outcome.JAMMED
        if outcome is Outcome.INSERTED and force > scenario.recorder.rough_force:
            outcome = Outcome.INSERTED_ROUGHLY
        R_HP = rotations_of_vectors(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy())
        overlap = deepest_overlap(scenario.geometry, samples[["x", "y", "z"]].to_numpy(), R_HP)
        return Demonstration(
            samples=samples,
            good=outcome is Outcome.INSERTED if good is None else good,
            outcome=outcome,
            detail=detail,
            metadata={
                "seed": scenario.seed,
                "habit": scenario.operator.habit,
                "lowest_probe_energy_J": self._environment.min_energy(context),
                "penetration_um": round(1e6 * overlap, 1),
                "geometry": asdict(scenario.geometry),
                "clocking": scenario.rig.clocking_stage,
                "scenario": dump_scenario(scenario),
                "versions": versions(),
                **metadata,
            },
        )


def _monitor(scenario: Scenario, environment: PegEnvironment, context: Context) -> EventStatus:
    """Ends a simulation that has diverged, succeeded, or given up."""
    height = environment.plant.peg_pose(context).translation()[2]
    if not np.isfinite(height):
        return EventStatus.ReachedTermination(environment.diagram, Outcome.DIVERGED)
    if -height >= scenario.full_depth:
        return EventStatus.ReachedTermination(environment.diagram, Outcome.INSERTED)
    if height > 2.0 * scenario.start.height:
        return EventStatus.ReachedTermination(environment.diagram, Outcome.GIVEN_UP)
    return EventStatus.DidNothing()


def run_demonstration(scenario: Scenario) -> Demonstration:
    """Simulates a resolved scenario until the peg is inserted, the operator gives up, or the time is over."""
    run = DemonstrationRun(scenario, MakeVirtualEnvironment(scenario))
    return run.demonstration(run.advance(scenario.recorder.time_limit) or Ending(Outcome.TIME_OVER))
