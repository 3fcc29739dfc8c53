import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sklearn.linear_model import LinearRegression

from skill.features.wrench_features import CanonicalFeatures
from skill.policy.imitation import Imitation, lowest_log_support, quartiles_of
from skill.policy.prediction import Query
from skill.regression.locally_weighted_regression import LWRegressor

ONE = np.ones((1, 1))

numbers = arrays(float, st.integers(1, 30), elements=st.floats(-5.0, 5.0))


def query(x):
    """A query at one feature; an imitation does not look at the measurement itself."""
    X = np.array([[x]])
    return Query(X, X, ONE)


def imitation(regressor, X, Y, **parameters):
    return Imitation(regressor.fit(X, Y, **parameters), np.zeros((len(X), 2)), -math.inf)


@given(numbers)
def test_quartiles_are_values_of_the_inverse_distribution(values):
    weights = 1.0 + np.arange(len(values))
    expected = np.quantile(values, [0.25, 0.75], weights=weights, method="inverted_cdf")
    np.testing.assert_array_equal(quartiles_of(values, weights), expected)


@pytest.fixture
def sloping():
    """Turns that fall towards zero with x among 0..1, so that a line reverses them beyond x = 2; feeds as well."""
    x = np.linspace(0.0, 1.0, 101)[:, None]
    Y = np.column_stack([0.2 - 0.1 * x, -0.2 + 0.1 * x, -0.2 + 0.1 * x])
    return imitation(LWRegressor(bandwidth=5.0, ridge=1e-3, feature_scale=None), x, Y, memberships=np.ones((101, 1)))


def test_a_turn_is_not_extrapolated(sloping):
    found = sloping.predict(query(3.0))
    np.testing.assert_allclose(found.action[:2], [0.125, -0.125], atol=0.003)  # the farther quartile
    assert found.limited
    assert found.action[2] == pytest.approx(0.1, abs=0.01)  # a feed is


def test_within_the_quartiles_a_prediction_is_that_of_the_regressor(sloping):
    X = np.array([[0.5]])
    found = sloping.predict(Query(X, X, ONE))
    np.testing.assert_array_equal(found.action, sloping.regressor.predict(X)[0])
    assert not found.limited
    assert found.support == 1.0


def test_a_foreign_regressor_is_used_as_it_is():
    x = np.linspace(0.0, 1.0, 5)[:, None]
    found = imitation(LinearRegression(), x, np.column_stack([x, 2 * x, -x])).predict(query(3.0))
    np.testing.assert_allclose(found.action, [3.0, 6.0, -3.0])
    assert (found.support, found.limited) == (1.0, False)
    assert lowest_log_support(LinearRegression(), np.arange(5)) == -math.inf


class Unsupported(LWRegressor):
    """A regressor in which a share of the samples find nothing in the other demonstrations."""

    def __init__(self, share):
        super().__init__()
        self.share = share

    def support_between(self, groups):
        return np.where(np.arange(len(groups)) < self.share * len(groups), -np.inf, -2.0)


@pytest.mark.parametrize(("share", "expected"), [(0.0, -2.0), (0.005, -2.0), (0.01, -math.inf), (0.5, -math.inf)])
def test_the_lowest_support_is_a_number_also_where_samples_find_nothing(share, expected):
    """Two demonstrations that differ much made it NaN, and a skill file that could not be read."""
    groups = np.repeat([0, 1], 500)
    assert lowest_log_support(Unsupported(share), groups) == expected


RECORDED = Path(__file__).parents[2] / "data" / "deadlock.npz"


def test_a_recorded_deadlock_is_left():
    """A wedge 2.2 mm deep, where the rig hardly turned for half a second, at 12 N, and then drew back.

    The file holds the measurements, and the demonstrated samples near them, of trial 74014 of the skill of set 719. Ten
    of fourteen demonstrations turn the same way there. Their slope, continued to the load of the jam, which is larger
    than theirs, leaves less than half a degree per second of that.
    """
    with np.load(RECORDED) as stored:
        recorded = dict(stored)
    per_demonstration = np.array(
        [recorded["y"][recorded["demonstration"] == k, 1].mean() for k in np.unique(recorded["demonstration"])]
    )
    one_degree_per_second = np.radians(0.02)
    with_most = per_demonstration[per_demonstration < 0.0] / one_degree_per_second
    assert (len(with_most), len(per_demonstration)) == (10, 14)
    assert (with_most.min(), with_most.max()) == pytest.approx((-4.7, -1.5), abs=0.1)

    regressor = LWRegressor(bandwidth=1.0, ridge=1.0, feature_scale=recorded["feature_scale"])
    P = recorded["memberships"] / recorded["memberships"].sum(axis=1, keepdims=True)
    dut = imitation(regressor, recorded["X"], recorded["y"], memberships=P)
    X = CanonicalFeatures().transform(recorded["measured"].astype(float))
    Q = recorded["queried"] / recorded["queried"].sum(axis=1, keepdims=True)
    extrapolated = regressor.predict(X, memberships=Q)[:, 1] / one_degree_per_second
    turns = [dut.predict(Query(x[None], x[None], q[None])).action[1] for x, q in zip(X, Q, strict=True)]
    assert np.median(extrapolated) == pytest.approx(-0.5, abs=0.1)
    assert np.median(turns) / one_degree_per_second < -1.0
