import numpy as np
import pytest

from benchmarks.learners.cluster_sets import spheres
from skill.clustering.cluster_competition import (
    History,
    compete,
    exponential_schedule,
    ramp_schedule,
    survivors,
)
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.expectation_maximization import CovariancePrior
from tests.skill.clustering.components import densities, no_prior, spherical, weighted_moments

SYMMETRIC = np.array([[-1.0], [1.0]])


def test_schedules():
    exponential = exponential_schedule(5.0, 10.0, begin=3)
    assert [exponential(k) for k in (0, 3, 13)] == pytest.approx([5.0, 5.0, 5.0 / np.e])
    assert exponential_schedule(5.0, 10.0)(10) == pytest.approx(5.0 / np.e)
    ramp = ramp_schedule(5.0, 10.0, 10, 30)
    assert [ramp(k) for k in (0, 10, 29, 40)] == pytest.approx([5.0 / np.e, 5.0, 5.0, 5.0 / np.e])
    assert [ramp(k) for k in (9, 30, 31)] == pytest.approx([5.0 * np.exp(-0.1), 5.0, 5.0 * np.exp(-0.1)])


def test_decay_before_the_end_of_the_rise():
    ramp = ramp_schedule(5.0, 10.0, 10, 4)
    assert [ramp(k) for k in (5, 10)] == pytest.approx([5.0 * np.exp(-0.5), 5.0 * np.exp(-0.6)])


def test_at_most_a_tenth_of_the_clusters_dies_in_an_iteration():
    keep = survivors(np.arange(20.0), 15.0)
    np.testing.assert_array_equal(np.flatnonzero(~keep), [0, 1])
    np.testing.assert_array_equal(survivors(np.array([3.0, 1.0, 2.0]), 5.0), [True, False, True])
    np.testing.assert_array_equal(np.flatnonzero(~survivors(np.arange(29.0), 15.0)), [0, 1])


def test_last_cluster_survives():
    assert survivors(np.array([1.0]), 10.0).all()


def test_cluster_of_the_minimum_cardinality_survives():
    np.testing.assert_array_equal(survivors(np.array([5.0, 7.0]), 5.0), [True, True])
    np.testing.assert_array_equal(survivors(np.array([4.999, 7.0]), 5.0), [False, True])


def test_history_as_arrays():
    history = History()
    history.append(3, 0.5, -2.0)
    history.append(2, 0.25, -1.0)
    arrays = history.arrays()
    np.testing.assert_array_equal(arrays["n_clusters"], [3.0, 2.0])
    np.testing.assert_array_equal(arrays["eta"], [0.5, 0.25])
    np.testing.assert_array_equal(arrays["log_likelihood"], [-2.0, -1.0])
    assert all(array.dtype == float for array in arrays.values())


def reference_competition(Z, components, prior, schedule, min_cardinality, iterations):
    """The equations of the competition without blocks and features; one death in an iteration at most."""
    weights, means, covariances = components.weights, components.means, components.covariances
    N_i = weights * len(Z)
    numbers, log_likelihoods = [], []
    for k in range(iterations):
        p = densities(Z, type(components)(weights, means, covariances))
        h = p / p.sum(axis=1, keepdims=True)
        numbers.append(len(weights))
        log_likelihoods.append(np.log(p.sum(axis=1)).sum())
        u = h * (1.0 + schedule(k) * len(Z) / np.sum(N_i**2) * (N_i - h @ N_i[:, None]))
        u = np.clip(u, 0.0, 1.0)
        u /= u.sum(axis=1, keepdims=True)
        N_i = u.sum(axis=0)
        means, covariances = weighted_moments(Z, u**2)
        covariances = prior.apply(covariances, (u**2).sum(axis=0))
        weights = N_i / N_i.sum()
        if N_i.min() < min_cardinality:
            keep = np.arange(len(N_i)) != np.argmin(N_i)
            N_i, means, covariances = N_i[keep], means[keep], covariances[keep]
            weights = weights[keep] / weights[keep].sum()
    return weights, means, covariances, numbers, log_likelihoods


