"""The result of a rig trial."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from skill.data.outcome import Outcome, parse_outcome
from systems.control.faults import Fault

TRUSTED_OVERLAP = 0.25
"""Largest overlap of the bodies in a trial whose physics is trusted, over the clearance."""

LATER_NUMBERS = {  # key -> (field, SI units in a unit of the key, digits); not in the records of earlier versions
    "peak_contact_n": ("peak_contact_force", 1.0, 1),
    "peak_load_n": ("peak_load", 1.0, 1),
    "mean_load_n": ("mean_load", 1.0, 2),
    "seconds_above_20n": ("time_above_20n", 1.0, 3),
    "first_touch_ns": ("first_touch", 1.0, 3),
    "peak_measured_load_n": ("peak_measured_load", 1.0, 1),
    "force_above_20n_s": ("force_above_20n", 1.0, 3),
    "wedged_s": ("wedged_time", 1.0, 3),
    "path_mm": ("path_length", 1e-3, 2),
    "jerk_ms3": ("mean_jerk", 1.0, 2),
    "field_score": ("field_score", 1.0, 2),
}

PHYSICS = {True: "trusted", False: "not trusted"}


@dataclass(frozen=True)
class TrialResult:
    """The result of a rig trial, in SI units.

    Attributes:
        seed: number of the trial.
        tilt: tilt of the peg relative to the hole at the start, about x and y, rad.
        outcome: how the trial ended. ``FAULT``: the rig detected `fault`, retracted the peg and stopped.
            ``DIVERGED``, ``FAILED``: the simulation could not continue.
        time: simulated time, s.
        depth: depth of the tip at the end, m.
        peak_axial_force: see `experiments.metrics.force_metrics.ForceFigures`, as for the other forces.
        peak_lateral_force: N.
        peak_moment: N m.
        penetration: deepest overlap of the round bodies at the recorded samples, m.
        steps: number of microsteps that both steppers took.
        lost_steps: number of microsteps that both steppers lost.
        back_offs: how often the controller backed the peg off.
        unknown_time: time in which the contact state was unknown, s.
        unsupported_time: time in which the support of the action was below 1, s.
        states: numbers of the contact states visited, in order.
        fault: the detected fault.
        detail: text that adds to the outcome, such as the message of an exception.
        peak_contact_force: N; None, like all that follows, in results that were written before it was recorded.
        peak_load: N.
        mean_load: N.
        time_above_20n: s.
        first_touch: N s.
        peak_measured_load: N.
        force_above_20n: s.
        wedged_time: time in which the peg was wedged, s; see `experiments.metrics.wedging`.
        path_length: see `experiments.metrics.motion_metrics.MotionFigures`, m.
        mean_jerk: m/s^3.
        field_score: points by the rule in `experiments.metrics.field_score`, at most 100.
        trusted: whether `penetration` is at most `TRUSTED_OVERLAP` of the clearance. The figures of a trial with a
            deeper overlap say little about bodies of metal.
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
    peak_contact_force: float | None = None
    peak_load: float | None = None
    mean_load: float | None = None
    time_above_20n: float | None = None
    first_touch: float | None = None
    peak_measured_load: float | None = None
    force_above_20n: float | None = None
    wedged_time: float | None = None
    path_length: float | None = None
    mean_jerk: float | None = None
    field_score: float | None = None
    trusted: bool | None = None

    @property
    def inserted(self) -> bool:
        """Whether the peg reached full depth."""
        return self.outcome is Outcome.INSERTED

    @property
    def reason(self) -> str:
        """Why the trial ended, as text."""
        if self.outcome is Outcome.FAULT:
            return f"{self.fault.label}: {self.detail}" if self.detail else self.fault.label
        return self.outcome.text(self.detail)

    @classmethod
    def from_record(cls, row: Mapping[str, Any]) -> Self:
        """Inverts `record`, except for the rounding: ``from_record(row).record() == row``.

        Raises:
            ValueError: if a value is missing or has another type.
        """
        try:
            return cls._from_record(row)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ValueError(f"not the result of a trial ({type(error).__name__}: {error})") from error

    @classmethod
    def _from_record(cls, row: Mapping[str, Any]) -> Self:
        fault, detail = _parse_fault(row["reason"])
        outcome, other = (Outcome.FAULT, detail) if fault is not Fault.NONE else parse_outcome(row["reason"])
        pitch, yaw = row["tilt_deg"]
        return cls(
            seed=row["seed"],
            tilt=(math.radians(pitch), math.radians(yaw)),
            outcome=outcome,
            time=row["time_s"],
            depth=1e-3 * row["depth_mm"],
            peak_axial_force=row["peak_axial_n"],
            peak_lateral_force=row["peak_lateral_n"],
            peak_moment=row["peak_moment_nm"],
            penetration=1e-6 * row["penetration_um"],
            steps=row["steps"],
            lost_steps=row["lost_steps"],
            back_offs=row["back_offs"],
            unknown_time=row["unknown_s"],
            unsupported_time=row["unsupported_s"],
            states=tuple(row["states"]),
            fault=fault,
            detail=other,
            **{field: size * _number(row[key]) for key, (field, size, _) in LATER_NUMBERS.items() if key in row},
            trusted=_parse_physics(row["physics"]) if "physics" in row else None,
        )

    def record(self) -> dict[str, Any]:
        """Returns the row for ``results.json`` and run files: in mm, um and degrees, and rounded."""
        return {
            "seed": self.seed,
            "tilt_deg": [round(math.degrees(t), 4) for t in self.tilt],
            "inserted": self.inserted,
            "reason": self.reason,
            "time_s": round(self.time, 3),
            "depth_mm": round(1e3 * self.depth, 2),
            "peak_axial_n": round(self.peak_axial_force, 1),
            "peak_lateral_n": round(self.peak_lateral_force, 1),
            "peak_moment_nm": round(self.peak_moment, 3),
            "penetration_um": round(1e6 * self.penetration, 1),
            **{
                key: round(value / size, digits)
                for key, (field, size, digits) in LATER_NUMBERS.items()
                if (value := getattr(self, field)) is not None
            },
            **({} if self.trusted is None else {"physics": PHYSICS[self.trusted]}),
            "steps": self.steps,
            "lost_steps": self.lost_steps,
            "back_offs": self.back_offs,
            "unknown_s": round(self.unknown_time, 2),
            "unsupported_s": round(self.unsupported_time, 2),
            "states": list(self.states),
        }


def _number(value: object) -> float:
    """Returns the value of a later key as it is."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return value


def _parse_physics(text: object) -> bool:
    if text not in PHYSICS.values():
        raise ValueError(f"'physics' is {text!r}, expected one of {list(PHYSICS.values())}")
    return text == PHYSICS[True]


def _parse_fault(reason: str) -> tuple[Fault, str]:
    """Returns the fault with which the text of a reason begins, and the detail after it; ``Fault.NONE`` without one."""
    for fault in Fault:
        if fault is not Fault.NONE and (reason == fault.label or reason.startswith(f"{fault.label}: ")):
            return fault, reason[len(fault.label) + 2 :]
    return Fault.NONE, ""
