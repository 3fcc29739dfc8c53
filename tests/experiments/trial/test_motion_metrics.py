"""Path length and jerk, against curves whose derivatives are known and against SciPy's filter."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from experiments.trial.motion_metrics import MIN_SPEED, WINDOW, mean_jerk, motion_figures

STEP = 2e-3


def figures_of(tips, hole_depth=0.025):
    return motion_figures(tips, STEP, hole_depth)


def test_the_path_is_the_length_of_the_way_to_and_fro():
    """3 and 4 mm across, 2 mm down, 2 mm up: 5 + 2 + 2 mm."""
    found = figures_of([[0, 0, 0], [3e-3, 4e-3, 0], [3e-3, 4e-3, -2e-3], [3e-3, 4e-3, 0]])
    assert found.path_length == pytest.approx(9e-3)


def test_the_distance_at_the_start_is_to_the_bottom():
    assert figures_of([[4e-3, 0, 5e-3], [0, 0, 0]]).start_distance == pytest.approx(np.hypot(4e-3, 30e-3))


def test_a_trial_without_a_step_has_zeros():
    assert set(vars(figures_of([])).values()) == {0.0}
    assert figures_of([[0, 0, 1e-3]]).path_length == 0.0


def test_a_steady_motion_and_a_slow_one_have_no_jerk():
    t = STEP * np.arange(200)
    assert mean_jerk(np.outer(0.02 * t, [0, 0, -1.0]), STEP) == pytest.approx(0.0, abs=1e-6)
    shaking = 1e-6 * np.sin(2 * np.pi * 20.0 * t)  # at most 0.13 mm/s
    assert mean_jerk(np.outer(shaking, [0, 0, -1.0]), STEP) == 0.0


def test_a_motion_shorter_than_the_window_has_no_jerk():
    tips = np.random.default_rng(0).normal(size=(WINDOW, 3))  # one velocity too few
    assert mean_jerk(tips, STEP) == 0.0
    assert mean_jerk(np.zeros((0, 3)), STEP) == 0.0


def test_the_filter_is_that_of_savitzky_and_golay():
    rng = np.random.default_rng(3)
    tips = np.cumsum(np.cumsum(rng.normal(0.0, 2e-6, (400, 3)), axis=0), axis=0)
    velocities = np.diff(tips, axis=0) / STEP
    half = WINDOW // 2
    jerks = savgol_filter(velocities, WINDOW, 2, deriv=2, delta=STEP, axis=0)[half:-half]
    speeds = np.linalg.norm(savgol_filter(velocities, WINDOW, 2, axis=0)[half:-half], axis=1)
    moving = speeds > MIN_SPEED
    assert 0.1 < moving.mean() < 1.0
    assert mean_jerk(tips, STEP) == pytest.approx(np.linalg.norm(jerks, axis=1)[moving].mean())
