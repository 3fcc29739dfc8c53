"""The model of a planner, on a law that is known."""

from dataclasses import replace

import numpy as np
import pytest

from skill.policy.planning_model import BOUNDS, MAX_LOAD, PRIOR_SAMPLES, PlanningModel
from tests.skill.policy.made_up import FEATURES, PERIOD, N, fitted, made_up_rows


@pytest.fixture(scope="module")
def model():
    return fitted(made_up_rows(), bandwidth=5.0)


def weights(model, force=4.0, state=0):
    measured = np.array([[force, 0.0, 5.0, 0.0, 0.0, 0.0, -0.002]])
    return model.log_weights(FEATURES.transform(measured)[0], np.eye(3)[state])


def test_the_coefficients_are_those_of_a_weighted_ridge_regression(model):
    w = np.exp(weights(model))
    A = np.column_stack([np.ones(len(w)), model.inputs])
    M = A.T @ (w[:, None] * A) + PRIOR_SAMPLES * np.eye(4)
    B = np.linalg.inv(M) @ A.T @ (w[:, None] * model.outputs)
    drift, response = model.forward(weights(model))
    np.testing.assert_allclose(drift, model.output_mean + model.output_spread * B[0], atol=1e-9)
    np.testing.assert_allclose(response, np.outer(model.output_spread, 1 / model.input_spread) * B[1:].T, atol=1e-7)


def test_weights_are_a_gaussian_of_the_distance_times_the_shared_probability():
    rows = made_up_rows()
    model = fitted(rows, bandwidth=0.7)
    X = FEATURES.transform(rows.measured)
    spread = np.where(np.ptp(X, axis=0) > 1e-9, X.std(axis=0), 1.0)
    P = np.array([0.3, 0.6, 0.1])
    distance = ((X - X[4]) / spread) ** 2
    expected = np.exp(-distance.sum(axis=1) / (2 * 0.7**2)) * (model.memberships @ P)
    np.testing.assert_allclose(np.exp(model.log_weights(X[4], P)), expected, rtol=1e-6, atol=1e-12)


def test_the_desired_state_is_the_follower_of_greatest_worth(model):
    found = model.desired(weights(model))
    assert found.state == 1  # five of six lead there, and to the other leads the one that fails
    assert found.share == 1.0
    assert 0.0 < found.time <= N // 2 * PERIOD
    assert found.change[0] == pytest.approx(1.5 - 4.0, abs=0.6)
    assert model.desired(weights(model, force=1.5, state=1)).state == 3  # the insertion itself


def test_a_state_without_value_is_not_desired():
    rows = made_up_rows()
    rich = fitted(rows, values=(0.5, 0.01, 0.9), bandwidth=5.0)
    assert rich.desired(weights(rich)).state == 2
    hopeless = fitted(rows, values=(0.0, 0.0, 0.0), bandwidth=5.0)
    assert hopeless.desired(weights(hopeless)).state == 1  # what most did


def test_the_bounds_are_those_that_good_demonstrations_keep(model):
    rows = made_up_rows()
    force = rows.loads[rows.good, 0]
    for state, shown in ((0, force[force >= 2.0]), (1, force[force < 2.0])):
        low, high = model.bounds(np.eye(3)[state])
        assert (low[0], high[0]) == pytest.approx(np.quantile(shown, BOUNDS, method="inverted_cdf"))
        np.testing.assert_allclose((low[4], high[4]), 5.0)
    low, high = model.bounds(np.eye(3)[2])  # no good demonstration visits it
    assert (low[0], high[0]) == pytest.approx(np.quantile(force, BOUNDS, method="inverted_cdf"))


def test_jams_are_left_out():
    rows = made_up_rows()
    jammed = rows.outputs.copy()
    jammed[0] = 2.0 * MAX_LOAD
    assert len(fitted(replace(rows, outputs=jammed)).times) == len(rows.times) - 1
    pressed = rows.loads.copy()
    pressed[[1, 2, 3], [0, 1, 4]] = 2.0 * MAX_LOAD, -2.0 * MAX_LOAD, 1.01 * MAX_LOAD  # a held jam does not change
    assert len(fitted(replace(rows, loads=pressed)).times) == len(rows.times) - 3
    of_moments = rows.loads.copy()
    of_moments[:, 2:4] = 10.0 * MAX_LOAD  # a long lever, no jam
    assert len(fitted(replace(rows, loads=of_moments)).times) == len(rows.times)
    with pytest.raises(ValueError, match="no sample of a good demonstration with a load below 40 N"):
        fitted(replace(rows, good=np.zeros(len(rows.times), dtype=bool)))


def test_a_restored_model_is_the_same(model):
    again = PlanningModel.from_arrays(model.to_arrays())
    for force in (1.0, 3.0, 5.0):
        one, other = weights(model, force), weights(again, force)
        np.testing.assert_array_equal(one, other)
        for a, b in zip(model.forward(one), again.forward(other), strict=True):
            np.testing.assert_array_equal(a, b)
        np.testing.assert_array_equal(model.desired(one).change, again.desired(other).change)
    np.testing.assert_array_equal(model.bounds(np.eye(3)[1]), again.bounds(np.eye(3)[1]))


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("values", np.ones(4), "array 'values' has 4 numbers, expected 3 of states and 2 of ends"),
        ("next_states", np.full(330, 9), "array 'next_states' goes up to 9, expected below 5"),
        ("lower", np.full((3, 5), 50.0), "array 'lower' is above 'upper'"),
        ("times", np.full(330, -1.0), "array 'times' lies between"),
        ("feature_spread", np.zeros(5), "array 'feature_spread'"),
    ],
)
def test_damaged_arrays_are_refused(model, name, array, message):
    with pytest.raises(ValueError, match=message):
        PlanningModel.from_arrays(model.to_arrays() | {name: array})
