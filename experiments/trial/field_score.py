"""The score of a trial by the rule of a public challenge for contact-rich insertion.

The rule is that of the AI for Industry Challenge (Intrinsic, 2026; docs/scoring.md of
https://github.com/intrinsic-dev/aic), at most 100 points a trial:

======================  ===========================================================================================
validity                1 point: the policy runs
insertion               75 points inserted; else, with the plug in the port, 38 at its entrance to 50 at its bottom
duration                12 points up to 5 s, 0 from 60 s on
smoothness              6 points without jerk, 0 from 50 m/s^3 on (`experiments.trial.motion_metrics.mean_jerk`)
efficiency              6 points for a path no longer than the distance from start to port, 0 if it is 1 m longer
force                   -12 points if a force above 20 N lasts longer than 1 s in all
======================  ===========================================================================================

Points between two values are linear. Duration, smoothness and efficiency need points for the insertion.

What it means here: the plug is the peg, the port the hole, its entrance the mouth. The path is that of the tip relative
to the hole, because the rig moves both. The force is the size of the true net contact force; the challenge uses its
sensor. A simulation that broke down has 0 points.

What does not apply: the penalty of 24 points for contacts with forbidden things (there are none), that of 12 for a
wrong port (there is one hole), and the points for a plug outside the port: they need half the distance from the start,
and this rig starts nearer than that would allow.
"""

from __future__ import annotations

from dataclasses import dataclass

from experiments.trial.motion_metrics import MotionFigures

VALIDITY, INSERTION, DURATION, SMOOTHNESS, EFFICIENCY, FORCE = 1.0, 75.0, 12.0, 6.0, 6.0, -12.0  # points
ENTRANCE, BOTTOM = 38.0, 50.0  # points of a peg in the hole that is not inserted
FAST, SLOW = 5.0, 60.0  # in units of s
MAX_JERK = 50.0  # in units of m/s^3
MAX_DETOUR = 1.0  # in units of m
MAX_FORCE_TIME = 1.0  # in units of s, above `experiments.trial.force_metrics.HIGH_LOAD`


@dataclass(frozen=True)
class FieldScore:
    """The points of a trial, see the module; the parts in the order of its table."""

    insertion: float
    duration: float
    smoothness: float
    efficiency: float
    force: float

    @property
    def total(self) -> float:
        """The sum, with the point for a policy that runs."""
        return VALIDITY + self.insertion + self.duration + self.smoothness + self.efficiency + self.force


def field_score(
    *, inserted: bool, time: float, depth: float, hole_depth: float, motion: MotionFigures, force_time: float
) -> FieldScore:
    """Returns the points of a trial.

    Args:
        inserted: whether the peg reached full depth.
        time: duration of the trial, s.
        depth: depth of the tip below the mouth at the end, m.
        hole_depth: m.
        motion: path and jerk.
        force_time: time with a contact force above 20 N, s.
    """
    insertion = 0.0
    if inserted:
        insertion = INSERTION
    elif depth > 0.0:
        insertion = ENTRANCE + _part(depth, 0.0, hole_depth) * (BOTTOM - ENTRANCE)
    earned = 1.0 if insertion > 0.0 else 0.0
    detour = motion.path_length - motion.start_distance
    return FieldScore(
        insertion=insertion,
        duration=earned * DURATION * (1.0 - _part(time, FAST, SLOW)),
        smoothness=earned * SMOOTHNESS * (1.0 - _part(motion.mean_jerk, 0.0, MAX_JERK)),
        efficiency=earned * EFFICIENCY * (1.0 - _part(detour, 0.0, MAX_DETOUR)),
        force=FORCE if force_time > MAX_FORCE_TIME else 0.0,
    )


def _part(value: float, low: float, high: float) -> float:
    """Which part of the way from ``low`` to ``high`` a value is, from 0 to 1."""
    return min(1.0, max(0.0, (value - low) / (high - low)))
