import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.regression.locally_weighted_regression import LWRegressor
from skill.regression.neighbourhood import check_memberships, neighbourhood, selected, smallest


def found_among(X, P, weight, query, q, **settings):
    """Rows, ascending, and log weights of the neighbourhood of a query."""
    dut = LWRegressor(feature_scale=None, **settings).fit(X, np.zeros(len(X)), P, weight)
    rows, log_w = neighbourhood(dut.numbers(), query, q)
    order = np.argsort(rows)
    return rows[order], log_w[order]


@given(
    n=st.integers(1, 300),
    d=st.integers(1, 6),
    K=st.integers(1, 4),
    k=st.integers(1, 20),
    seed=st.integers(0, 10_000),
)
def test_a_neighbourhood_has_the_samples_of_greatest_weight_among_the_nearest_of_each_state(n, d, K, k, seed):
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, d)) * rng.uniform(0.01, 100, d) + 1e3
    P, q = rng.dirichlet(np.full(K, 0.1), n), rng.dirichlet(np.full(K, 0.2)) * rng.choice([1.0, 1e-3])
    weight, query = rng.uniform(0.5, 1.0, n), X[rng.integers(n)] + 0.1 * rng.normal(size=d)
    squares = ((X - query) ** 2).sum(axis=1)
    members = [np.flatnonzero(P[:, state] > 1e-3) for state in np.flatnonzero(q > 1e-3)]
    nearest = [part[np.argsort(squares[part])[:k]] for part in [*members, np.empty(0, int)]]
    rows = np.unique(np.concatenate(nearest))
    if not rows.size:  # no sample may be in a state of the query
        rows = np.sort(np.argsort(squares)[:k])
    log_w = -squares[rows] / 0.49 + np.log(P[rows] @ q) + np.log(weight[rows])
    kept = np.sort(np.argsort(-log_w)[:k])
    found, log_found = found_among(X, P, weight, query, q, bandwidth=0.7, n_neighbors=k)
    np.testing.assert_array_equal(found, rows[kept])
    np.testing.assert_allclose(log_found, log_w[kept], rtol=1e-9, atol=1e-9)


def test_samples_without_a_shared_state_have_the_minimum_share():
    X = np.arange(4.0)[:, None]
    q = np.array([0.0, 0.0, 1.0])
    rows, log_w = found_among(X, np.eye(3)[[0, 0, 1, 1]], None, np.zeros(1), q, bandwidth=1.0, n_neighbors=2)
    assert rows.tolist() == [0, 1]
    np.testing.assert_allclose(log_w, np.log(1e-300) - [0.0, 1.0])


@pytest.mark.parametrize(
    ("values", "states", "exact", "message"),
    [
        ([[0.5, 0.5]], 3, False, r"shape \(1, 2\), expected \(1, 3\)"),
        ([[0.5, 0.6]], None, False, "sum to at most one"),
        ([[0.5, 0.4]], None, True, "sum to one"),
        ([[1.1, -0.1]], None, False, "minimum -0.1"),
        (np.ones((1, 0)), None, False, "K, one column a contact state"),
        (np.ones((2, 1)), None, False, r"expected \(1, K"),
    ],
)
def test_values_that_are_not_memberships_are_refused(values, states, exact, message):
    with pytest.raises(ValueError, match=message):
        check_memberships(values, 1, states, exact)


@pytest.mark.parametrize("error", [0.9e-6, -0.9e-6])
def test_memberships_may_be_rounded(error):
    assert check_memberships([[0.5, 0.5 + error]], 1, 2, exact=True).shape == (1, 2)
    with pytest.raises(ValueError, match="not probabilities"):
        check_memberships([[0.5, 0.5 + 2.0 * error]], 1, 2, exact=True)
    assert check_memberships(np.empty((0, 2)), 0).shape == (0, 2)


@pytest.mark.parametrize(("n", "k"), [(5, 5), (40, 7), (1000, 50), (10_000, 200)])
def test_the_smallest_values_are_those_of_a_stable_sort(n, k):
    values = np.random.default_rng(n).integers(0, n // 3, n) / 8.0  # many are equal
    np.testing.assert_array_equal(np.sort(smallest(values, k)), np.sort(np.argsort(values, kind="stable")[:k]))


@given(st.lists(st.integers(0, 9), min_size=1, max_size=40), st.integers(0, 39))
def test_a_selected_value_is_that_of_a_sort(values, k):
    k = min(k, len(values) - 1)
    assert selected(np.array(values, dtype=float), k) == sorted(values)[k]


@pytest.mark.parametrize("n", [7, 20, 1000])
def test_of_numbers_that_are_none_the_smallest_are_places_that_exist(n):
    assert set(smallest(np.full(n, np.nan), 7)) <= set(range(n))
