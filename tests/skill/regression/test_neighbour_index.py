import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skill.regression.kernel_neighbourhood import Kernel, KernelNeighbourhood
from skill.regression.membership_index import MembershipIndex
from skill.regression.neighbour_index import NeighbourIndex


def naive(points, query, k):
    return set(np.argsort(((points - query) ** 2).sum(axis=1), kind="stable")[:k])


@settings(deadline=None, max_examples=40)
@given(
    st.integers(1, 300),
    st.integers(1, 6),
    st.integers(1, 20),
    st.sampled_from(["kd_tree", "brute", "auto"]),
    st.integers(0, 10_000),
)
def test_the_nearest_are_the_nearest(n, d, k, algorithm, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, d)) * rng.uniform(0.01, 100, d) + 1e3
    queries = points[rng.integers(0, n, 7)] + 0.1 * rng.normal(size=(7, d))
    rows = 10 + np.arange(n)
    dut = NeighbourIndex(points, rows, algorithm)
    many = dut.nearest_many(queries, k)
    for query, found in zip(queries, many, strict=True):
        expected = {row + 10 for row in naive(points, query, k)}
        assert set(found) == expected == set(dut.nearest(query, k))


def test_large_sets_are_searched_by_tree_and_small_ones_by_brute_force():
    rng = np.random.default_rng(0)
    assert NeighbourIndex(rng.normal(size=(500, 14))).algorithm == "brute"
    assert NeighbourIndex(rng.normal(size=(30_000, 14))).algorithm == "kd_tree"
    assert NeighbourIndex(rng.normal(size=(15_000, 3))).algorithm == "kd_tree"


@pytest.mark.parametrize("algorithm", ["kd_tree", "brute"])
def test_many_equal_points_are_no_trouble(algorithm):
    dut = NeighbourIndex(np.zeros((1000, 3)), None, algorithm)
    assert dut.nearest_many(np.ones((2, 3)), 5).shape == (2, 5)


def test_candidates_come_from_the_states_the_query_may_be_in():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(400, 3))
    P = np.eye(4)[rng.integers(0, 4, 400)]
    dut = MembershipIndex(points, P, "auto")
    Q = np.array([[1.0, 0, 0, 0], [0.5, 0.5, 0, 0], [0, 0, 0.9995, 0.0005], [0.2, 0.3, 0.4, 0.1]])
    rows, log_share = dut.candidates(points[:4], Q, 10)
    for q, found, log in zip(Q, rows, log_share, strict=True):
        real = found[np.isfinite(log)]
        assert len(np.unique(real)) == len(real) == 10 * (q > 1e-3).sum()
        np.testing.assert_allclose(np.exp(log[np.isfinite(log)]), P[real] @ q)
        assert set(P[real].argmax(axis=1)) == set(np.flatnonzero(q > 1e-3))


def test_a_sample_that_may_be_in_two_states_counts_once():
    points = np.random.default_rng(0).normal(size=(50, 2))
    P = np.full((50, 2), 0.5)
    rows, log_share = MembershipIndex(points, P, "auto").candidates(points[:3], P[:3], 20)
    for found, log in zip(rows, log_share, strict=True):
        assert np.isfinite(log).sum() == len(np.unique(found)) == 20


@pytest.mark.parametrize("adaptive", [False, True])
def test_one_query_and_many_have_the_same_neighbourhoods(adaptive):
    rng = np.random.default_rng(1)
    points, weight = rng.normal(size=(3000, 4)), rng.uniform(0.5, 1.0, 3000)
    P, Q = rng.dirichlet([0.2] * 3, 3000), rng.dirichlet([0.2] * 3, 40)
    dut = KernelNeighbourhood(points, P, weight, "auto")
    kernel = Kernel(0.7, adaptive, 60)
    for block, found, x, log_w in dut.blocks(points[:40], Q, kernel):
        for i, query in enumerate(range(*block.indices(40))):
            one, x_one, log_one = dut.of_one(points[query], Q[query], kernel)
            a, b = np.argsort(found[i]), np.argsort(one)
            np.testing.assert_array_equal(found[i][a], one[b])
            np.testing.assert_allclose(log_w[i][a], log_one[b], atol=1e-12)
            np.testing.assert_array_equal(x[i][a], x_one[b])
