"""Rig trials: simulation, monitoring and evaluation."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from enum import StrEnum
from functools import partial

import numpy as np
import pandas as pd
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from experiments.ended_trial import EndedTrial, Looks
from experiments.metrics.force_metrics import ForceMetrics
from experiments.metrics.motion_metrics import MotionMetrics
from experiments.metrics.penetration import deepest_overlap
from experiments.rollouts import rolled_out
from experiments.trial_result import TrialResult
from experiments.worker_pool import run_in_processes
from models.clearance import relative_entry_tilt
from models.scenario import STRESS_STREAM, TRIAL_STREAM, Scenario, resolve_scenario
from skill.arrays import Array
from skill.data.outcome import Ending, Outcome
from skill.data.rig_run import RigRun
from skill.policy import RigPolicy
from systems.plant.contact_forces import JOINED_SIZE, MAX_JOINED, contact_table
from systems.plant.contact_plant import DIVERGENCE_FORCE
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram
from systems.steps.faults import Fault, error_summary


class TrialRecord:
    """What is recorded of a trial beside what the rig records itself.

    Attributes:
        forces: the forces so far.
        motion: the motion of the peg so far.
    """

    def __init__(self, rig: RigDiagram, scenario: Scenario) -> None:
        self._rig, self._geometry = rig, scenario.geometry
        self._poses: list[Array] = []
        self._contacts: list[tuple[int, Array]] = []
        self.forces = ForceMetrics(scenario.geometry.reach, scenario.contact.time_step)
        self.motion = MotionMetrics(scenario.contact.time_step, scenario.geometry.hole_depth)

    def add_row(self, context: Context) -> None:
        """Records what is kept once a controller period."""
        X_HP = self._rig.plant.peg_in_hole(context)
        self._poses.append(X_HP.GetAsMatrix34())
        contacts = self._rig.plant.contacts(context)
        self.forces.add_contacts(contacts)
        self._contacts.append(contact_table(contacts))

    def add_step(self, context: Context, wrench: Array) -> None:
        """Records a step of the plant with the true contact wrench (6,).

        The single contacts cost more than the net wrench: between two rows they are read only where
        `ForceMetrics.needs_contacts` says so.
        """
        self.motion.add_step(self._rig.plant.peg_in_hole(context).translation())
        if context.get_time() > 0:
            self.forces.add_step(wrench)
            if self.forces.needs_contacts(wrench, self._rig.plant.contact_extent(context)):
                self.forces.add_contacts(self._rig.plant.contacts(context))

    def looks(self) -> Looks:
        """Returns what was recorded once a controller period."""
        seen, tables = [count for count, _ in self._contacts], [table for _, table in self._contacts]
        return Looks(np.array(seen, dtype=np.int64), np.reshape(tables, (-1, MAX_JOINED, JOINED_SIZE)))

    def penetration(self) -> float:
        """Returns the deepest overlap of the exact bodies at one pose per controller period, m."""
        poses = np.reshape(self._poses, (-1, 3, 4))
        return deepest_overlap(self._geometry, poses[:, :, 3], poses[:, :, :3])


class TrialMonitor:
    """A Simulator's monitor that ends a trial, and has it recorded until then.

    The trial ends when the peg is inserted, when the policy has nothing new to try, when the watchdog has stopped the
    rig, or when the simulation diverges.
    The Simulator calls the monitor at every event of a system. What the plant shows changes only with its own step and
    is read once for each.

    Attributes:
        outcome: how the trial ended; ``TIME_OVER`` until something else ends it.
        detail: text that adds to the outcome.
        record: of the trial.
        depth: depth of the tip, m.
    """

    def __init__(self, rig: RigDiagram, scenario: Scenario) -> None:
        self._rig = rig
        self._scenario = scenario
        self._next_row = 0.0
        self._step = -1  # number of the plant step that was read last
        self.outcome = Outcome.TIME_OVER
        self.detail = ""
        self.record = TrialRecord(rig, scenario)
        self.depth = float("nan")

    def __call__(self, context: Context) -> EventStatus:
        """Records and checks one step; ``context`` is the diagram's."""
        time, ending = context.get_time(), None
        if time >= self._next_row - 1e-9:
            self._next_row += self._scenario.controller.period
            self.record.add_row(context)
            ending = self._ending_of_control(context)
        step = math.ceil(time / self._scenario.contact.time_step - 1e-6)
        if ending is None and step != self._step:
            self._step = step
            ending = self._ending_of_step(context)
        if ending is None:
            return EventStatus.DidNothing()
        self.outcome, self.detail = ending.outcome, ending.detail
        return EventStatus.ReachedTermination(self._rig.diagram, ending.outcome.text(ending.detail))

    def _ending_of_control(self, context: Context) -> Ending | None:
        """Returns how watchdog or controller have ended the trial, if they have."""
        if self._rig.law.stopped(context):
            return Ending(Outcome.FAULT)
        tried = self._rig.law.tried(context)
        if tried and self._rig.law.fault(context) is Fault.NONE:  # after a fault the peg is still drawn back
            return Ending(Outcome.JAMMED, tried)
        return None

    def _ending_of_step(self, context: Context) -> Ending | None:
        """Records a step of the plant, and returns how it has ended the trial, if it has."""
        wrench = self._rig.contact_wrench(context)
        self.depth = -self._rig.plant.tip_height(context)
        if not (np.isfinite(wrench).all() and np.isfinite(self.depth)):
            return Ending(Outcome.DIVERGED, "a force or a position is not finite")
        force = math.hypot(*wrench[:3])
        if force > DIVERGENCE_FORCE:
            return Ending(Outcome.DIVERGED, f"a contact force of {force:.3g} N")
        self.record.add_step(context, wrench)
        return Ending(Outcome.INSERTED) if self.depth >= self._scenario.full_depth else None


