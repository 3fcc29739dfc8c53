"""The result of a rig trial."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TrialResult:
    """What a trial came to.

    Attributes:
        seed: the number of the trial.
        tilt_deg: of the peg relative to the hole at the start, about x and y.
        inserted: whether the peg reached full depth.
        reason: "inserted"; "jammed" or "time over", when the time ran out with the peg stuck (`is_jammed`) or not; or
            the fault that the rig noticed (`FAULT_NAMES`), after which it drew back and stopped; or why the simulation
            did not go on.
        time_s: simulated seconds.
        depth_mm: of the tip at the end.
        peak_axial_n: largest contact force along the peg.
        peak_lateral_n: largest contact force across it.
        peak_moment_nm: largest contact moment about the tip.
        penetration_um: deepest overlap of the round bodies at the recorded samples, of the simulated contact.
        steps: taken by both steppers.
        lost_steps: by both.
        back_offs: how often the supervisor drew the peg back.
        unknown_s: seconds in which no contact state explained what was felt.
        unsupported_s: seconds in which the skill remembered too little that is like what was felt.
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
    peak_moment_nm: float
    penetration_um: float
    steps: int
    lost_steps: int
    back_offs: int
    unknown_s: float
    unsupported_s: float
    states: list[int]
