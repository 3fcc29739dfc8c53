import numpy as np
import pytest

from skill.clustering.expectation_maximization import (
    CovariancePrior,
    Moments,
    components_of_partition,
    e_step,
    expectation_maximization,
    m_step,
)
from tests.skill.clustering.components import (
    densities,
    no_prior,
    random_components,
    spherical,
    weighted_moments,
)
from tests.skill.clustering.labelled_sets import spheres


@pytest.mark.parametrize("degrees", [np.inf, 4.0])
@pytest.mark.parametrize("fuzzy", [False, True])
@pytest.mark.parametrize("eta", [0.0, 2.0])
def test_moments_worked_by_hand(monkeypatch, degrees, fuzzy, eta):
    monkeypatch.setattr("skill.clustering.expectation_maximization.BLOCK", 7)
    Z = np.random.default_rng(4).normal(size=(60, 2))
    components = random_components(5, 3, 2, degrees)
    N_i = np.array([35.0, 20.0, 5.0])
    p = densities(Z, components)
    h = p / p.sum(axis=1, keepdims=True)
    u = np.clip(h * (1.0 + eta * 60 / np.sum(N_i**2) * (N_i - h @ N_i[:, None])), 0.0, 1.0)
    u /= u.sum(axis=1, keepdims=True)
    if eta:
        assert (u == 0.0).any()  # some memberships are clipped
    step = e_step(Z, components, eta=eta, cardinalities=N_i, fuzzy=fuzzy)
    weights = u**2 if fuzzy else u
    if degrees == 4.0:
        offset = Z[:, None] - components.means
        weights = (
            weights * 6.0 / (4.0 + np.einsum("nia,iab,nib->ni", offset, np.linalg.inv(components.covariances), offset))
        )
    means, covariances = weighted_moments(Z, weights)
    np.testing.assert_allclose(step.cardinalities, u.sum(axis=0))
    np.testing.assert_allclose(step.weight_sums, weights.sum(axis=0))
    np.testing.assert_allclose(step.means, means)
    np.testing.assert_allclose(step.covariances, covariances)
    assert step.log_likelihood == pytest.approx(np.log(p.sum(axis=1)).sum())


def test_distant_samples_do_not_underflow():
    step = e_step(np.array([[1e3], [-1e3]]), spherical([0.5, 0.5], [[0.0], [1.0]]))
    np.testing.assert_allclose(step.cardinalities, [1.0, 1.0])
    assert np.isfinite(step.log_likelihood)


def test_prior_worked_by_hand():
    prior = CovariancePrior(count=2.0, variance=3.0, floor=np.array([0.5, 0.25]))
    covariances = np.stack([np.eye(2), 2.0 * np.eye(2), np.eye(2), np.eye(2)])
    regularised = prior.apply(covariances, np.array([6.0, 8.0, 1.0, 0.0]))
    spherical_prior = 0.1 * 3.0 / 4  # 0.1 g M^(-2/d) with M = 4, d = 2
    np.testing.assert_allclose(regularised[1], np.diag((16.0 + 2.0 * spherical_prior) / 10.0 + prior.floor))
    np.testing.assert_allclose(regularised[3], np.diag(spherical_prior + prior.floor))
    assert prior.parameters == 5


def test_m_step_gives_components_that_have_the_moments_of_the_step():
    step = Moments(
        cardinalities=np.array([6.0, 2.0]),
        weight_sums=np.array([4.0, 1.0]),
        means=np.array([[1.0], [2.0]]),
        covariances=np.array([[[3.0]], [[5.0]]]),
        log_likelihood=0.0,
    )
    prior = CovariancePrior(count=1.0, variance=10.0, floor=np.array([0.5]))
    components = m_step(step, prior)
    np.testing.assert_allclose(components.weights, [0.75, 0.25])
    np.testing.assert_array_equal(components.means, step.means)
    # 0.1 * 10 * 2^-2 = 0.25 counts as one sample beside the weight sums 4 and 1.
    np.testing.assert_allclose(components.covariances[:, 0, 0], [12.25 / 5.0 + 0.5, 5.25 / 2.0 + 0.5])