class Arm(StrEnum):
    """Which trials of a scenario are performed."""

    DEFAULT = "default"
    """All that its ranges contain."""
    STRESS = "stress"
    """The hard ones: a tilt above `stress_tilt`, a pivot further than `STRESS_PIVOT` from the mouth, on either side,
    and a friction within `STRESS_FRICTION`."""


STRESS_TILT = math.radians(3.2)
STRESS_PIVOT = 1.2e-3  # in units of m
STRESS_FRICTION = (0.15, 0.3)


def stress_tilt(scenario: Scenario) -> float:
    """Returns the tilt above which a trial may be one of the arm `Arm.STRESS`, rad.

    It is `STRESS_TILT`. Below the nominal clearance it keeps its part of the largest tilt that enters the hole.
    """
    return STRESS_TILT * min(1.0, relative_entry_tilt(scenario))


def trial_scenario(scenario: Scenario, *, number: int, arm: Arm = Arm.DEFAULT) -> Scenario:
    """Returns the resolved scenario of a trial; it shares no random draw with any demonstration.

    Raises:
        ValueError: if the ranges of the scenario contain no trial of the arm.
    """
    chosen = scenario if arm is Arm.DEFAULT else _stress_scenario(scenario, number)
    return resolve_scenario(chosen, seed=number, stream=TRIAL_STREAM)


def _stress_scenario(scenario: Scenario, number: int) -> Scenario:
    """Returns a copy with the tilt, the pivot and the friction of a trial of the arm `Arm.STRESS`."""
    largest, furthest, least = scenario.start.tilt_range, scenario.rig.pivot_range, stress_tilt(scenario)
    if not (math.sqrt(2.0) * largest > 1.05 * least and furthest > STRESS_PIVOT):
        raise ValueError(
            f"start.tilt_range is {math.degrees(largest):.3g} deg and rig.pivot_range {1e3 * furthest:.3g} mm; expected"
            f" at least {math.degrees(0.75 * least):.2g} deg and more than {1e3 * STRESS_PIVOT:g} mm, or no trial is"
            " one of the stress arm"
        )
    rng = np.random.default_rng([STRESS_STREAM, number])
    tilt = np.zeros(2)
    while math.hypot(*tilt) <= least:
        tilt = rng.uniform(-largest, largest, 2)
    hard = copy.deepcopy(scenario)
    hard.start.tilt = [float(angle) for angle in tilt]
    hard.rig.pivot_height = float(rng.choice([-1.0, 1.0]) * rng.uniform(STRESS_PIVOT, furthest))
    hard.contact.friction, hard.contact.friction_spread = float(rng.uniform(*STRESS_FRICTION)), 0.0
    return hard