def test_competition_against_its_equations():
    X, _ = spheres(0)
    Z = (X - X.mean(0)) / X.std(0)
    prior = CovariancePrior(count=3.0, variance=1.0, floor=np.full(2, 1e-6), diagonal=False)
    start = components_of_partition(Z, np.random.default_rng(0).integers(0, 8, len(Z)), prior)
    schedule = exponential_schedule(2.0, 10.0)
    found, history, converged = compete(Z, start, prior, schedule, min_cardinality=30.0, max_iter=25, tol=0.0)
    weights, means, covariances, numbers, log_likelihoods = reference_competition(Z, start, prior, schedule, 30.0, 25)
    assert history.n_clusters == numbers
    assert numbers[0] == 8
    assert numbers[-1] < 7  # several clusters died
    np.testing.assert_allclose(history.eta, [schedule(k) for k in range(25)])
    np.testing.assert_allclose(history.log_likelihood, log_likelihoods, rtol=1e-9)
    np.testing.assert_allclose(found.weights, weights, rtol=1e-6)
    np.testing.assert_allclose(found.means, means, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(found.covariances, covariances, rtol=1e-6, atol=1e-8)
    assert not converged


def test_competition_converges_after_three_still_iterations():
    arguments = {"min_cardinality": 1.0, "max_iter": 10}
    components = spherical([1.0], [[0.0]])
    found, history, converged = compete(SYMMETRIC, components, no_prior(1), lambda k: 1.0, tol=1e-9, **arguments)
    assert converged
    assert len(history.eta) == 3
    np.testing.assert_allclose(found.covariances, [[[1.0]]])
    _, history, converged = compete(SYMMETRIC, components, no_prior(1), lambda k: 1.0, tol=0.0, **arguments)
    assert not converged
    assert len(history.eta) == 10


def test_movement_restarts_the_count_of_still_iterations():
    # The first iteration moves the centre from 1 to 0, the next three do not.
    _, history, converged = compete(
        SYMMETRIC, spherical([1.0], [[1.0]]), no_prior(1), lambda k: 1.0, min_cardinality=1.0, max_iter=10, tol=0.5
    )
    assert converged
    assert len(history.eta) == 4


def test_death_restarts_the_count_of_still_iterations():
    Z = np.array([[-1.0], [1.0], [-1.0], [1.0]])
    start = spherical([0.5, 0.5], [[0.0], [0.0]])
    # Two equal components share every sample: neither moves, but one of them is too small and dies at once.
    found, history, converged = compete(
        Z, start, no_prior(1), lambda k: 0.0, min_cardinality=3.0, max_iter=10, tol=1e-9
    )
    assert converged
    assert history.n_clusters == [2, 1, 1, 1]
    np.testing.assert_allclose(found.weights, [1.0])


def test_competition_ends_when_it_becomes_negligible():
    arguments = {"min_cardinality": 1.0, "max_iter": 10, "tol": 0.0}
    components = spherical([1.0], [[0.0]])
    prior = no_prior(1)
    _, history, converged = compete(SYMMETRIC, components, prior, lambda k: 0.5**k, min_eta=0.1, **arguments)
    assert converged
    assert history.eta == [1.0, 0.5, 0.25, 0.125]
    # The end is a strength that falls below the minimum, not one that is below it, as at the start of a ramp.
    _, history, converged = compete(SYMMETRIC, components, prior, lambda k: 0.01, min_eta=0.1, **arguments)
    assert not converged
    assert len(history.eta) == 10
    _, history, converged = compete(SYMMETRIC, components, prior, lambda k: 2.0**k, min_eta=4.0, **arguments)
    assert not converged
    _, history, converged = compete(SYMMETRIC, components, prior, lambda k: 0.5**k, min_eta=0.125, **arguments)
    assert history.eta[-1] == 0.125
