"""Refinement of a demonstration: removes idle samples, smooths rough actions, and finds what the actions intend.

The paper refines the action vectors u in two steps:

1. Remove actions without effect: ||u|| <= delta_s.
2. Smooth rough control: where ||u_{t+1} - u_t|| > delta_d, "their average value is used".

The paper does not say what happens to the removed motion, nor which of the two actions is replaced. Here the removed
motion is added to the next sample that is kept (at the end, to the last one), and the average replaces both actions:
the total motion is preserved. Smoothing ends: with d = u_{t+1} - u_t, each averaging lowers the sum of ||u||^2 by
||d||^2 / 2 > delta_d^2 / 2, and the sum cannot be negative.

A person acts late and in strokes, so that one action says little about the moment in which it happens.
`intended_actions` therefore looks ahead: a good demonstration ends aligned, and the rotation that remains until then is
what the person has to do, whenever the strokes come.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from skill.arrays import Array
from skill.data.demonstration import ACTIONS

INTENDED = ("intended_x", "intended_y", "intended_feed", "intended_spin")
"""The columns of `intended_actions`: turn about x and y of P (rad), feed along z (m) and turn about z (rad), over one
sample period."""

ROUNDING = 1e-12
"""Relative rounding error of the averages; smaller differences of actions count as zero."""


ROTATION_SCALE = 0.01
"""m; the norm of an action is sqrt(|u|^2 + (ROTATION_SCALE |r|)^2). As this is about the radius of the peg, a rotation
counts as the distance by which it moves the surface of the peg."""


def refine_demonstration(samples: pd.DataFrame, *, still: float, rough: float) -> pd.DataFrame:
    """Removes idle samples and smooths rough actions.

    Args:
        samples: one row a sample, with the action columns ux uy uz (m), rx ry rz (rad). The other columns are
            copied, except ``dangle``, which is computed anew where the previous sample was removed.
        still: delta_s, m; actions with at most this norm are removed. Zero removes only those without motion.
        rough: delta_d, m, positive; maximum difference of consecutive actions that is not smoothed.
            Infinity skips the second step.

    Returns:
        The refined samples, indexed from 0.

    Raises:
        ValueError: if an argument is out of range, or fewer than two samples would be left.
    """
    _check_arguments(still, rough)
    actions = samples[list(ACTIONS)].to_numpy(dtype=float)
    weights = np.array([1.0, 1.0, 1.0] + [ROTATION_SCALE] * 3)
    kept = np.flatnonzero(np.linalg.norm(actions * weights, axis=1) > still)
    if len(kept) < 2:
        raise ValueError(
            f"{len(kept)} of {len(actions)} actions exceed still = {still:g} m, expected at least 2;"
            " lower `still` below the usual motion in one sample"
        )
    receivers = np.minimum(np.searchsorted(kept, np.arange(len(actions))), len(kept) - 1)
    summed = np.zeros((len(kept), len(ACTIONS)))
    np.add.at(summed, receivers, actions)
    refined = samples.iloc[kept].reset_index(drop=True)
    refined[list(ACTIONS)] = smooth_actions(summed * weights, rough) / weights
    _update_rotation_steps(refined, kept)
    return refined


def with_following_actions(samples: pd.DataFrame) -> pd.DataFrame:
    """Returns a copy of recorded samples in which each row holds the action that follows it.

    A recorded row holds the motion since the previous sample. Nothing follows the last row: its action is zero.
    """
    shifted = samples.copy()
    shifted[list(ACTIONS)] = shifted[list(ACTIONS)].shift(-1, fill_value=0.0)
    return shifted


def intended_actions(samples: pd.DataFrame, *, correction_time: float, feed_time: float) -> pd.DataFrame:
    """Returns the actions that a successful demonstration intends at each sample.

    Let R_t be the orientation of the peg at sample t, R_end that at the end, T the sample period, and tau_c and tau_f
    the two times. The intended turn removes the remaining rotation with the time constant tau_c, and the intended feed
    is the mean over the time tau_f that follows:

        T / max(tau_c, T) log(R_t' R_end),        T / tau_f (sum of the feeds from t to t + tau_f).

    Args:
        samples: two rows or more, one a sample, with ``time`` (s), the orientation (``ax ay az``, ``angle``) and
            ``uz``, the feed that follows each sample (m).
        correction_time: tau_c, s, positive.
        feed_time: tau_f, s, positive; at least one sample is used, and none after the end.

    Returns:
        DataFrame (n, 4) with the columns ``INTENDED``.

    Raises:
        ValueError: if a time is not positive.
    """
    for name, value in (("correction_time", correction_time), ("feed_time", feed_time)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value}; expected a positive time in s")
    period = float(np.median(np.diff(samples["time"])))
    R = Rotation.from_rotvec(samples[["ax", "ay", "az"]].to_numpy(dtype=float) * samples[["angle"]].to_numpy())
    turns = (R.inv() * R[-1]).as_rotvec() * min(1.0, period / correction_time)
    first = np.arange(len(samples))
    last = np.minimum(first + max(1, round(feed_time / period)), len(samples))
    motion = np.concatenate([[0.0], np.cumsum(samples["uz"].to_numpy(dtype=float))])
    feeds = (motion[last] - motion[first]) / (last - first)
    return pd.DataFrame(
        np.column_stack([turns[:, :2], feeds, turns[:, 2]]), columns=list(INTENDED), index=samples.index
    )


def smooth_actions(actions: Array, rough: float) -> Array:
    """Averages consecutive actions that differ by more than ``rough``, until no pair does.

    Treats all pairs that start at an even sample at once, then all that start at an odd one, and so on. The pairs of
    one pass do not overlap, and neither direction of time is preferred.

    Args:
        actions: (n, p).
        rough: maximum norm of the difference, positive, in the unit of the actions.

    Returns:
        The smoothed actions (n, p).
    """
    smoothed = np.array(actions, dtype=float)
    # Differences of the size of accumulated rounding errors do not count.
    rough = max(rough, ROUNDING * float(np.abs(smoothed).max(initial=0.0)))
    idle = parity = 0
    while idle < 2:
        first = np.arange(parity, len(smoothed) - 1, 2)
        parity = 1 - parity
        first = first[np.linalg.norm(smoothed[first + 1] - smoothed[first], axis=1) > rough]
        idle = 0 if len(first) else idle + 1
        smoothed[first] = smoothed[first + 1] = 0.5 * (smoothed[first] + smoothed[first + 1])
    return smoothed


def _update_rotation_steps(refined: pd.DataFrame, kept: NDArray[np.intp]) -> None:
    """Computes ``dangle`` from the new previous sample, where the old one was removed."""
    R = Rotation.from_rotvec(refined[["ax", "ay", "az"]].to_numpy(dtype=float) * refined[["angle"]].to_numpy())
    steps = refined["dangle"].to_numpy(dtype=float, copy=True)
    gap = np.diff(kept) > 1
    steps[1:][gap] = np.atleast_1d((R[:-1].inv() * R[1:]).magnitude())[gap]
    if kept[0] > 0:
        steps[0] = 0.0
    refined["dangle"] = steps


def _check_arguments(still: float, rough: float) -> None:
    if not (np.isfinite(still) and still >= 0):
        raise ValueError(f"still = {still}; expected a finite length in metres, zero or more")
    if not rough > 0:
        raise ValueError(f"rough = {rough}; expected a positive length in metres, or infinity to skip")