def run_trials(
    scenario: Scenario, skill: RigPolicy, numbers: list[int], *, jobs: int, arm: Arm = Arm.DEFAULT
) -> Iterator[tuple[TrialResult, RigRun]]:
    """Yields the trials in the order of their numbers, as they finish, from ``jobs`` processes."""
    tasks = (partial(run_trial, trial_scenario(scenario, number=n, arm=arm), skill, seed=n) for n in numbers)
    yield from run_in_processes(tasks, jobs=jobs)


def run_trial(
    scenario: Scenario, skill: RigPolicy, *, seed: int, meshcat: Meshcat | None = None
) -> tuple[TrialResult, RigRun]:
    """Simulates one resolved scenario. An error during the simulation becomes the outcome of the trial.

    Args:
        scenario: resolved (see `resolve_scenario`).
        skill: the policy that controls the rig.
        seed: number of the trial, for the record.
        meshcat: where to draw and record; None draws nothing.
    """
    ended = rolled_out(scenario, skill, number=seed) if meshcat is None else None
    if ended is None:
        ended = run_rig(MakeRig(scenario, skill, meshcat=meshcat), scenario, seed=seed)
    return ended.result, ended.record(skill)


def run_rig(rig: RigDiagram, scenario: Scenario, *, seed: int) -> EndedTrial:
    """Simulates a rig that was built from this scenario; see `run_trial`."""
    run = TrialRun(rig, scenario, number=seed)
    run.advance(scenario.trial.time_limit)
    return run.ended()


class TrialRun:
    """The simulation of one trial.

    Attributes:
        simulator: the simulator of the rig's diagram.
        context: the diagram's.
        monitor: what ends and records the trial.

    Args:
        rig: built from ``scenario``, or from one that `RigDiagram.set_trial` can replace by it.
        scenario: resolved.
        number: of the trial.
    """

    def __init__(self, rig: RigDiagram, scenario: Scenario, *, number: int) -> None:
        self._rig, self._scenario, self._number = rig, scenario, number
        self.simulator = Simulator(rig.diagram)
        self.context = self.simulator.get_mutable_context()
        if scenario == rig.scenario:
            rig.set_start(self.context)
        else:
            rig.set_trial(self.context, scenario)
        self.monitor = TrialMonitor(rig, scenario)
        self.simulator.set_monitor(self.monitor)

    def advance(self, time: float) -> None:
        """Simulates until a time, s, or until the trial ends; errors become outcomes."""
        try:
            self.simulator.AdvanceTo(time)
        except RuntimeError as error:  # Drake's solver failed
            self.monitor.outcome, self.monitor.detail = Outcome.DIVERGED, error_summary(error)
        except (Exception, SystemExit) as error:  # one trial must not end the others; Drake's asserts raise SystemExit
            self.monitor.outcome, self.monitor.detail = Outcome.FAILED, error_summary(error)

    @property
    def has_ended(self) -> bool:
        """Whether something has ended the trial, or its time limit is reached."""
        is_ended = self.monitor.outcome is not Outcome.TIME_OVER
        return is_ended or self.context.get_time() >= self._scenario.trial.time_limit

    def samples(self) -> pd.DataFrame:
        """Returns what the recorder of the rig has recorded so far."""
        return self._rig.recorder.samples(self.context)

    def ended(self) -> EndedTrial:
        """Returns the trial as if it ended now."""
        rig, monitor, context, record = self._rig, self.monitor, self.context, self.monitor.record
        return EndedTrial(
            number=self._number,
            scenario=self._scenario,
            outcome=monitor.outcome,
            detail=monitor.detail,
            fault=rig.law.fault(context),
            failure=rig.law.failure(context),
            time=context.get_time(),
            depth=monitor.depth,
            samples=self.samples(),
            forces=record.forces.figures(rig.law.peak_load(context)),
            motion=record.motion.figures(),
            penetration=record.penetration(),
            looks=record.looks(),
        )
