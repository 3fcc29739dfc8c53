"""One rig trial: build, simulate, watch, measure; one row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, EventStatus

from models.scenario import TRIAL_STREAM, Scenario, dump_scenario, resolve_scenario
from skill.data.outcome import Outcome
from skill.data.rig_run import RigRun
from systems.control.faults import Fault, one_line
from systems.control.policy import RigPolicy
from systems.plant.contact_plant import DIVERGENCE_FORCE
from systems.rig import MakeRig, RigDiagram
from systems.runs.jamming import is_jammed
from systems.runs.penetration import deepest_overlap
from systems.runs.provenance import versions
from systems.runs.trial_result import TrialResult


class TrialMonitor:
    """Watches a running rig: ends the trial when the peg is in or the numbers are not, and keeps what is measured.

    Attributes:
        outcome: how the trial ended; ``TIME_OVER`` until something else ends it.
        detail: what the outcome alone does not say.
        peaks: largest axial and lateral contact force (N) and moment about the tip (N m) so far.
        depth: of the tip, m.
    """

    def __init__(self, rig: RigDiagram, scenario: Scenario) -> None:
        self._rig = rig
        self._scenario = scenario
        self._next_pose = 0.0
        self._poses: list[NDArray[np.float64]] = []
        self.outcome = Outcome.TIME_OVER
        self.detail = ""
        self.peaks = np.zeros(3)
        self.depth = float("nan")

    def __call__(self, context: Context) -> EventStatus:
        """The Simulator's monitor."""
        wrench = self._rig.contact_wrench(context)
        self.depth = -self._rig.contact.tip_height(context)
        if not (np.isfinite(wrench).all() and np.isfinite(self.depth)):
            return self._end(Outcome.DIVERGED, "a force or a position is not finite")
        force = float(np.linalg.norm(wrench[:3]))
        if force > DIVERGENCE_FORCE:
            return self._end(Outcome.DIVERGED, f"a contact force of {force:.3g} N")
        time = context.get_time()
        if time > 0:
            sizes = [abs(wrench[2]), np.hypot(wrench[0], wrench[1]), np.linalg.norm(wrench[3:])]
            self.peaks = np.maximum(self.peaks, sizes)
        if time >= self._next_pose - 1e-9:
            X_HP = self._rig.contact.peg_in_hole(context)
            self._poses.append(np.concatenate([X_HP.translation(), X_HP.rotation().col(2)]))
            self._next_pose += self._scenario.controller.period
        if self.depth >= self._scenario.full_depth:
            return self._end(Outcome.INSERTED)
        if self._rig.stopped(context):
            return self._end(Outcome.FAULT)
        return EventStatus.DidNothing()

    def penetration(self) -> float:
        """Deepest overlap of the round bodies, m, at one pose a controller period."""
        poses = np.array(self._poses).reshape(-1, 6)
        return deepest_overlap(self._scenario.geometry, poses[:, :3], poses[:, 3:])

    def _end(self, outcome: Outcome, detail: str = "") -> EventStatus:
        self.outcome, self.detail = outcome, detail
        return EventStatus.ReachedTermination(self._rig.diagram, outcome.text(detail))


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
    """Simulates one resolved scenario; whatever goes wrong while it runs ends it with its reason, not an exception.

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
    monitor = TrialMonitor(rig, scenario)
    simulator.set_monitor(monitor)
    try:
        simulator.AdvanceTo(scenario.trial.time_limit)
    except RuntimeError as error:  # Drake's solver gave up
        monitor.outcome, monitor.detail = Outcome.DIVERGED, one_line(error)
    except (Exception, SystemExit) as error:  # one faulty trial does not end the others
        monitor.outcome, monitor.detail = Outcome.FAILED, one_line(error)  # Drake's assertions raise SystemExit
    samples = rig.recorder.samples(context)
    fault = Fault.NONE
    if monitor.outcome in (Outcome.TIME_OVER, Outcome.FAULT):
        fault = rig.fault(context)
        if fault is not Fault.NONE:
            monitor.outcome, monitor.detail = Outcome.FAULT, rig.failure(context)
        elif is_jammed(samples["time"].to_numpy(), samples["depth"].to_numpy(), samples[["fx", "fy", "fz"]].to_numpy()):
            monitor.outcome = Outcome.JAMMED
    last = samples.iloc[-1]
    states = samples["state"].to_numpy(dtype=int)
    tilt = scenario.start.tilt or [0.0, 0.0]
    result = TrialResult(
        seed=seed,
        tilt=(tilt[0], tilt[1]),
        outcome=monitor.outcome,
        detail=monitor.detail,
        fault=fault,
        time=context.get_time(),
        depth=monitor.depth,
        peak_axial_force=float(monitor.peaks[0]),
        peak_lateral_force=float(monitor.peaks[1]),
        peak_moment=float(monitor.peaks[2]),
        penetration=monitor.penetration(),
        steps=int(last["pitch_taken"] + last["yaw_taken"]),
        lost_steps=int(last["pitch_lost"] + last["yaw_lost"]),
        back_offs=int((samples["guard"].diff() > 0).sum()),
        unknown_time=scenario.controller.period * float((samples["known"] == 0).sum()),
        unsupported_time=scenario.controller.period * float((samples["support"] < 1.0).sum()),
        states=tuple(int(s) for s in states[np.flatnonzero(np.diff(states, prepend=-1))]),
    )
    metadata = {
        "geometry": asdict(scenario.geometry),
        "rig": asdict(scenario.rig),
        "force_limit": scenario.controller.force_limit,
        "state_names": skill.state_names(),
        "scenario": dump_scenario(scenario),
        "versions": versions(),
    }
    return result, RigRun(samples=samples, result=result.record(), metadata=metadata)
