"""Refinement of a demonstration: the operator's idle and rough actions taken out.

The paper refines the action vectors u in two steps:

1. Remove actions that do nothing: ||u|| <= delta_s.
2. Remove rough control: where ||u_{t+1} - u_t|| > delta_d, "their average value is used".

The paper leaves open what becomes of removed motion and which of the two takes the average. Here the motion
of a removed sample is added to the next one that stays (to the last, at the end). The average replaces both
by default, which preserves the total motion; the other reading, later only, loses some.

Both readings end. Both: with d = u_{t+1} - u_t, averaging lowers the sum of ||u||^2 by ||d||^2 / 2 >
delta_d^2 / 2, and the sum cannot fall below zero. Later only: the first action never changes, and once
those before action t have settled, each averaging halves its distance from its predecessor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from skill.arrays import Array
from skill.data.demonstration import ACTIONS

ROUNDING = 1e-12


@dataclass(frozen=True)
class RefinementReport:
    """What refinement did.

    Attributes:
        samples_before: number of samples given.
        samples_after: number that stayed.
        merged: (samples_after,), how many of the given samples each action now stands for.
        averagings: how many times an average was taken.
        motion_change: (6,), total action after minus before, m and rad: zero but for rounding with "both".
    """

    samples_before: int
    samples_after: int
    merged: NDArray[np.intp]
    averagings: int
    motion_change: Array

    def __str__(self) -> str:
        dropped = self.samples_before - self.samples_after
        moved = 1e3 * np.linalg.norm(self.motion_change[:3])
        turned = np.rad2deg(np.linalg.norm(self.motion_change[3:]))
        return (
            f"{self.samples_before} samples, {dropped} idle ones dropped, {self.averagings} averagings,"
            f" total motion changed by {moved:.3g} mm and {turned:.3g} deg"
        )


def refine_demonstration(
    samples: pd.DataFrame,
    *,
    still: float,
    rough: float,
    average: str = "both",
    rotation_scale: float = 0.01,
) -> tuple[pd.DataFrame, RefinementReport]:
    """Drops idle samples and evens out rough actions.

    Args:
        samples: one row a sample, with the action columns ux uy uz (m), rx ry rz (rad). Other columns of the
            samples that stay are kept, but ``dangle``, which is taken from the sample now before.
        still: delta_s, m; actions of at most this norm are dropped. Zero drops only those without motion.
        rough: delta_d, m, positive; the greatest difference of consecutive actions that is left alone.
            Infinity skips the second step.
        average: "both" or "later": which of two differing actions takes their average.
        rotation_scale: m; the norm of an action is sqrt(|u|^2 + (rotation_scale |r|)^2). The radius of the
            peg is natural: it makes a rotation count by how far it moves the peg's surface.

    Returns:
        The refined samples, with a fresh index, and a report.

    Raises:
        ValueError: if columns are missing or not finite, a threshold is out of range, or fewer than two
            samples would stay.
    """
    _check_arguments(samples, still, rough, average, rotation_scale)
    actions = samples[list(ACTIONS)].to_numpy(dtype=float)
    weights = np.array([1.0, 1.0, 1.0] + [rotation_scale] * 3)
    kept = np.flatnonzero(np.linalg.norm(actions * weights, axis=1) > still)
    if len(kept) < 2:
        raise ValueError(
            f"{len(kept)} of {len(actions)} actions exceed still = {still:g} m, expected at least 2;"
            " lower `still` below the operator's usual motion in one sample"
        )
    heirs = np.minimum(np.searchsorted(kept, np.arange(len(actions))), len(kept) - 1)
    summed = np.zeros((len(kept), len(ACTIONS)))
    np.add.at(summed, heirs, actions)
    even, averagings = even_out(summed * weights, rough, average)
    even /= weights
    refined = samples.iloc[kept].reset_index(drop=True)
    refined[list(ACTIONS)] = even
    _update_rotation_steps(refined, kept)
    report = RefinementReport(
        samples_before=len(actions),
        samples_after=len(kept),
        merged=np.bincount(heirs, minlength=len(kept)),
        averagings=averagings,
        motion_change=even.sum(axis=0) - actions.sum(axis=0),
    )
    return refined, report


def even_out(actions: Array, rough: float, average: str = "both") -> tuple[Array, int]:
    """Averages consecutive actions that differ by more than ``rough`` until none do.

    All pairs that start at an even sample are treated at once, then all that start at an odd one, and so
    on: pairs of a kind do not overlap, and neither direction of time is favoured.

    Args:
        actions: (n, p).
        rough: in the actions' units, positive.
        average: "both" or "later".

    Returns:
        The evened actions (n, p) and the number of averagings.
    """
    even = np.array(actions, dtype=float)
    # Differences that are no more than accumulated rounding are none.
    rough = max(rough, ROUNDING * float(np.abs(even).max(initial=0.0)))
    averagings = idle = parity = 0
    while idle < 2:
        first = np.arange(parity, len(even) - 1, 2)
        parity = 1 - parity
        first = first[np.linalg.norm(even[first + 1] - even[first], axis=1) > rough]
        idle = 0 if len(first) else idle + 1
        averagings += len(first)
        mean = 0.5 * (even[first] + even[first + 1])
        even[first + 1] = mean
        if average == "both":
            even[first] = mean
    return even, averagings


def _update_rotation_steps(refined: pd.DataFrame, kept: NDArray[np.intp]) -> None:
    """Takes ``dangle`` from the sample now before, where the one that was before is gone."""
    if not {"ax", "ay", "az", "angle", "dangle"} <= set(refined.columns):
        return
    R = Rotation.from_rotvec(refined[["ax", "ay", "az"]].to_numpy(dtype=float) * refined[["angle"]].to_numpy())
    steps = refined["dangle"].to_numpy(dtype=float, copy=True)
    gap = np.diff(kept) > 1
    steps[1:][gap] = np.atleast_1d((R[:-1].inv() * R[1:]).magnitude())[gap]
    if kept[0] > 0:
        steps[0] = 0.0
    refined["dangle"] = steps


def _check_arguments(samples: pd.DataFrame, still: float, rough: float, average: str, rotation_scale: float) -> None:
    missing = [name for name in ACTIONS if name not in samples.columns]
    if missing:
        raise ValueError(f"samples lack the action columns {missing}; expected {list(ACTIONS)}")
    if not np.isfinite(samples[list(ACTIONS)].to_numpy(dtype=float)).all():
        raise ValueError("actions are not all finite; drop or repair the samples with NaN or infinity")
    if not (np.isfinite(still) and still >= 0):
        raise ValueError(f"still = {still}; expected a finite number of metres, zero or more")
    if not rough > 0:
        raise ValueError(f"rough = {rough}; expected a positive length in metres, or infinity to skip")
    if average not in ("both", "later"):
        raise ValueError(f"average = {average!r}; expected 'both' or 'later'")
    if not (np.isfinite(rotation_scale) and rotation_scale > 0):
        raise ValueError(f"rotation_scale = {rotation_scale}; expected a positive length, such as the peg's radius")
