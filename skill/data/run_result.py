"""Checks that the result of a rig run says what its samples show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from skill.data.axes import AXES
from skill.data.outcome import UNPHYSICAL, Outcome, parse_outcome
from skill.data.plausibility import contact_columns

ROUNDING = {"time_s": 1e-3, "depth_mm": 1e-2, "unknown_s": 1e-2, "unsupported_s": 1e-2, "peak_contact_n": 0.1}
"""Last digit of the rounded numbers of a result; the others are exact."""

MIN_SPEED = 0.05
"""Speed at which the tip may move after the last sample, m/s; more where the samples move faster."""

NUMBERS = (
    *("seed", "time_s", "depth_mm", "peak_axial_n", "peak_lateral_n", "peak_moment_nm", "penetration_um"),
    *("peak_contact_n", "peak_load_n", "mean_load_n", "seconds_above_20n", "first_touch_ns", "peak_measured_load_n"),
    *("force_above_20n_s", "wedged_s", "path_mm", "jerk_ms3", "field_score"),
    *("steps", "lost_steps", "back_offs", "unknown_s", "unsupported_s"),
)
"""Entries of a result that are numbers; NaN where a simulation broke down."""


def outcome_of(result: Mapping[str, Any], where: str) -> Outcome:
    """Returns how a run ended.

    Args:
        result: the result as stored.
        where: name of the source, for error messages.

    Raises:
        ValueError: if ``reason`` is not a text, or ``inserted`` contradicts it.
    """
    reason, inserted = result.get("reason"), result.get("inserted")
    if not isinstance(reason, str):
        raise ValueError(f"{where}: 'reason' of the result is {shortened(reason)}, expected a text")
    outcome, _ = parse_outcome(reason)
    if not isinstance(inserted, bool):
        raise ValueError(f"{where}: 'inserted' of the result is {shortened(inserted)}, expected true or false")
    if inserted is not (outcome is Outcome.INSERTED):
        raise ValueError(f"{where}: 'inserted' of the result is {inserted}, but the reason is {shortened(reason)}")
    return outcome


def check_result(result: Mapping[str, Any], samples: pd.DataFrame, where: str) -> None:
    """Checks a result against the samples of its run, within rounding and one sample period.

    Args:
        result: the result as stored; entries that are missing are not checked.
        samples: the samples of the run.
        where: name of the source, for error messages.

    Raises:
        ValueError: naming ``where``, the entry, its value, and what the samples show.
    """
    outcome = outcome_of(result, where)
    for name in NUMBERS:
        value = result.get(name, 0)
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise ValueError(f"{where}: '{name}' of the result is {shortened(value)}, expected a number")
        if not math.isfinite(value) and outcome not in UNPHYSICAL:
            raise ValueError(f"{where}: '{name}' of the result is {value}, expected a finite number")
    for name, (low, high) in _shown(samples, result).items():
        margin = 0.51 * ROUNDING.get(name, 0.0)
        value = result.get(name, low)
        if math.isfinite(value) and not low - margin <= value <= high + margin:
            shown = f"{low:g}" if low == high else f"{low:.6g} to {high:.6g}"
            raise ValueError(f"{where}: '{name}' of the result is {value:g}, but the samples show {shown}")
    states = samples["state"].to_numpy(dtype=int)
    visited = states[np.flatnonzero(np.diff(states, prepend=-1))].tolist()
    if result.get("states", visited) != visited:
        raise ValueError(
            f"{where}: 'states' of the result is {shortened(result['states'])},"
            f" but the samples show {shortened(visited)}"
        )


def _shown(samples: pd.DataFrame, result: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Range of each number of a result that its samples allow.

    A run ends at most one period after its last sample. The period of a single sample is not known.
    """
    last, times = samples.iloc[-1], samples["time"].to_numpy(dtype=float)
    steps, height = np.diff(times), samples["tip_z"].to_numpy(dtype=float)
    period = float(np.median(steps)) if len(steps) else math.inf
    rest = result.get("time_s", times[-1] + period) - times[-1]  # from the last sample to the end
    speed = max(MIN_SPEED, 2.0 * float(np.max(np.abs(np.diff(height)) / steps, initial=0.0)))
    way = speed * max(0.0, rest) * 1e3 + 0.05
    exact = {
        "steps": sum(last[f"{axis}_taken"] for axis in AXES),
        "lost_steps": sum(last[f"{axis}_lost"] for axis in AXES),
        "back_offs": (samples["back_off"].diff() > 0).sum(),
    }
    if len(steps):
        exact["unknown_s"] = period * (samples["known"] == 0).sum()
        exact["unsupported_s"] = period * (samples["support"] < 1.0).sum()
    contacts = samples[contact_columns(samples)].to_numpy(dtype=float).reshape(len(samples), -1, 3)
    return {
        # The contacts are also read between the samples.
        "peak_contact_n": (float(np.linalg.norm(contacts, axis=2).max()), math.inf),
        "time_s": (float(times[-1]), float(times[-1] + period)),
        "depth_mm": (-1e3 * float(height[-1]) - way, -1e3 * float(height[-1]) + way),
        **{name: (float(value), float(value)) for name, value in exact.items()},
    }


def shortened(value: object) -> str:
    """Returns the text of a value, at most 60 characters of it."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}..."
