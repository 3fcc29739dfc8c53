"""The commanded tip of an arm, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from models.arm import ArmParameters
from systems.arm.tip import HEIGHT, RATE, SIZE, X, Y, tip_step

ARM = ArmParameters(yield_softness=2e-3, yield_threshold=0.5, yield_speed=0.01, yield_reach=2e-3)


def step(state, feed=0.0, push=(0.0, 0.0), **limits):
    """The tip after a millisecond."""
    return tip_step(replace(ARM, **limits), 1e-3, state, feed, np.array(push))


def test_the_feed_changes_with_the_acceleration_and_keeps_its_top_speed():
    state, rates = np.zeros(SIZE), []
    state[HEIGHT] = 1e-3
    for _ in range(4):
        state = step(state, -1.0, max_acceleration=5.0, max_speed=0.012)
        rates.append(state[RATE])
    np.testing.assert_allclose(rates, [-0.005, -0.01, -0.012, -0.012])
    assert state[HEIGHT] == pytest.approx(1e-3 - 1e-3 * 0.039)


@pytest.mark.parametrize(
    ("height", "feed", "rate"),
    [(1e-3, -0.02, -0.02), (-5e-4, -0.02, -1e-3), (-1.5e-3, -0.02, -0.02), (-5e-4, 0.02, 0.02)],
)
def test_the_feed_is_slow_where_the_tip_yields_in_the_hole_unless_it_leaves(height, feed, rate):
    state = np.zeros(SIZE)
    state[HEIGHT] = height
    assert step(state, feed, max_acceleration=1e3, yield_feed=1e-3, yield_depth=1e-3)[RATE] == rate


@pytest.mark.parametrize(
    ("push", "moved"),
    [
        ((1.5, 2.0), (2.4e-6, 3.2e-6)),  # 2.5 N along (0.6, 0.8): 2 N above the threshold, 4 mm/s
        ((0.3, 0.4), (0.0, 0.0)),  # the threshold
        ((0.0, -50.0), (0.0, -1e-5)),  # the largest speed
    ],
)
def test_the_mouth_is_where_a_force_pushes_to(push, moved):
    np.testing.assert_allclose(step(np.zeros(SIZE), push=push)[[X, Y]], moved)


def test_the_tip_does_not_yield_deep_in_the_hole_nor_beyond_its_reach():
    state = np.zeros(SIZE)
    state[HEIGHT] = -ARM.yield_depth
    assert step(state, push=(20.0, 0.0))[X] == 0.0
    state[HEIGHT], state[X] = 0.0, ARM.yield_reach
    np.testing.assert_allclose(step(state, push=(20.0, 0.0))[[X, Y]], [ARM.yield_reach, 0.0])
