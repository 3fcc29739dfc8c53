"""The result of a rig trial."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from skill.data.outcome import Outcome
from systems.control.faults import Fault


@dataclass(frozen=True)
class TrialResult:
    """The result of a rig trial, in SI units.

    Attributes:
        seed: number of the trial.
        tilt: of the peg relative to the hole at the start, about x and y, rad.
        outcome: how the trial ended. ``FAULT``: the rig noticed `fault`, retracted the peg and stopped.
            ``DIVERGED``, ``FAILED``: the simulation did not go on.
        time: simulated time, s.
        depth: of the tip at the end, m.
        peak_axial_force: largest contact force along the peg, N.
        peak_lateral_force: largest contact force across the peg, N.
        peak_moment: largest contact moment about the tip, N m.
        penetration: deepest overlap of the round bodies at the recorded samples, m.
        steps: taken by both steppers.
        lost_steps: lost by both steppers.
        back_offs: how often the force guard retracted the peg.
        unknown_time: time in which no contact state explained the measurement, s.
        unsupported_time: time in which the skill remembered too little like the measurement, s.
        states: the contact states visited, in order, as numbers.
        fault: the fault that the rig noticed.
        detail: what the outcome alone does not say, for example the message of an exception.
    """

    seed: int
    tilt: tuple[float, float]
    outcome: Outcome
    time: float
    depth: float
    peak_axial_force: float
    peak_lateral_force: float
    peak_moment: float
    penetration: float
    steps: int
    lost_steps: int
    back_offs: int
    unknown_time: float
    unsupported_time: float
    states: tuple[int, ...]
    fault: Fault = Fault.NONE
    detail: str = ""

    @property
    def inserted(self) -> bool:
        """Whether the peg reached full depth."""
        return self.outcome is Outcome.INSERTED

    @property
    def reason(self) -> str:
        """Why the trial ended, for a person."""
        if self.outcome is Outcome.FAULT:
            return f"{self.fault.label}: {self.detail}" if self.detail else self.fault.label
        return self.outcome.text(self.detail)

    def record(self) -> dict[str, Any]:
        """The row that ``results.json`` and a run file hold: units a person reads, rounded."""
        return {
            "seed": self.seed,
            "tilt_deg": [round(math.degrees(t), 2) for t in self.tilt],
            "inserted": self.inserted,
            "reason": self.reason,
            "time_s": round(self.time, 3),
            "depth_mm": round(1e3 * self.depth, 2),
            "peak_axial_n": round(self.peak_axial_force, 1),
            "peak_lateral_n": round(self.peak_lateral_force, 1),
            "peak_moment_nm": round(self.peak_moment, 3),
            "penetration_um": round(1e6 * self.penetration, 1),
            "steps": self.steps,
            "lost_steps": self.lost_steps,
            "back_offs": self.back_offs,
            "unknown_s": round(self.unknown_time, 2),
            "unsupported_s": round(self.unsupported_time, 2),
            "states": list(self.states),
        }
