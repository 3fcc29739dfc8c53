"""One rig trial: build, simulate, watch, measure; one row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np
from joblib import Parallel, delayed
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from models.scenario import TRIAL_STREAM, Scenario, dump_scenario, resolve_scenario
from skill.rig_run import RigRun
from systems.contact_plant import ABSURD_FORCE
from systems.control_law import RigPolicy
from systems.provenance import versions
from systems.rig import MakeRig, RigDiagram


@dataclass(frozen=True)
class TrialResult:
    """What a trial came to.

    Attributes:
        seed: the number of the trial.
        tilt_deg: of the peg relative to the hole at the start, about x and y.
        inserted: whether the peg reached full depth.
        reason: "inserted", "time over", or why the trial ended early.
        time_s: simulated seconds.
        depth_mm: of the tip at the end.
        peak_axial_n: largest contact force along the peg.
        peak_lateral_n: largest contact force across it.
        steps: taken by both steppers.
        lost_steps: by both.
        back_offs: how often the supervisor drew the peg back.
        unknown_s: seconds in which no contact state explained what was felt.
        states: the contact states visited, in order, as numbers.
    """

    seed: int
    tilt_deg: list[float]
    inserted: bool
    reason: str
    time_s: float
    depth_mm: float
    peak_axial_n: float
    peak_lateral_n: float
    steps: int
    lost_steps: int
    back_offs: int
    unknown_s: float
    states: list[int]


class TrialMonitor:
    """Watches a running rig: ends the trial when the peg is in or the numbers are not, and keeps the peak forces.

    Attributes:
        reason: why the trial ended; "time over" until something else does.
        peaks: largest axial and lateral contact force so far, N.
        depth: of the tip, m.
    """

    def __init__(self, rig: RigDiagram, full_depth: float) -> None:
        self._rig = rig
        self._full_depth = full_depth
        self.reason = "time over"
        self.peaks = np.zeros(2)
        self.depth = float("nan")

    def __call__(self, context: Context) -> EventStatus:
        """The Simulator's monitor."""
        plant = self._rig.contact
        own = plant.reaction_forces.get_system().GetMyContextFromRoot(context)
        held = plant.reaction_forces.Eval(own)[plant.sensor].translational()
        self.depth = -plant.tip_height(context)
        if not (np.isfinite(held).all() and np.isfinite(self.depth)):
            return self._end("diverged: a force or a position is not finite")
        if np.linalg.norm(held) > ABSURD_FORCE:
            return self._end(f"diverged: a contact force of {np.linalg.norm(held):.3g} N")
        if context.get_time() > 0:
            # The peg's own inertia is in the reaction too; at these speeds it is a small part of a newton.
            axial, lateral = abs(held[2] - plant.weight), np.hypot(held[0], held[1])
            self.peaks = np.maximum(self.peaks, [axial, lateral])
        if self.depth >= self._full_depth:
            return self._end("inserted")
        return EventStatus.DidNothing()

    def _end(self, reason: str) -> EventStatus:
        self.reason = reason
        return EventStatus.ReachedTermination(self._rig.diagram, reason)


def trial_scenario(scenario: Scenario, *, number: int) -> Scenario:
    """The resolved scenario of trial ``number``; it shares no draw with any demonstration."""
    return resolve_scenario(scenario, seed=number, stream=TRIAL_STREAM)


def run_trials(
    scenario: Scenario, skill: RigPolicy, numbers: list[int], *, jobs: int
) -> Iterator[tuple[TrialResult, RigRun]]:
    """Yields the trials in their order, as they are finished; ``jobs`` processes."""
    yield from Parallel(n_jobs=jobs, return_as="generator")(
        delayed(run_trial)(trial_scenario(scenario, number=n), skill, seed=n) for n in numbers
    )


def run_trial(
    scenario: Scenario, skill: RigPolicy, *, seed: int, meshcat: Meshcat | None = None
) -> tuple[TrialResult, RigRun]:
    """Simulates one resolved scenario; a simulation that diverges ends with its reason, not with an exception.

    Args:
        scenario: resolved (see `resolve_scenario`).
        skill: what controls the rig.
        seed: the number of the trial, for the record.
        meshcat: where to draw and record; None draws nothing.
    """
    return run_rig(MakeRig(scenario, skill, meshcat=meshcat), scenario, skill, seed=seed)


def run_rig(rig: RigDiagram, scenario: Scenario, skill: RigPolicy, *, seed: int) -> tuple[TrialResult, RigRun]:
    """The same, with a rig that is already built of this scenario and skill."""
    simulator = Simulator(rig.diagram)
    context = simulator.get_mutable_context()
    rig.set_start(context)
    monitor = TrialMonitor(rig, scenario.full_depth)
    simulator.set_monitor(monitor)
    try:
        simulator.AdvanceTo(scenario.trial.time_limit)
    except RuntimeError as error:  # Drake's solver gave up
        monitor.reason = f"diverged: {str(error).splitlines()[0][:120]}"
    samples = rig.recorder.samples(context)
    last = samples.iloc[-1]
    states = samples["state"].to_numpy(dtype=int)
    result = TrialResult(
        seed=seed,
        tilt_deg=[round(float(np.degrees(t)), 2) for t in scenario.start.tilt or []],
        inserted=monitor.reason == "inserted",
        reason=monitor.reason,
        time_s=round(context.get_time(), 3),
        depth_mm=round(1e3 * monitor.depth, 2),
        peak_axial_n=round(float(monitor.peaks[0]), 1),
        peak_lateral_n=round(float(monitor.peaks[1]), 1),
        steps=int(last["pitch_taken"] + last["yaw_taken"]),
        lost_steps=int(last["pitch_lost"] + last["yaw_lost"]),
        back_offs=int((samples["guard"].diff() > 0).sum()),
        unknown_s=round(scenario.controller.period * float((samples["known"] == 0).sum()), 2),
        states=[int(s) for s in states[np.flatnonzero(np.diff(states, prepend=-1))]],
    )
    metadata = {
        "geometry": asdict(scenario.geometry),
        "rig": asdict(scenario.rig),
        "force_limit": scenario.controller.force_limit,
        "state_names": skill.state_names(),
        "scenario": dump_scenario(scenario),
        "versions": versions(),
    }
    return result, RigRun(samples=samples, result=asdict(result), metadata=metadata)