def test_retained_components_are_normalised():
    components = spherical([0.5, 0.3, 0.2], [[0.0], [1.0], [2.0]], [1.0, 2.0, 3.0])
    kept = components.retained(np.array([True, False, True]))
    np.testing.assert_allclose(kept.weights, [5 / 7, 2 / 7])
    np.testing.assert_array_equal(kept.means[:, 0], [0.0, 2.0])
    np.testing.assert_array_equal(kept.covariances[:, 0, 0], [1.0, 3.0])


def test_em_stops_when_the_gain_is_small():
    X, y = spheres(0)
    start = components_of_partition(X, y, no_prior(2))
    gains = []
    components = start
    previous = e_step(X, start).log_likelihood
    while not gains or gains[-1] >= 1e-3:
        components = m_step(e_step(X, components), no_prior(2))
        value = e_step(X, components).log_likelihood
        gains.append(value - previous)
        previous = value
    found, log_likelihood, converged = expectation_maximization(X, start, no_prior(2), max_iter=200, tol=1e-3)
    assert converged
    assert log_likelihood == previous
    np.testing.assert_array_equal(found.means, components.means)
    assert e_step(X, found).log_likelihood == log_likelihood
    # Its last pass only evaluates: it needs one iteration more than the number of gains.
    assert expectation_maximization(X, start, no_prior(2), max_iter=len(gains) + 1, tol=1e-3)[2]
    assert not expectation_maximization(X, start, no_prior(2), max_iter=len(gains), tol=1e-3)[2]


def test_em_converges_only_below_the_tolerance():
    Z = np.array([[-1.0], [1.0]])
    stationary = spherical([1.0], [[0.0]])
    assert not expectation_maximization(Z, stationary, no_prior(1), max_iter=5, tol=0.0)[2]
    found, log_likelihood, converged = expectation_maximization(Z, stationary, no_prior(1), max_iter=2, tol=1e-9)
    assert converged
    assert log_likelihood == pytest.approx(-np.log(2.0 * np.pi) - 1.0)
    np.testing.assert_array_equal(found.means, [[0.0]])


def test_em_drops_components_with_less_than_one_sample():
    Z = np.concatenate([np.linspace(-1, 1, 20), np.linspace(9, 11, 20)])[:, None]
    prior = CovariancePrior(count=1.0, variance=1.0, floor=np.array([1e-3]))
    start = spherical([0.4, 0.2, 0.4], [[0.0], [500.0], [10.0]])
    found, log_likelihood, converged = expectation_maximization(Z, start, prior, max_iter=100, tol=1e-9)
    assert converged
    np.testing.assert_allclose(found.means[:, 0], [0.0, 10.0], atol=1e-6)
    assert found.weights.sum() == pytest.approx(1.0)
    # The likelihood fell when the component was dropped; EM continued all the same.
    assert log_likelihood == e_step(Z, found).log_likelihood


def test_component_with_exactly_one_sample_stays():
    Z = np.array([[0.0], [0.1], [-0.1], [1000.0]])
    prior = CovariancePrior(count=1.0, variance=1.0, floor=np.array([1e-2]))
    found, _, _ = expectation_maximization(Z, spherical([0.75, 0.25], [[0.0], [1000.0]]), prior, max_iter=20, tol=1e-9)
    np.testing.assert_allclose(found.means[:, 0], [0.0, 1000.0])


def test_components_of_a_partition_worked_by_hand():
    Z = np.array([[0.0, 0.0], [10.0, 0.0], [2.0, 0.0], [10.0, 4.0], [1.0, 3.0]])
    labels = np.array([5, 2, 5, 2, 5])
    prior = CovariancePrior(count=1.0, variance=1.0, floor=np.array([0.5, 0.0]))
    found = components_of_partition(Z, labels, prior)
    np.testing.assert_allclose(found.weights, [0.4, 0.6])
    np.testing.assert_allclose(found.means, [[10.0, 2.0], [1.0, 1.0]])
    # Two samples of variance (0, 4) and one of the prior's, 0.1 / 2 with two clusters in two channels.
    np.testing.assert_allclose(found.covariances[0], np.diag([0.05 / 3 + 0.5, 8.05 / 3]))
