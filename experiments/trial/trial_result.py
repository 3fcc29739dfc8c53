"""The result of a rig trial."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from skill.data.outcome import Outcome, parse_outcome
from systems.law.faults import Fault

TRUSTED_OVERLAP = 0.25
"""Largest overlap of the bodies in a trial whose physics is trusted, over the clearance."""

NUMBERS = {  # key of a record -> (field, SI units in a unit of the key, digits)
    "time_s": ("time", 1.0, 3),
    "depth_mm": ("depth", 1e-3, 2),
    "peak_axial_n": ("peak_axial_force", 1.0, 1),
    "peak_lateral_n": ("peak_lateral_force", 1.0, 1),
    "peak_moment_nm": ("peak_moment", 1.0, 3),
    "penetration_um": ("penetration", 1e-6, 1),
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
    "unknown_s": ("unknown_time", 1.0, 2),
    "unsupported_s": ("unsupported_time", 1.0, 2),
}

COUNTS = ("steps", "lost_steps", "back_offs")

PHYSICS = {True: "trusted", False: "not trusted"}


@dataclass(frozen=True, kw_only=True)
class ForceFigures:
    """The forces of a trial. All but the measured load are those of the true contact.

    Attributes:
        peak_axial_force: largest net contact force along the peg, N.
        peak_lateral_force: largest net contact force across the peg, N. Opposite forces of a wedge cancel in it.
        peak_moment: largest net contact moment about the tip, N m.
        peak_load: largest load of the net contact wrench, N (`skill.features.measurement.contact_loads`).
        mean_load: mean of the load over the time in which it is at least `TOUCH_LOAD`, N; 0 if it never is. It and
            the limits below are in `experiments.trial.force_metrics`.
        time_above_20n: time in which the load is above `HIGH_LOAD`, s.
        force_above_20n: time in which the size of the net contact force is above `HIGH_LOAD`, s.
        first_touch: integral of the size of the net contact force over `FIRST_TOUCH_TIME` from the first load of
            `TOUCH_LOAD` on, N s; over the rest of the trial if that is shorter.
        peak_contact_force: largest normal force of any single contact, N.
        peak_measured_load: largest load of the wrench that the sensor monitor passes on, N.
    """

    peak_axial_force: float
    peak_lateral_force: float
    peak_moment: float
    peak_load: float
    mean_load: float
    time_above_20n: float
    force_above_20n: float
    first_touch: float
    peak_contact_force: float
    peak_measured_load: float


@dataclass(frozen=True, kw_only=True)
class TrialResult(ForceFigures):
    """The result of a rig trial, in SI units.

    Attributes:
        seed: number of the trial.
        tilt: tilt of the peg relative to the hole at the start, about x and y, rad.
        outcome: how the trial ended. ``FAULT``: the rig detected `fault`, retracted the peg and stopped.
            ``DIVERGED``, ``FAILED``: the simulation could not continue.
        time: simulated time, s.
        depth: depth of the tip at the end, m.
        penetration: deepest overlap of the exact bodies at the recorded samples, m.
        steps: number of microsteps that both steppers took.
        lost_steps: number of microsteps that both steppers lost.
        back_offs: how often the controller backed the peg off.
        unknown_time: time in which the contact state was unknown, s.
        unsupported_time: time in which the support of the action was below 1, s.
        states: numbers of the contact states visited, in order.
        fault: the detected fault.
        detail: text that adds to the outcome, such as the message of an exception.
        wedged_time: time in which the peg was wedged, s; see `experiments.trial.stuck_peg`.
        path_length: see `experiments.trial.motion_metrics.MotionFigures`, m.
        mean_jerk: m/s^3.
        field_score: points by the rule in `experiments.trial.field_score`, at most 100.
        trusted: whether `penetration` is at most `TRUSTED_OVERLAP` of the clearance. The figures of a trial with a
            deeper overlap say little about bodies of metal.
    """

    seed: int
    tilt: tuple[float, float]
    outcome: Outcome
    time: float
    depth: float
    penetration: float
    steps: int
    lost_steps: int
    back_offs: int
    unknown_time: float
    unsupported_time: float
    states: tuple[int, ...]
    wedged_time: float
    path_length: float
    mean_jerk: float
    field_score: float
    trusted: bool
    fault: Fault = Fault.NONE
    detail: str = ""

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
            fault, detail = _parse_fault(row["reason"])
            outcome, other = (Outcome.FAULT, detail) if fault is not Fault.NONE else parse_outcome(row["reason"])
            pitch, yaw = row["tilt_deg"]
            return cls(
                seed=row["seed"],
                tilt=(math.radians(pitch), math.radians(yaw)),
                outcome=outcome,
                fault=fault,
                detail=other,
                states=tuple(row["states"]),
                trusted={text: trusted for trusted, text in PHYSICS.items()}[row["physics"]],
                **{field: unit * _number(row[key]) for key, (field, unit, _) in NUMBERS.items()},
                **{key: row[key] for key in COUNTS},
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise ValueError(f"not the result of a trial ({type(error).__name__}: {error})") from error

    def record(self) -> dict[str, Any]:
        """Returns the row for ``results.json`` and run files: in mm, um and degrees, and rounded."""
        return {
            "seed": self.seed,
            "tilt_deg": [round(math.degrees(t), 4) for t in self.tilt],
            "inserted": self.inserted,
            "reason": self.reason,
            **{key: round(getattr(self, field) / unit, digits) for key, (field, unit, digits) in NUMBERS.items()},
            "physics": PHYSICS[self.trusted],
            **{key: getattr(self, key) for key in COUNTS},
            "states": list(self.states),
        }


def _number(value: object) -> Any:
    """Returns a value that is a number as it is."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r} is no number")
    return value


def _parse_fault(reason: str) -> tuple[Fault, str]:
    """Returns the fault with which the text of a reason begins, and the detail after it; ``Fault.NONE`` without one."""
    for fault in Fault:
        if fault is not Fault.NONE and (reason == fault.label or reason.startswith(f"{fault.label}: ")):
            return fault, reason[len(fault.label) + 2 :]
    return Fault.NONE, ""
