"""A trial that has ended, as a diagram or the compiled loop leaves it, and the result and record that follow."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.provenance import versions
from experiments.trial.field_score import field_score
from experiments.trial.force_metrics import contact_rows
from experiments.trial.motion_metrics import MotionFigures
from experiments.trial.stuck_peg import is_jammed, wedged_samples, wedged_time
from experiments.trial.trial_result import TRUSTED_OVERLAP, ForceFigures, TrialResult
from models.scenario import Scenario, dump_scenario
from skill.arrays import Array
from skill.data.axes import AXES
from skill.data.outcome import UNPHYSICAL, Outcome
from skill.data.rig_run import CONTACT_COLUMNS, RigRun
from skill.policy.rig_policy import RigPolicy
from systems.law.faults import Fault


@dataclass(frozen=True)
class Looks:
    """What was seen of the contact once in each controller period, n times.

    Attributes:
        seen: (n,), numbers of contacts.
        contacts: (n, 5, 8), the contacts, see `systems.plant.contact_forces.join_contacts`.
    """

    seen: NDArray[np.int64]
    contacts: Array


@dataclass(frozen=True)
class EndedTrial:
    """A trial that has ended.

    Attributes:
        number: of the trial.
        scenario: resolved.
        outcome: what ended it; ``TIME_OVER`` if nothing did.
        detail: text that adds to the outcome.
        fault: that the rig has detected.
        failure: why the policy failed, or "".
        time: of the end, s.
        depth: of the tip at the end, m.
        samples: `LOGGED_COLUMNS`.
        forces: figures of the forces.
        motion: figures of the motion.
        penetration: deepest overlap of the exact bodies, once in each controller period, m.
        looks: contacts.
    """

    number: int
    scenario: Scenario
    outcome: Outcome
    detail: str
    fault: Fault
    failure: str
    time: float
    depth: float
    samples: pd.DataFrame
    forces: ForceFigures
    motion: MotionFigures
    penetration: float
    looks: Looks

    @cached_property
    def result(self) -> TrialResult:
        """The result of the trial."""
        outcome, detail, fault = self._ending()
        scenario, samples, looks = self.scenario, self.samples, self.looks
        last, period = samples.iloc[-1], scenario.controller.period
        states = samples["state"].to_numpy(dtype=int)
        wedged = wedged_samples(looks.seen, looks.contacts, scenario.contact.friction)
        pitch, yaw = scenario.start.tilt or [0.0, 0.0]
        score = field_score(
            inserted=outcome is Outcome.INSERTED,
            time=self.time,
            depth=self.depth,
            hole_depth=scenario.geometry.hole_depth,
            motion=self.motion,
            force_time=self.forces.force_above_20n,
        )
        return TrialResult(
            seed=self.number,
            tilt=(pitch, yaw),
            outcome=outcome,
            detail=detail,
            fault=fault,
            time=self.time,
            depth=self.depth,
            **asdict(self.forces),
            wedged_time=wedged_time(wedged, period),
            path_length=self.motion.path_length,
            mean_jerk=self.motion.mean_jerk,
            field_score=0.0 if outcome in UNPHYSICAL else score.total,
            penetration=self.penetration,
            trusted=self.penetration <= TRUSTED_OVERLAP * scenario.geometry.clearance,
            steps=int(sum(last[f"{axis}_taken"] for axis in AXES)),
            lost_steps=int(sum(last[f"{axis}_lost"] for axis in AXES)),
            back_offs=int((np.diff(samples["back_off"].to_numpy()) > 0).sum()),
            unknown_time=period * float((samples["known"].to_numpy() == 0).sum()),
            unsupported_time=period * float((samples["support"].to_numpy() < 1.0).sum()),
            states=tuple(int(s) for s in states[np.flatnonzero(np.diff(states, prepend=-1))]),
        )

    def record(self, policy: RigPolicy) -> RigRun:
        """Returns the record of the trial, in which ``policy`` acted."""
        scenario, samples = self.scenario, self.samples.copy()
        samples[list(CONTACT_COLUMNS)] = contact_rows(self.looks.seen, self.looks.contacts, len(samples))
        metadata = {
            "geometry": asdict(scenario.geometry),
            "carrier": scenario.carrier,
            "rig": asdict(scenario.rig),
            "force_limit": scenario.controller.guard.force_limit,
            "state_names": policy.state_names(),
            "scenario": dump_scenario(scenario),
            "versions": versions(),
        }
        return RigRun(samples=samples, result=self.result.record(), metadata=metadata)

    def _ending(self) -> tuple[Outcome, str, Fault]:
        """Returns outcome, detail and fault."""
        if self.outcome not in (Outcome.TIME_OVER, Outcome.FAULT):
            return self.outcome, self.detail, Fault.NONE
        if self.fault is not Fault.NONE:  # also if the time ran out before the rig had stopped
            return Outcome.FAULT, self.failure, self.fault
        samples = self.samples
        if is_jammed(samples["time"].to_numpy(), samples["depth"].to_numpy(), samples[["fx", "fy", "fz"]].to_numpy()):
            return Outcome.JAMMED, self.detail, self.fault
        return self.outcome, self.detail, self.fault
