"""A trial by a diagram of the rig: simulation, monitoring and recording."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from experiments.trial.ended_trial import EndedTrial, Looks
from experiments.trial.force_metrics import force_figures
from experiments.trial.motion_metrics import motion_figures
from experiments.trial.penetration import deepest_overlap
from models.scenario import Scenario
from skill.arrays import Array
from skill.data.outcome import Ending, Outcome
from skill.features.measurement import load_of_components
from skill.policy.rig_policy import RigPolicy
from systems.law.faults import Fault, error_summary
from systems.plant.contact_forces import JOINED_SIZE, MAX_JOINED, Contact, contact_table, needs_contacts
from systems.plant.contact_plant import DIVERGENCE_FORCE
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram


class TrialMonitor:
    """A Simulator's monitor that ends a trial, and records until then what the rig does not record itself.

    The trial ends when the peg is inserted, when the policy has nothing new to try, when the watchdog has stopped the
    rig, or when the simulation diverges.
    The Simulator calls the monitor at every event of a system. What the plant shows changes only with its own step and
    is read once for each.

    Attributes:
        outcome: how the trial ended; ``TIME_OVER`` until something else ends it.
        detail: text that adds to the outcome.
        depth: depth of the tip, m.
    """

    def __init__(self, rig: RigDiagram, scenario: Scenario) -> None:
        self._rig = rig
        self._scenario = scenario
        self._next_row = 0.0
        self._step = -1  # number of the plant step that was read last
        self.outcome = Outcome.TIME_OVER
        self.detail = ""
        self.depth = float("nan")
        self._poses: list[Array] = []  # like the contacts, once a controller period
        self._contacts: list[tuple[int, Array]] = []
        self._tips: list[Array] = []  # after each step, like the wrenches
        self._wrenches: list[Array] = []
        self._largest = 0.0, 0.0  # load and extent at a step whose contacts were read
        self._peak_contact = 0.0

    def __call__(self, context: Context) -> EventStatus:
        """Records and checks one step; ``context`` is the diagram's."""
        time, ending = context.get_time(), None
        if time >= self._next_row - 1e-9:
            self._next_row += self._scenario.controller.period
            self._poses.append(self._rig.plant.peg_in_hole(context).GetAsMatrix34())
            self._contacts.append(contact_table(self._read_contacts(context)))
            ending = self._ending_of_control(context)
        step = math.ceil(time / self._scenario.contact.time_step - 1e-6)
        if ending is None and step != self._step:
            self._step = step
            ending = self._ending_of_step(context)
        if ending is None:
            return EventStatus.DidNothing()
        self.outcome, self.detail = ending.outcome, ending.detail
        return EventStatus.ReachedTermination(self._rig.diagram, ending.outcome.text(ending.detail))

    def measured(self, peak_measured_load: float) -> dict[str, Any]:
        """Returns what was recorded, with the largest measured load (N), as arguments of an `EndedTrial`."""
        g, step = self._scenario.geometry, self._scenario.contact.time_step
        poses, tables = np.reshape(self._poses, (-1, 3, 4)), [table for _, table in self._contacts]
        seen = np.array([count for count, _ in self._contacts], dtype=np.int64)
        return {
            "forces": force_figures(self._wrenches, g.reach, step, self._peak_contact, peak_measured_load),
            "motion": motion_figures(self._tips, step, g.hole_depth),
            "penetration": deepest_overlap(g, poses[:, :, 3], poses[:, :, :3]),
            "looks": Looks(seen, np.reshape(tables, (-1, MAX_JOINED, JOINED_SIZE))),
        }

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
        self._tips.append(self._rig.plant.peg_in_hole(context).translation())
        if context.get_time() > 0:
            self._wrenches.append(wrench)
            fx, fy, fz, mx, my, mz = wrench
            load = load_of_components(fx, fy, fz, mx, my, mz, self._scenario.geometry.reach)
            extent = self._rig.plant.contact_extent(context)
            # The single contacts cost more than the net wrench: between two rows they are read only where these grow.
            if needs_contacts(load, extent, *self._largest):
                self._largest = max(load, self._largest[0]), max(extent, self._largest[1])
                self._read_contacts(context)
        return Ending(Outcome.INSERTED) if self.depth >= self._scenario.full_depth else None

    def _read_contacts(self, context: Context) -> list[Contact]:
        contacts = self._rig.plant.contacts(context)
        self._peak_contact = max([self._peak_contact, *(contact.force for contact in contacts)])
        return contacts


_kept: list[tuple[object, RigDiagram]] = []
"""The rig of this process that was built last, and the cell for which it was built."""


def kept_rig(cell: object, scenario: Scenario, policy: RigPolicy) -> RigDiagram:
    """Returns a rig for a trial: the one that was built last if it was for the same cell.

    Drake 1.51 keeps each diagram with Python systems in its process, and building one takes as long as 50 ms of a
    trial.

    Args:
        cell: equal for trials whose scenarios and policy differ only in what `RigDiagram.set_trial` replaces.
        scenario: of the trial, resolved.
        policy: that acts; an equal one acts in a rig that was built before.

    Raises:
        ValueError: see `MakeRig`.
    """
    if not (_kept and _kept[0][0] == cell):
        _kept.clear()  # also if the next one cannot be built
        _kept.append((cell, MakeRig(scenario, policy)))
    return _kept[0][1]


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
        rig, monitor, context = self._rig, self.monitor, self.context
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
            **monitor.measured(rig.law.peak_load(context)),
        )
