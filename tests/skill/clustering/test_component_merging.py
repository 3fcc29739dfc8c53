import numpy as np
import pytest
from scipy.stats import multivariate_normal

from skill.clustering.component_merging import (
    Mixture,
    best_of_each_number,
    merge_closest,
    merge_path,
    merged_pair,
    polished,
    runnalls_costs,
)
from skill.clustering.expectation_maximization import components_of_partition, expectation_maximization
from tests.skill.clustering.components import no_prior, random_components, spherical
from tests.skill.clustering.labelled_sets import separated


def test_merging_keeps_the_moments():
    components = random_components(5, degrees=4.0)
    merged = merge_closest(components)
    assert (len(merged), merged.degrees) == (3, 4.0)

    def moments(c):
        mean = c.weights @ c.means
        return mean, np.einsum("m,mab->ab", c.weights, c.covariances) + (c.weights * c.means.T) @ c.means

    for a, b in zip(moments(components), moments(merged), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
    pair = merged_pair(components, np.array([0]), np.array([0]))
    np.testing.assert_allclose(pair.covariances[0], components.covariances[0])


def test_cost_of_a_merger_worked_by_hand():
    components = spherical([0.2, 0.3, 0.5], [[0.0], [2.0], [5.0]], [2.0, 4.0, 3.0])
    i, j, costs = runnalls_costs(components)
    np.testing.assert_array_equal(i, [0, 0, 1])
    np.testing.assert_array_equal(j, [1, 2, 2])
    # The variance of components 0 and 1 together: 0.4 * 2 + 0.6 * 4 + 0.4 * 0.6 * 2^2.
    variance = 0.8 + 2.4 + 0.96
    assert costs[0] == pytest.approx(0.5 * (0.5 * np.log(variance) - 0.2 * np.log(2.0) - 0.3 * np.log(4.0)))


def test_closest_pair_is_merged():
    components = spherical([0.25, 0.25, 0.5], [[0.0], [9.0], [1.0]])
    merged = merge_closest(components)
    np.testing.assert_allclose(merged.means[:, 0], [9.0, 2 / 3])
    np.testing.assert_allclose(merged.weights, [0.25, 0.75])


def test_path_ends_at_the_single_gaussian():
    X, y = separated(0, N=500, d=3)
    path = merge_path(X, components_of_partition(X, y, no_prior(3)), no_prior(3))
    assert [len(mixture.components) for mixture in path] == [6, 5, 4, 3, 2, 1]
    np.testing.assert_allclose(path[-1].components.means[0], X.mean(axis=0), atol=1e-9)
    expected = multivariate_normal(X.mean(0), np.cov(X.T, bias=True)).logpdf(X).sum()
    assert path[-1].log_likelihood == pytest.approx(expected, rel=1e-9)


def test_each_mixture_of_the_path_has_ten_iterations_of_em():
    X, _ = separated(0, N=500, d=3)
    start = components_of_partition(X, np.random.default_rng(0).integers(0, 4, len(X)), no_prior(3))
    tol = 0.005 * 9 * np.log(len(X))
    path = merge_path(X, start, no_prior(3))
    found, log_likelihood, converged = expectation_maximization(X, start, no_prior(3), max_iter=10, tol=tol)
    assert not converged
    assert path[0].log_likelihood == log_likelihood
    np.testing.assert_array_equal(path[0].components.means, found.means)
    _, second, _ = expectation_maximization(X, merge_closest(found), no_prior(3), max_iter=10, tol=tol)
    assert path[1].log_likelihood == second


def test_best_mixture_of_each_number():
    one, two = spherical([1.0], [[0.0]]), spherical([0.5, 0.5], [[0.0], [1.0]])
    first, second = [Mixture(two, -5.0), Mixture(one, -9.0)], [Mixture(two, -6.0), Mixture(one, -8.0)]
    best = best_of_each_number([first, second])
    assert list(best) == [2, 1]
    assert best[2] is first[0]
    assert best[1] is second[1]
    # The first of equals is kept.
    assert best_of_each_number([first, [Mixture(two, -5.0)]])[2] is first[0]
    assert list(best_of_each_number([[Mixture(one, -1.0)], [Mixture(two, -1.0)]])) == [2, 1]


def test_polishing_improves_mixtures_and_drops_duplicates():
    X, _ = separated(0, N=500, d=3)
    rough = components_of_partition(X, np.random.default_rng(0).integers(0, 4, len(X)), no_prior(3))
    lonely = spherical([0.5, 0.5], [X[0], [1e3, 1e3, 1e3]])
    found = polished(X, {4: Mixture(rough, -np.inf), 2: Mixture(lonely, 0.0)}, no_prior(3))
    assert list(found) == [4]
    expected = expectation_maximization(X, rough, no_prior(3), max_iter=10, tol=0.005 * 9 * np.log(500))
    assert found[4].log_likelihood == expected[1]
    np.testing.assert_array_equal(found[4].components.means, expected[0].means)
