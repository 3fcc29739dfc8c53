"""Demonstrations: simulation of the virtual environment, and evaluation of the record."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from experiments.provenance import versions
from experiments.trial.penetration import deepest_overlap
from experiments.trial.stuck_peg import is_jammed
from models.exact_geometry import rotations_of_vectors
from models.scenario import Scenario, dump_scenario
from skill.data.demonstration import Demonstration
from skill.data.outcome import Ending, Outcome
from systems.law.faults import error_summary
from systems.plant.contact_plant import DIVERGENCE_FORCE
from systems.recording.demonstration_recorder import DemonstrationRecorder
from systems.servo.probe import Probe
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_client import ServoClient
from systems.virtual_environment import MakeVirtualEnvironment, PegEnvironment

MAX_DELAY = 0.008
"""Longest delay of the simulation, s, that is made up for. After a longer one the simulation goes on from the present,
so that the servo's model of the contact stays younger than `systems.servo.stale_contact_fade.HOLD`."""


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


class ServedRun:
    """A demonstration in progress whose servo has a process of its own, at the pace of the servo's clock.

    Args:
        scenario: resolved.
        servo: of the person's device.

    Attributes:
        environment: that is simulated.
        run: the demonstration.
        probe: the newest that the servo has sent.
        steps: number of contact steps so far.
        late_steps: number of them that began after the end of their time.
    """

    def __init__(self, scenario: Scenario, servo: ServoClient) -> None:
        self.environment = MakeServedEnvironment(scenario)
        self.run = DemonstrationRun(scenario, self.environment)
        self._servo, self._period = servo, scenario.contact.time_step
        self.steps = self.late_steps = 0
        self._start = 0.0  # servo time at which the simulation would have begun without delays
        servo.begin(scenario)
        self.probe: Probe = servo.probe_at(0.0)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.steps * self._period

    def step(self) -> Ending | None:
        """Waits for the time of the next contact step and simulates it; returns how the demonstration ended, or None.

        Raises:
            OSError: if the servo is lost.
        """
        self.probe = self._servo.probe_at(self._start + self.time)
        behind = self.probe.time - self._start - self.time
        self.late_steps += int(behind > self._period)
        if behind > MAX_DELAY:
            self._start += behind
        context = self.run.simulator.get_mutable_context()
        self.environment.set_probe(context, self.probe)
        self.steps += 1
        ending = self.run.advance(self.time)
        self._servo.publish(self.environment.local_contact(context, self.probe.time + self._period))
        return ending
