"""The challenge's score, against sums worked by hand."""

from dataclasses import replace

import pytest

from experiments.trial.field_score import field_score
from experiments.trial.motion_metrics import MotionFigures

SMOOTH = MotionFigures(path_length=0.028, mean_jerk=0.0, start_distance=0.028)


def score(inserted=True, time=2.0, depth=0.0247, motion=SMOOTH, force_time=0.0):
    return field_score(
        inserted=inserted, time=time, depth=depth, hole_depth=0.025, motion=motion, force_time=force_time
    )


def test_a_perfect_insertion_has_a_hundred_points():
    assert score().total == 100.0


@pytest.mark.parametrize(
    ("time", "points"), [(0.0, 12.0), (5.0, 12.0), (16.0, 9.6), (32.5, 6.0), (60.0, 0.0), (90.0, 0.0)]
)
def test_the_points_for_the_duration(time, points):
    assert score(time=time).duration == pytest.approx(points)


@pytest.mark.parametrize(("jerk", "points"), [(0.0, 6.0), (5.0, 5.4), (25.0, 3.0), (50.0, 0.0), (900.0, 0.0)])
def test_the_points_for_smoothness(jerk, points):
    assert score(motion=replace(SMOOTH, mean_jerk=jerk)).smoothness == pytest.approx(points)


@pytest.mark.parametrize(
    ("path", "points"), [(0.010, 6.0), (0.028, 6.0), (0.128, 5.4), (0.528, 3.0), (1.028, 0.0), (3.0, 0.0)]
)
def test_the_points_for_the_path(path, points):
    assert score(motion=replace(SMOOTH, path_length=path)).efficiency == pytest.approx(points)


@pytest.mark.parametrize(("seconds", "points"), [(0.0, 0.0), (1.0, 0.0), (1.002, -12.0), (9.0, -12.0)])
def test_a_force_above_20_n_costs_points_after_a_second(seconds, points):
    assert score(force_time=seconds).force == points
    assert score(inserted=False, depth=-1e-3, force_time=seconds).total == 1.0 + points


@pytest.mark.parametrize(("depth", "points"), [(-2e-3, 0.0), (0.0, 0.0), (0.005, 40.4), (0.0125, 44.0), (0.026, 50.0)])
def test_a_peg_that_stays_in_the_hole_has_points_for_its_depth(depth, points):
    assert score(inserted=False, depth=depth).insertion == pytest.approx(points)


def test_a_failure_outside_the_hole_has_no_points_for_speed_and_smoothness():
    assert score(inserted=False, depth=-1e-3).total == 1.0


def test_a_failure_in_the_hole_keeps_the_points_for_its_motion():
    """1 + 44 + 12 x 50/55 + 6 x 0.8 + 6 x 0.9"""
    motion = replace(SMOOTH, path_length=0.128, mean_jerk=10.0)
    found = score(inserted=False, time=10.0, depth=0.0125, motion=motion)
    assert found.total == pytest.approx(1 + 44 + 12 * 50 / 55 + 4.8 + 5.4)
