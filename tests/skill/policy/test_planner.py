"""The motion of a planner, against formulas worked by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize

from skill.policy.imitation import Imitation
from skill.policy.planner import BOUND_TOLERANCE, LOAD_TOLERANCE, Planner, best_motion
from skill.policy.prediction import Query
from skill.policy.transitions import HORIZON
from skill.regression.locally_weighted_regression import LWRegressor
from tests.skill.policy.made_up import FEATURES, PERIOD, RADIUS, fitted, made_up_rows

WIDE = np.full(5, -1e3), np.full(5, 1e3)
LARGEST = np.array([0.1, 0.1, 1e-2])
SPREAD = np.array([1e-2, 1e-2, 1e-3])


def responding(load, motion, by):
    """B with one entry."""
    B = np.zeros((5, 3))
    B[load, motion] = by
    return B


def planned(response, target, *, bounds=WIDE, usual=(0.0, 0.0, 0.0), spread=SPREAD):
    return best_motion(
        response, target=np.asarray(target, float), bounds=bounds, usual=np.array(usual), spread=spread, largest=LARGEST
    )


def test_loads_beyond_the_bounds_hold_a_motion_back():
    # Feeding by 1 mm is usual and adds 10 N; 2 N are allowed.
    response, usual = responding(4, 2, -1e4), np.array([0.0, 0.0, -1e-3])
    high = np.array([1e3, 1e3, 1e3, 1e3, 2.0])
    free = planned(response, np.zeros(5), usual=usual)
    held = planned(response, np.zeros(5), usual=usual, bounds=(WIDE[0], high))
    a, p, q = 1e4 / LOAD_TOLERANCE, 1.0 / SPREAD[2], 1e4 / BOUND_TOLERANCE
    assert free[2] == pytest.approx(-1e-3 * p**2 / (p**2 + a**2))
    assert -1e4 * free[2] < 2.0  # within the bound, which therefore changes nothing
    np.testing.assert_allclose(held, free, rtol=1e-9)
    usual = 100.0 * usual
    held = planned(response, np.zeros(5), usual=usual, bounds=(WIDE[0], high))
    assert held[2] == pytest.approx(-(0.1 * p**2 + 2e-4 * q**2) / (p**2 + a**2 + q**2))
    assert planned(response, np.zeros(5), usual=usual)[2] == pytest.approx(-0.1 * p**2 / (p**2 + a**2))


def test_no_motion_is_larger_than_the_demonstrated_ones():
    found = planned(responding(0, 1, -1.0), [-1e6, 0, 0, 0, 0])
    assert found[1] == pytest.approx(LARGEST[1])


@given(
    arrays(float, (5, 3), elements=st.floats(-1.0, 1.0)),
    arrays(float, 5, elements=st.floats(-5.0, 5.0)),
    arrays(float, 3, elements=st.floats(-1.0, 1.0)),
)
def test_no_other_motion_is_better(shape, target, direction):
    response = shape * np.array([300.0, 300.0, 3e3])
    low, high = np.full(5, -1.0), np.full(5, 1.0)
    usual = direction * SPREAD

    def cost(u):
        change = response @ u
        beyond = change - np.clip(change, low, high)
        terms = (change - target) / LOAD_TOLERANCE, (u - usual) / SPREAD, beyond / BOUND_TOLERANCE
        return sum(float(term @ term) for term in terms)

    found = planned(response, target, bounds=(low, high), usual=usual)
    unit = minimize(lambda v: cost(v * LARGEST), found / LARGEST, bounds=[(-1, 1)] * 3, method="L-BFGS-B")
    assert cost(found) <= unit.fun * (1 + 1e-6) + 1e-9


def plan_with(time, share):
    """The prediction under a force of 4 N, where demonstrations take this time for a share of what they change."""
    rows = made_up_rows()
    rows = replace(rows, times=np.full_like(rows.times, time), changes=share * rows.changes)
    regressor = LWRegressor(bandwidth=5.0, feature_scale=None)
    regressor.fit(
        FEATURES.transform(rows.measured),
        rows.inputs * PERIOD / HORIZON,
        memberships=np.ones((len(rows.times), 3)) / 3.0,
    )
    imitation = Imitation(regressor, np.zeros((len(rows.times), 2)), -math.inf)
    row = np.array([[4.0, 0.0, 5.0, 0.0, 0.0, 0.0, -0.002]])
    query = Query(row, FEATURES.transform(row), np.array([[1.0, 0.0, 0.0]]))
    return Planner(fitted(rows, bandwidth=5.0), imitation, FEATURES, RADIUS, PERIOD).predict(query)


def test_the_target_of_a_horizon_is_the_demonstrated_change_at_its_demonstrated_speed():
    whole, quarter = plan_with(HORIZON, 1.0), plan_with(HORIZON, 0.25)
    assert np.abs(whole.action - quarter.action).max() > 1e-4
    np.testing.assert_allclose(plan_with(4.0 * HORIZON, 1.0).action, quarter.action)
    np.testing.assert_allclose(plan_with(0.2 * HORIZON, 1.0).action, whole.action)  # no farther than the next state
