import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.regression.neighbourhood import (
    SEARCH_BLOCK,
    Kernel,
    KernelNeighbourhood,
    MembershipIndex,
    NeighbourIndex,
    check_memberships,
    smallest,
)


def naive(points, query, k):
    return set(np.argsort(((points - query) ** 2).sum(axis=1), kind="stable")[:k])


@given(
    st.integers(1, 300),
    st.integers(1, 6),
    st.integers(1, 20),
    st.integers(0, 10_000),
)
def test_the_search_finds_the_nearest_points(n, d, k, seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, d)) * rng.uniform(0.01, 100, d) + 1e3
    queries = points[rng.integers(0, n, 7)] + 0.1 * rng.normal(size=(7, d))
    rows = 10 + np.arange(n)
    dut = NeighbourIndex(points, rows)
    many = dut.nearest_many(queries, k)
    for query, found in zip(queries, many, strict=True):
        expected = {row + 10 for row in naive(points, query, k)}
        assert set(found) == expected


def test_equal_points_are_found():
    dut = NeighbourIndex(np.zeros((1000, 3)))
    assert dut.nearest_many(np.ones((2, 3)), 5).shape == (2, 5)


def test_candidates_come_from_the_states_the_query_may_be_in():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(400, 3))
    P = np.eye(4)[rng.integers(0, 4, 400)]
    dut = MembershipIndex(points, P)
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
    rows, log_share = MembershipIndex(points, P).candidates(points[:3], P[:3], 20)
    for found, log in zip(rows, log_share, strict=True):
        assert np.isfinite(log).sum() == len(np.unique(found)) == 20


@pytest.mark.parametrize("adaptive", [False, True])
def test_one_query_and_many_have_the_same_neighbourhoods(adaptive):
    rng = np.random.default_rng(1)
    points, weight = rng.normal(size=(3000, 4)), rng.uniform(0.5, 1.0, 3000)
    P, Q = rng.dirichlet([0.2] * 3, 3000), rng.dirichlet([0.2] * 3, 40)
    dut = KernelNeighbourhood(points, P, weight)
    kernel = Kernel(0.7, adaptive, 60)
    for block, found, x, log_w in dut.blocks(points[:40], Q, kernel):
        for i, query in enumerate(range(*block.indices(40))):
            one, log_one = dut.of_one(points[query], Q[query], kernel)
            a, b = np.argsort(found[i]), np.argsort(one)
            np.testing.assert_array_equal(found[i][a], one[b])
            np.testing.assert_allclose(log_w[i][a], log_one[b], atol=1e-12)
            np.testing.assert_array_equal(x[i][a], points[one[b]])


def test_a_long_batch_is_searched_in_blocks():
    points = np.random.default_rng(0).normal(size=(3000, 2))
    dut = NeighbourIndex(points)
    queries = np.random.default_rng(1).normal(size=(200, 2))
    assert len(points) * len(queries) > 2 * SEARCH_BLOCK
    found = dut.nearest_many(queries, 3)
    assert all(set(rows) == naive(points, q, 3) for q, rows in zip(queries, found, strict=True))


@pytest.mark.parametrize("batched", [False, True])
def test_of_candidates_from_two_states_the_greatest_weights_are_kept(batched):
    x = np.array([[0.1], [0.2], [0.3], [0.4], [-0.15], [-0.25], [-0.35], [-0.45]])
    P = np.repeat([[1.0, 0.0], [0.0, 1.0]], 4, axis=0)
    dut = KernelNeighbourhood(x, P, np.ones(8))
    for q, expected in (([0.5, 0.5], {0, 1, 4}), ([0.9, 0.1], {0, 1, 2}), ([0.1, 0.9], {4, 5, 6})):
        query, state, kernel = np.zeros(1), np.array(q), Kernel(1.0, False, 3)
        if batched:
            _, found, _, log_w = next(dut.blocks(query[None], state[None], kernel))
            found, log_w = found[0], log_w[0]
        else:
            found, log_w = dut.of_one(query, state, kernel)
        assert set(found) == expected
        np.testing.assert_allclose(np.exp(log_w), np.exp(-(x[found, 0] ** 2)) * (P[found] @ state))


def test_an_adaptive_kernel_has_the_distance_of_the_farthest_neighbour():
    x = np.array([[1.0], [2.0], [-4.0], [8.0]])
    dut = KernelNeighbourhood(x, None, np.ones(4))
    found, log_w = dut.of_one(np.zeros(1), None, Kernel(0.5, True, 3))
    np.testing.assert_allclose(log_w, -((x[found, 0] / (0.5 * 4.0)) ** 2))
    equal = KernelNeighbourhood(np.zeros((4, 1)), None, np.ones(4)).of_one(np.zeros(1), None, Kernel(0.5, True))
    np.testing.assert_array_equal(equal[1], 0.0)


def test_extra_neighbours_are_added():
    x = np.arange(10.0)[:, None]
    dut = KernelNeighbourhood(x, None, np.ones(10))
    assert next(dut.blocks(x[:2], None, Kernel(1.0, False, 3), extra=2))[1].shape == (2, 5)
    assert next(dut.blocks(x[:2], None, Kernel(1.0, False, 3), extra=20))[1].shape == (2, 10)
    assert next(dut.blocks(x[:2], None, Kernel(1.0)))[1].shape == (2, 10)


def test_all_blocks_together_are_the_whole_batch():
    rng = np.random.default_rng(0)
    x, P = rng.normal(size=(2000, 8)), rng.dirichlet([0.3] * 3, 2000)
    dut = KernelNeighbourhood(x, P, np.ones(2000))
    blocks = list(dut.blocks(x, P, Kernel(1.0, False, 200)))
    assert len(blocks) > 10
    assert [row for block, *_ in blocks for row in range(*block.indices(2000))] == list(range(2000))
    for block, found, _, log_w in blocks[::5]:
        row, first = range(*block.indices(2000))[0], np.argmax(log_w[0])
        one, log_one = dut.of_one(x[row], P[row], Kernel(1.0, False, 200))
        assert found[0, first] == one[log_one.argmax()]
        assert len(set(found[0]) ^ set(one)) == 0


def test_a_sample_without_a_shared_state_has_the_minimum_share():
    points = np.arange(4.0)[:, None]
    dut = KernelNeighbourhood(points, np.eye(3)[[0, 0, 1, 1]], np.ones(4))
    rows, log_w = dut.of_one(np.zeros(1), np.array([0.0, 0.0, 1.0]), Kernel(1.0, n_neighbors=2))
    assert set(rows) == {0, 1}
    np.testing.assert_allclose(log_w, np.log(1e-300) - points[rows, 0] ** 2)


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


def test_a_copy_leaves_the_indices_out_and_answers_alike():
    rng = np.random.default_rng(4)
    points, P = rng.normal(size=(2000, 5)), rng.dirichlet(np.full(6, 0.1), 2000)
    dut = KernelNeighbourhood(points, P, rng.uniform(0.5, 1.0, 2000))
    data = pickle.dumps(dut)
    assert len(data) < 1.1 * 8 * (points.size + P.size + 2000)
    found, expected = (index.of_one(points[3], P[3], Kernel(1.0)) for index in (pickle.loads(data), dut))
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)
