"""Checks that recorded numbers can be what they claim to be: units, ranges, sampling.

The limits are wide: they catch wrong units and nonsense, not unusual devices. They follow from the sizes of peg and
hole where the file states them, and otherwise from `DEFAULT_SIZE`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from skill.arrays import Array
from skill.data.axes import AXES
from skill.data.geometry import PegHoleGeometry

DEFAULT_SIZE = 0.5
"""Size of peg and hole in a file that does not state it, m."""

MAX_HEIGHT = 1.0
"""Largest distance of the tip from the mouth outside the hole, m; more for a peg that is long itself."""

MAX_TILT = math.radians(60.0)
"""Largest tilt of the peg relative to the hole, and largest turn of the hand or of the hole about x and y, rad."""

MAX_FORCE = 1e5
"""Largest force, N; a simulation with a greater one counts as diverged."""

MAX_LEVER = 10.0
"""Largest ratio of moments to forces (root mean squares), in lengths of peg and hole. Wedged pegs reach 6."""

MIN_MOMENT = 1e-6
"""Moments below this say nothing about their unit, N m."""

MAX_QUIET_FORCE = 0.02
"""Force below which a sensor would be quieter than any, N."""

MAX_BIAS = 2.0
"""Largest bias of a moment, N m; the limits of a scenario keep its simulated sensor within it."""

MAX_STEP_ANGLE = 0.1
"""Largest turn of the hole for one step of a stepper, rad; 1.8 deg is usual without a gear."""

MAX_HAND_SPEED = 5.0
"""Largest speed of the hand or of the feed, m/s."""

MAX_TURN_SPEED = 20.0
"""Largest angular speed of hand or peg, rad/s."""

MAX_PERIOD = 0.5
"""Largest sample period, s; at 2 Hz no contact can be followed."""

MAX_GAP, MAX_GAP_PERIODS = 1.0, 25.0
"""Largest gap between two samples: the larger of a time, s, and a number of sample periods."""

MAX_TIME = 86_400.0
"""Largest time since the start, s."""

EPOCH = (1e9, 5e9)
"""Times since 1970 from the years 2001 to 2128, s."""

MIN_SHARE = 0.5
"""Least depth, over that of the hole, at which a peg counts as inserted; no scenario allows less."""

TURN_RATIO = 8.0
"""Largest ratio, either way, between the sum of ``dangle`` and the turns between the orientations."""

MIN_TURN = 0.02
"""Turns below this sum say nothing about the unit of ``dangle``, rad."""

UNITS: dict[str, tuple[tuple[str, float], ...]] = {
    "m": (("millimetres", 1e-3), ("micrometres", 1e-6)),
    "m/s": (("millimetres per second", 1e-3),),
    "rad": (("degrees", math.pi / 180.0),),
    "rad/s": (("degrees", math.pi / 180.0),),
    "s": (("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)),
    "N": (("millinewtons", 1e-3),),
}
"""Other units that a number may be in, with their size, by the unit that is expected."""


@dataclass(frozen=True)
class Limits:
    """A range of physical values.

    Attributes:
        low: smallest value.
        high: largest value.
        unit: SI unit of both, a key of ``UNITS`` or "".
        why: what the range follows from.
        usual: least size of values in the right unit: of a single value, or of the spread of many.
    """

    low: float
    high: float
    unit: str = ""
    why: str = ""
    usual: float = 1e-3


def check_demonstration(samples: pd.DataFrame, geometry: PegHoleGeometry | None, where: str, *, inserted: bool) -> None:
    """Checks the samples of a demonstration (see `skill.data.demonstration` for the columns).

    Args:
        samples: the samples, with finite numbers.
        geometry: sizes of peg and hole, or None.
        where: name of the source, for error messages.
        inserted: whether the peg is said to have reached the bottom.

    Raises:
        ValueError: naming ``where``, the column, its range, the expected range and the likely unit.
    """
    _check_times(samples["time"], where)
    _check_columns(samples, {"angle": Limits(0.0, math.pi + 1e-9, "rad", "an angle about an axis")}, where)
    _check_depth(-samples["z"].to_numpy(dtype=float), "z", geometry, where)
    _check_columns(samples, dict.fromkeys(("z", "x", "y"), _reach(geometry)), where)
    _check_lateral(samples, geometry, where)
    if inserted and geometry is not None:
        _check_inserted(samples, geometry, where)
    _check_wrench(samples, geometry, where, measured=False)
    hand = dict.fromkeys(("ux", "uy", "uz"), Limits(-MAX_HAND_SPEED, MAX_HAND_SPEED, "m/s", "speed of the hand"))
    turn = Limits(-MAX_TURN_SPEED, MAX_TURN_SPEED, "rad/s", "angular speed")
    hand |= dict.fromkeys(("rx", "ry", "rz", "dangle"), turn)
    steps = np.diff(samples["time"].to_numpy(dtype=float))
    for name, limits in hand.items():  # the first row has no sample before it
        _check_range(samples[name].to_numpy(dtype=float)[1:] / steps, f"column '{name}' over time", limits, where)
    _check_turns(samples, where)


def check_run(samples: pd.DataFrame, geometry: PegHoleGeometry | None, states: int | None, where: str) -> None:
    """Checks the samples of a rig run (see `skill.data.rig_run` for the columns).

    Args:
        samples: the samples, with finite numbers.
        geometry: sizes of peg and hole, or None.
        states: number of contact states, or None if it is not known.
        where: name of the source, for error messages.

    Raises:
        ValueError: as `check_demonstration`.
    """
    _check_times(samples["time"], where)
    flag, count = Limits(0.0, 1.0), Limits(0.0, 1e9)
    angle = Limits(-MAX_TILT, MAX_TILT, "rad")
    _check_depth(-samples["tip_z"].to_numpy(dtype=float), "tip_z", geometry, where)
    _check_columns(samples, dict.fromkeys(("tip_z", "depth"), _reach(geometry)), where)
    _check_wrench(samples, geometry, where, measured=True)
    _check_columns(samples, dict.fromkeys([f"{t}{a}" for t in ("target_", "") for a in AXES], angle), where)
    _check_columns(samples, {"feed_speed": Limits(-MAX_HAND_SPEED, MAX_HAND_SPEED, "m/s"), "support": flag}, where)
    for name in AXES:
        steps = samples[f"{name}_taken"].to_numpy(dtype=float)[-1] + 2.0  # a rotor swings beyond its last step
        turned = samples[name].to_numpy(dtype=float) - float(samples[name].iloc[0])
        limit = Limits(-MAX_STEP_ANGLE * steps, MAX_STEP_ANGLE * steps, "rad", f"{steps - 2.0:.0f} steps were taken")
        _check_range(turned, f"the turn in column '{name}'", limit, where)
    reach = Limits(-_size(geometry), _size(geometry), "m")
    _check_columns(samples, dict.fromkeys(contact_columns(samples, forces=False), reach), where)
    _check_columns(samples, dict.fromkeys(contact_columns(samples), Limits(-MAX_FORCE, MAX_FORCE, "N")), where)
    whole = {"state": Limits(0.0, 1e3 if states is None else states - 1.0, "", f"{states or 'no'} state names")}
    whole |= {"known": flag, "back_off": flag, "fault": Limits(0.0, 1e3)}
    whole |= {"turning": Limits(-1.0, 1.0)}
    whole |= dict.fromkeys([f"{a}_{t}" for t in ("taken", "lost") for a in AXES], count)
    _check_columns(samples, whole, where)
    for name in whole:
        values = samples[name].to_numpy(dtype=float)
        broken = np.flatnonzero(values != np.rint(values))
        if broken.size:
            raise ValueError(
                f"{where}: column '{name}' holds {values[broken[0]]:g} in row {broken[0]}, expected whole numbers"
            )


def _check_times(times: pd.Series, where: str) -> None:
    """Checks the sampling: times, median step and longest gap."""
    values = times.to_numpy(dtype=float)
    steps = np.diff(values)
    period = float(np.median(steps)) if len(steps) else 0.0
    rounded = MAX_PERIOD * (1.0 + 1e-9)
    _check_range(np.array([period]), "the median step of column 'time'", Limits(0.0, rounded, "s"), where)
    since = "time since the start"
    if EPOCH[0] <= values.min() and values.max() <= EPOCH[1]:
        since += "; are these seconds since 1970?"
    _check_range(values, "column 'time'", Limits(-MAX_TIME, MAX_TIME, "s", since, usual=0.1), where)
    row = int(steps.argmax()) if len(steps) else 0
    longest = max(MAX_GAP, MAX_GAP_PERIODS * period)
    if len(steps) and steps[row] > longest:
        raise ValueError(
            f"{where}: column 'time' has a gap of {steps[row]:.6g} s after row {row}, expected steps of about"
            f" {period:.3g} s and at most {longest:.3g} s; split the recording there"
        )


def _reach(geometry: PegHoleGeometry | None) -> Limits:
    """How far from the mouth the tip can be, m."""
    size = max(MAX_HEIGHT, 3.0 * _size(geometry))
    return Limits(-size, size, "m", "the reach of the device", usual=1e-6)


def _size(geometry: PegHoleGeometry | None) -> float:
    """Length of peg and hole, m."""
    return DEFAULT_SIZE if geometry is None else geometry.peg_length + geometry.hole_depth


def _check_depth(depth: Array, name: str, geometry: PegHoleGeometry | None, where: str) -> None:
    """Checks that the tip, at a true depth (n,), m, does not pass the bottom of the hole."""
    if geometry is None:
        limits = Limits(-math.inf, DEFAULT_SIZE, "m", "depth below the mouth", usual=2e-3)
    else:
        bottom = geometry.hole_depth + 0.1 * (geometry.hole_depth + geometry.peg_radius)
        why = f"a hole of {1e3 * geometry.hole_depth:g} mm depth"
        limits = Limits(-math.inf, bottom, "m", why, usual=0.1 * geometry.hole_depth)
    _check_range(depth, f"the depth in column '{name}'", limits, where)


def _check_lateral(samples: pd.DataFrame, geometry: PegHoleGeometry | None, where: str) -> None:
    """Checks that the centre of the tip lies within the bore wherever it is deeper than the chamfer."""
    if geometry is None:
        return
    inside = samples["z"].to_numpy(dtype=float) < -geometry.chamfer
    why = f"the tip is inside a bore of radius {1e3 * geometry.hole_radius:g} mm"
    for name in ("x", "y"):
        limits = Limits(-geometry.hole_radius, geometry.hole_radius, "m", why, usual=1e-6)
        _check_range(samples[name].to_numpy(dtype=float)[inside], f"column '{name}'", limits, where)


def _check_inserted(samples: pd.DataFrame, geometry: PegHoleGeometry, where: str) -> None:
    """Checks that an inserted peg ends near the bottom; it may move for one more period after the last sample."""
    z = samples["z"].to_numpy(dtype=float)
    way = 2.0 * float(np.abs(np.diff(z)).max())
    least = MIN_SHARE * geometry.hole_depth - way
    if -z[-1] < least:
        flipped = "; z points out of the hole; is the sign flipped?" if z[-1] >= MIN_SHARE * geometry.hole_depth else ""
        raise ValueError(
            f"{where}: the outcome is 'inserted', but column 'z' ends at {1e3 * z[-1]:.4g} mm, expected below"
            f" {-1e3 * least:.4g} mm in a hole of {1e3 * geometry.hole_depth:g} mm depth{flipped}"
        )


def _check_wrench(samples: pd.DataFrame, geometry: PegHoleGeometry | None, where: str, *, measured: bool) -> None:
    """Checks the size of forces, and the lever at which they act.

    A sensor adds noise to forces and a bias to moments. The lever of a ``measured`` wrench therefore counts only where
    the forces are below the noise of any sensor, or the moments beyond the bias of any. Forces that are all zero say
    nothing about their unit.
    """
    forces = ("fx", "fy", "fz")
    _check_columns(samples, dict.fromkeys(forces, Limits(-MAX_FORCE, MAX_FORCE, "N")), where)
    force, moment = (_root_mean_square(samples, names) for names in (forces, ("mx", "my", "mz")))
    limit = MAX_LEVER * (0.1 if geometry is None else _size(geometry))
    biased = measured and (force == 0.0 or force > MAX_QUIET_FORCE) and moment < MAX_BIAS
    if moment <= max(limit * force, MIN_MOMENT) or biased:
        return
    # Usual forces are some newtons: smaller ones are rather in a greater unit than moments in a smaller one.
    likely = "columns fx, fy, fz look like kilonewtons" if force < 0.3 else "columns mx, my, mz look like N mm"
    raise ValueError(
        f"{where}: columns mx, my, mz of {moment:.3g} N m with forces of {force:.3g} N (root mean squares) act at a"
        f" lever of {moment / force if force else math.inf:.3g} m, expected at most {limit:.3g} m; {likely}"
    )


def _check_turns(samples: pd.DataFrame, where: str) -> None:
    """Checks the orientations: their tilt, their agreement with ``dangle``, and the turn of the hand."""
    angle = samples["angle"].to_numpy(dtype=float)
    R = Rotation.from_rotvec(samples[["ax", "ay", "az"]].to_numpy(dtype=float) * angle[:, None])
    tilt = np.arccos(np.clip(R.as_matrix()[:, 2, 2], -1.0, 1.0))
    if tilt.max() > MAX_TILT:
        row = int(tilt.argmax())
        raise ValueError(
            f"{where}: columns ax, ay, az, angle tilt the peg by {math.degrees(tilt[row]):.3g} deg in row {row},"
            f" expected at most {math.degrees(MAX_TILT):.0f} deg; 'angle' lies between {angle.min():.3g} and"
            f" {angle.max():.3g} rad: it looks like degrees"
        )
    turned = float(np.sum((R[:-1].inv() * R[1:]).magnitude()))
    stated = float(samples["dangle"].iloc[1:].sum())
    if max(turned, stated) > MIN_TURN and not turned <= TURN_RATIO * stated <= TURN_RATIO**2 * turned:
        likely = f"; '{'angle' if turned > stated else 'dangle'}' looks like degrees" if stated > 0 else ""
        raise ValueError(
            f"{where}: column 'dangle' sums up to {stated:.3g} rad, but the orientations turn by {turned:.3g} rad,"
            f" expected the same{likely}"
        )
    hand = float(np.linalg.norm(samples[["rx", "ry"]].iloc[1:].sum()))
    if hand > MAX_TILT:
        raise ValueError(
            f"{where}: columns rx, ry turn the hand by {math.degrees(hand):.4g} deg in all, expected at most"
            f" {math.degrees(MAX_TILT):.0f} deg; they look like degrees, expected radians"
        )


def contact_columns(samples: pd.DataFrame, *, forces: bool = True) -> list[str]:
    """Returns the names of the columns that hold forces of single contacts, or their points."""
    names = [str(name) for name in samples.columns if str(name).startswith("contact_")]
    return [name for name in names if name.endswith(("_fx", "_fy", "_fz")) is forces]


def _check_columns(samples: pd.DataFrame, limits: Mapping[str, Limits], where: str) -> None:
    for name, allowed in limits.items():
        _check_range(samples[name].to_numpy(dtype=float), f"column '{name}'", allowed, where)


def _check_range(values: Array, what: str, limits: Limits, where: str) -> None:
    """Checks values (n,) against their limits."""
    if len(values) == 0 or (values.min() >= limits.low and values.max() <= limits.high):
        return
    low, high, unit = float(values.min()), float(values.max()), f" {limits.unit}" if limits.unit else ""
    found = f"is {low:.6g}{unit}" if low == high else f"lies between {low:.6g} and {high:.6g}{unit}"
    expected = f"at most {limits.high:.4g}" if limits.low == -math.inf else f"{limits.low:.4g} to {limits.high:.4g}"
    reasons = [f" ({limits.why})" if limits.why else "", *_likely_unit(values, limits)]
    raise ValueError(f"{where}: {what} {found}, expected {expected}{unit}{'; '.join(reasons)}")


def _likely_unit(values: Array, limits: Limits) -> Iterator[str]:
    """Says in which unit the values (n,) would be usual, if there is one; single outliers do not count as a spread."""
    low, high = np.percentile(values, (10.0, 90.0)) if len(values) > 1 else (0.0, abs(values[0]))
    for name, size in UNITS.get(limits.unit, ()):
        allowed = limits.low <= size * values.min() and size * values.max() <= limits.high
        if allowed and size * (high - low) >= limits.usual:
            yield f"it looks like {name}"
            return


def _root_mean_square(samples: pd.DataFrame, names: Sequence[str]) -> float:
    """Root mean square of the norm of some columns."""
    return float(np.sqrt(np.mean(np.sum(samples[list(names)].to_numpy(dtype=float) ** 2, axis=1))))
