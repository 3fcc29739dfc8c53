"""Reduces the motion of the peg in a trial to path length and jerk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from skill.arrays import Array

WINDOW = 15  # samples of the velocity in each local fit
MIN_SPEED = 0.01  # in units of m/s; jerk counts only while the peg is faster


@dataclass(frozen=True)
class MotionFigures:
    """The motion of a trial, of the centre of the peg's tip in the frame H of the hole.

    Attributes:
        path_length: length of the way, m.
        mean_jerk: mean size of the jerk while the speed is above `MIN_SPEED`, m/s^3; see `mean_jerk`.
        start_distance: distance from the first position to the centre of the bottom of the hole, m.
    """

    path_length: float
    mean_jerk: float
    start_distance: float


def motion_figures(positions: ArrayLike, step: float, hole_depth: float) -> MotionFigures:
    """Returns the figures of positions of the tip in H (n, 3), m, that follow each other after ``step``, s."""
    tips = np.reshape(np.asarray(positions, dtype=float), (-1, 3))
    bottom = np.array([0.0, 0.0, -hole_depth])
    return MotionFigures(
        path_length=float(np.linalg.norm(np.diff(tips, axis=0), axis=1).sum()),
        mean_jerk=mean_jerk(tips, step),
        start_distance=float(np.linalg.norm(tips[0] - bottom)) if len(tips) else 0.0,
    )


def mean_jerk(positions: Array, step: float) -> float:
    """Returns the mean size of the jerk of a motion, m/s^3, as the public AI for Industry Challenge defines it.

    A Savitzky-Golay filter: a quadratic polynomial is fitted to `WINDOW` samples of the velocity, and its second
    derivative is the jerk in their middle. Only samples count whose fitted speed is above `MIN_SPEED`; the mean is 0
    if there are none. Velocities are differences of the positions; the ends of the motion, where the window is not
    full, do not count. The published rule leaves these two points open.

    Source: docs/scoring.md of https://github.com/intrinsic-dev/aic ("Trajectory smoothness").

    Args:
        positions: (n, 3), m.
        step: time between two positions, s.
    """
    velocities = np.diff(positions, axis=0) / step
    if len(velocities) < WINDOW:
        return 0.0
    offsets = step * (np.arange(WINDOW) - WINDOW // 2)
    fit = np.linalg.pinv(np.vander(offsets, 3, increasing=True))  # rows: value, slope, half the second derivative
    windows = sliding_window_view(velocities, WINDOW, axis=0)
    speeds = np.linalg.norm(windows @ fit[0], axis=1)
    jerks = np.linalg.norm(windows @ (2.0 * fit[2]), axis=1)
    moving = speeds > MIN_SPEED
    return float(jerks[moving].mean()) if moving.any() else 0.0
