"""Defines the parameters of the rig's control loop, in SI units."""

import math
from dataclasses import dataclass, field

from models.validation import PERIODS, limited

WRENCHES = ("true", "zero", "frozen", "shuffled")
SCALED = "scaled:"
"""What a policy may receive of the measured wrench: a name, or a factor after `SCALED`."""


def wrench_factor(text: str) -> float:
    """Returns the factor F of ``scaled:F``; NaN of any other text."""
    try:
        return float(text.removeprefix(SCALED)) if text.startswith(SCALED) else math.nan
    except ValueError:
        return math.nan


@dataclass
class ForceGuardParameters:
    """Limits of the force guard. The load is the norm of force and moment / reach of the peg, in N."""

    # 90 % of the samples of the default good demonstrations stay below 13 N of load, 99 % below 28 N. A skill that
    # pushes harder measures loads that few demonstrations contain.
    soft_force: float = 10.0  # in units of N of load, above which it reduces the feed, to zero halfway to hold_force
    hold_force: float = 20.0  # in units of N of load, at which turns that do not lower it are zero; above, it yields
    # In units of N of load, which the guard is to keep; impact loads count too. Above it the peg is backed off.
    force_limit: float = 40.0


@dataclass
class BackOffParameters:
    """When and how far the peg is drawn back to try again."""

    retract_speed: float = 0.015  # in units of m/s; also of the guard, and after a fault
    distance: float = 1.0e-3  # in units of m
    time: float = 0.4  # in units of s, maximum duration of a back-off, and duration of the retraction after a fault
    stall_time: float = 0.6  # in units of s; pushing this long without progress backs the peg off
    stall_depth: float = 0.2e-3  # in units of m; a smaller increase of the depth is no progress
    unknown_feed: float = 0.5  # factor on the feed while the contact state is unknown
    doubt_time: float = 1.0  # in units of s; the peg is backed off if nothing is recognised for this long
    # After a first attempt, turns make it worse if the lateral force grows so over such a turn and time without a gain.
    worse_force: float = 3.0  # in units of N
    worse_turn: float = math.radians(0.3)  # in units of rad
    worse_time: float = 0.2  # in units of s
    worse_depth: float = 0.05e-3  # in units of m; a smaller increase of the depth is no gain
    reversal_depth: float = 2.0e-3  # in units of m; this much deeper than where turns were reversed they no longer are
    max_repeats: int = 4  # attempts that end like the one before, after which the policy has nothing new to try


@dataclass
class DriveMonitorParameters:
    """Thresholds of the monitor of the feed drive, and the limits of its travel."""

    stall_depth: float = 0.2e-3  # in units of m; a smaller change of the travel is no motion
    stall_distance: float = 1.0e-3  # in units of m, commanded without motion before the feed counts as stalled
    # The speed loop stops from full feed within 0.3 mm.
    follow_error: float = 0.4e-3  # in units of m, of motion against the command before the feed counts as faulty
    travel_above: float = 0.010  # in units of m, from the start height to the upper limit of the travel
    travel_below: float = 1.0e-3  # in units of m, from the bottom of the hole to the lower limit of the travel


@dataclass
class ControllerParameters:
    """The control loop: gain and limits of the policy controller, and the parameters of what guards it."""

    period: float = limited(0.02, **PERIODS)  # in units of s
    gain: float = limited(1.0, low=0.0)  # factor on the turns of the policy
    max_turn_rate: float = math.radians(12.0)  # in units of rad/s; impact loads limit it further (`ForceGuard`)
    max_turn: float = math.radians(8.0)  # in units of rad, on each axis, to either side of the start
    max_feed_speed: float = 0.030  # in units of m/s
    # One of WRENCHES or scaled:FACTOR: what the policy receives of the measured wrench. What guards the peg has all.
    wrench: str = "true"
    guard: ForceGuardParameters = field(default_factory=ForceGuardParameters)
    back_off: BackOffParameters = field(default_factory=BackOffParameters)
    drive_monitor: DriveMonitorParameters = field(default_factory=DriveMonitorParameters)
