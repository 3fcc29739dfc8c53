"""Checks that the numbers of a demonstration can be what they claim to be: units, ranges, sampling.

The limits are wide: they catch wrong units and nonsense, not unusual devices. They follow from the sizes of peg and
hole where the file states them, and otherwise from `DEFAULT_SIZE`.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from skill.arrays import Array
from skill.data.geometry import PegHoleGeometry

DEFAULT_SIZE = 0.5
"""Size of peg and hole in a file that does not state it, m."""

MAX_HEIGHT = 1.0
"""Largest distance of the tip from the mouth outside the hole, m; more for a peg that is long itself."""

MAX_TILT = math.radians(60.0)
"""Largest tilt of the peg relative to the hole, and largest turn of the hand about x and y, rad."""

MAX_FORCE = 1e5
"""Largest force, N; a simulation with a greater one counts as diverged."""

MAX_LEVER = 10.0
"""Largest ratio of moments to forces (root mean squares), in lengths of peg and hole. Wedged pegs reach 6."""

MIN_MOMENT = 1e-6
"""Moments below this say nothing about their unit, N m."""

MAX_HAND_SPEED, MAX_TURN_SPEED = 5.0, 20.0
"""Largest speed of the hand, m/s, and largest angular speed of hand or peg, rad/s."""

ACTION_SPEEDS = (
    *((name, MAX_HAND_SPEED, "m/s") for name in ("ux", "uy", "uz")),
    *((name, MAX_TURN_SPEED, "rad/s") for name in ("rx", "ry", "rz")),
)
"""Columns of the action of the hand, with its largest speed along each."""

MAX_PERIOD = 0.5
"""Largest sample period, s; at 2 Hz no contact can be followed."""

MAX_GAP, MAX_GAP_PERIODS = 1.0, 25.0
"""Largest gap between two samples: the larger of a time, s, and a number of sample periods."""

MAX_TIME = 86_400.0
"""Largest time since the start, s."""

MIN_SHARE = 0.5
"""Least depth, over that of the hole, at which a peg counts as inserted; no scenario allows less."""

TURN_RATIO, MIN_TURN = 8.0, 0.02
"""Largest ratio, either way, between the sum of ``dangle`` and the turns between the orientations, where one of them is
above the turn, rad."""

UNITS = {
    "m": "not millimetres",
    "m/s": "not millimetres per second",
    "rad": "not degrees",
    "rad/s": "not degrees per second",
    "s": "not milliseconds",
    "N": "not millinewtons",
}
"""What a number may be in by mistake, by the unit that is expected."""


def check_demonstration(samples: pd.DataFrame, geometry: PegHoleGeometry | None, where: str, *, inserted: bool) -> None:
    """Checks the samples of a demonstration (see `skill.data.demonstration` for the columns).

    Args:
        samples: the samples, with finite numbers.
        geometry: sizes of peg and hole, or None.
        where: name of the source, for error messages.
        inserted: whether the peg is said to have reached the bottom.

    Raises:
        ValueError: naming ``where``, the column, its range, the expected range and its unit.
    """
    column = {name: samples[name].to_numpy(dtype=float) for name in samples.columns}
    steps = np.diff(column["time"])
    period = float(np.median(steps))
    size = DEFAULT_SIZE if geometry is None else geometry.peg_length + geometry.hole_depth
    bottom = DEFAULT_SIZE if geometry is None else 1.1 * geometry.hole_depth + 0.1 * geometry.peg_radius
    reach = max(MAX_HEIGHT, 3.0 * size)
    bore = math.inf if geometry is None else geometry.hole_radius
    inside = column["z"] < (-math.inf if geometry is None else -geometry.chamfer)
    for what, values, low, high, unit in (
        ("the median step of column 'time'", np.array([period]), 0.0, MAX_PERIOD * (1.0 + 1e-9), "s"),
        ("column 'time' since the start", column["time"], -MAX_TIME, MAX_TIME, "s"),
        ("column 'angle'", column["angle"], 0.0, math.pi + 1e-9, "rad"),
        ("the depth in column 'z'", -column["z"], -reach, bottom, "m"),
        *((f"column '{name}'", column[name], -reach, reach, "m") for name in ("x", "y")),
        *((f"column '{name}' inside the bore", column[name][inside], -bore, bore, "m") for name in ("x", "y")),
        *((f"column '{name}'", column[name], -MAX_FORCE, MAX_FORCE, "N") for name in ("fx", "fy", "fz")),
        # The first row has no sample before it.
        *((f"column '{n}' over time", column[n][1:] / steps, -v, v, unit) for n, v, unit in ACTION_SPEEDS),
        ("column 'dangle' over time", column["dangle"][1:] / steps, 0.0, MAX_TURN_SPEED, "rad/s"),
    ):
        if values.size and not (low <= values.min() and values.max() <= high):
            found = f"lies between {values.min():.6g} and {values.max():.6g} {unit}"
            raise ValueError(f"{where}: {what} {found}, expected {low:.4g} to {high:.4g} {unit} ({UNITS[unit]})")
    longest, row = max(MAX_GAP, MAX_GAP_PERIODS * period), int(steps.argmax())
    if steps[row] > longest:
        raise ValueError(
            f"{where}: column 'time' has a gap of {steps[row]:.6g} s after row {row}, expected steps of about"
            f" {period:.3g} s and at most {longest:.3g} s; split the recording there"
        )
    _check_lever(samples, 0.1 if geometry is None else size, where)
    _check_turns(samples, where)
    if inserted and geometry is not None:
        _check_inserted(column["z"], geometry, where)


def _check_inserted(z: Array, geometry: PegHoleGeometry, where: str) -> None:
    """Checks that an inserted peg ends near the bottom; it may move for one more period after the last sample."""
    least = MIN_SHARE * geometry.hole_depth - 2.0 * float(np.abs(np.diff(z)).max())
    if -z[-1] < least:
        raise ValueError(
            f"{where}: the outcome is 'inserted', but column 'z' ends at {1e3 * z[-1]:.4g} mm, expected below"
            f" {-1e3 * least:.4g} mm in a hole of {1e3 * geometry.hole_depth:g} mm depth; z points out of the hole"
        )


def _check_lever(samples: pd.DataFrame, size: float, where: str) -> None:
    """Checks the lever at which the forces act, for peg and hole of a size (m)."""
    force, moment = (
        float(np.sqrt(np.mean(np.sum(samples[names].to_numpy(dtype=float) ** 2, axis=1))))
        for names in (["fx", "fy", "fz"], ["mx", "my", "mz"])
    )
    if moment > max(MAX_LEVER * size * force, MIN_MOMENT):
        raise ValueError(
            f"{where}: columns mx, my, mz of {moment:.3g} N m with forces of {force:.3g} N (root mean squares) act at a"
            f" lever of more than {MAX_LEVER * size:.3g} m; expected forces in N and moments in N m, not kN or N mm"
        )


def _check_turns(samples: pd.DataFrame, where: str) -> None:
    """Checks the orientations: their tilt, their agreement with ``dangle``, and the turn of the hand."""
    angle = samples["angle"].to_numpy(dtype=float)
    R = Rotation.from_rotvec(samples[["ax", "ay", "az"]].to_numpy(dtype=float) * angle[:, None])
    tilt = float(np.arccos(np.clip(R.as_matrix()[:, 2, 2], -1.0, 1.0)).max())
    hand = float(np.linalg.norm(samples[["rx", "ry"]].iloc[1:].sum()))
    for what, turn in (("columns ax, ay, az, angle tilt the peg", tilt), ("columns rx, ry turn the hand", hand)):
        if turn > MAX_TILT:
            raise ValueError(f"{where}: {what} by {turn:.4g} rad, expected at most {MAX_TILT:.3g} rad ({UNITS['rad']})")
    turned = float(np.sum((R[:-1].inv() * R[1:]).magnitude()))
    stated = float(samples["dangle"].iloc[1:].sum())
    if max(turned, stated) > MIN_TURN and not turned <= TURN_RATIO * stated <= TURN_RATIO**2 * turned:
        raise ValueError(
            f"{where}: column 'dangle' sums up to {stated:.3g} rad, but the orientations turn by {turned:.3g} rad,"
            f" expected the same ({UNITS['rad']})"
        )
