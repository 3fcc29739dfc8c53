"""The commanded tip of an arm, by hand."""

import numpy as np
import pytest

from models.arm import ArmParameters
from systems.arm.tip import HEIGHT, RATE, SIZE, TipLimits, X, Y, tip_step


@pytest.fixture
def limits():
    return TipLimits.of(ArmParameters(), 1e-3)._replace(softness=2e-3, threshold=0.5, yield_speed=0.01, reach=2e-3)


def test_the_feed_changes_with_the_acceleration_and_keeps_its_top_speed(limits):
    p = limits._replace(acceleration=5.0, speed=0.012)
    state, rates = np.zeros(SIZE), []
    state[HEIGHT] = 1e-3
    for _ in range(4):
        state = tip_step(p, state, -1.0, np.zeros(2))
        rates.append(state[RATE])
    np.testing.assert_allclose(rates, [-0.005, -0.01, -0.012, -0.012])
    assert state[HEIGHT] == pytest.approx(1e-3 - 1e-3 * 0.039)


def test_the_feed_is_slow_where_the_tip_yields_in_the_hole(limits):
    p, state = limits._replace(acceleration=1e3, yield_feed=1e-3), np.zeros(SIZE)
    rates = {}
    for height in (1e-3, -0.5 * p.depth, -1.5 * p.depth):
        state[HEIGHT] = height
        rates[height] = tip_step(p, state, -0.02, np.zeros(2))[RATE]
    assert list(rates.values()) == [-0.02, -1e-3, -0.02]
    assert tip_step(p, state, 0.02, np.zeros(2))[RATE] == 0.02  # out of the hole at any speed


def test_the_mouth_is_where_a_force_pushes_to(limits):
    """2.5 N along (0.6, 0.8): 2 N above the threshold, 4 mm/s."""
    found = tip_step(limits, np.zeros(SIZE), 0.0, np.array([1.5, 2.0]))
    np.testing.assert_allclose(found[[X, Y]], [2.4e-6, 3.2e-6])
    assert tip_step(limits, np.zeros(SIZE), 0.0, np.array([0.3, 0.4])).any() == 0  # the threshold
    np.testing.assert_allclose(tip_step(limits, np.zeros(SIZE), 0.0, np.array([0.0, -50.0]))[[X, Y]], [0.0, -1e-5])


def test_the_tip_does_not_yield_deep_in_the_hole_nor_beyond_its_reach(limits):
    state = np.zeros(SIZE)
    state[HEIGHT] = -limits.depth
    assert tip_step(limits, state, 0.0, np.array([20.0, 0.0]))[X] == 0.0
    state[HEIGHT], state[X], state[Y] = 0.0, limits.reach, 0.0
    np.testing.assert_allclose(tip_step(limits, state, 0.0, np.array([20.0, 0.0]))[[X, Y]], [limits.reach, 0.0])
