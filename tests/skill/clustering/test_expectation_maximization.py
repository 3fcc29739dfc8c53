from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_t
from sklearn.mixture import GaussianMixture

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
    student_samples,
    weighted_moments,
)
from tests.skill.clustering.labelled_sets import ellipses, separated, spheres

NU = 4.0


def test_block_size_does_not_matter(monkeypatch):
    X, _ = separated(0, N=900, d=5)
    components = random_components(1, 4, 5)
    arguments = {"eta": 1.0, "cardinalities": np.array([500.0, 200.0, 100.0, 100.0]), "fuzzy": True}
    whole = e_step(X, components, **arguments)
    monkeypatch.setattr("skill.clustering.expectation_maximization.BLOCK", 7)
    blocks = e_step(X, components, **arguments)
    np.testing.assert_allclose(blocks.means, whole.means, rtol=1e-9)
    np.testing.assert_allclose(blocks.covariances, whole.covariances, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(blocks.cardinalities, whole.cardinalities, rtol=1e-9)
    assert blocks.log_likelihood == pytest.approx(whole.log_likelihood, rel=1e-12)


def test_posteriors_equal_those_of_scikit_learn():
    X, _ = spheres(0)
    mixture = GaussianMixture(4, random_state=0).fit(X)
    components = components_of_partition(X, mixture.predict(X), no_prior(2))
    mixture.weights_, mixture.means_ = components.weights, components.means
    mixture.covariances_ = components.covariances
    mixture.precisions_cholesky_ = np.linalg.inv(np.linalg.cholesky(components.covariances)).transpose(0, 2, 1)
    p = densities(X, components)
    np.testing.assert_allclose(p / p.sum(axis=1, keepdims=True), mixture.predict_proba(X), atol=1e-10)
    assert e_step(X, components).log_likelihood == pytest.approx(mixture.score(X) * len(X), rel=1e-12)


@pytest.mark.parametrize("fuzzy", [False, True])
@pytest.mark.parametrize("eta", [0.0, 2.0])
def test_moments_worked_by_hand(fuzzy, eta):
    Z = np.random.default_rng(4).normal(size=(60, 2))
    components = random_components(5, 3, 2)
    N_i = np.array([35.0, 20.0, 5.0])
    p = densities(Z, components)
    h = p / p.sum(axis=1, keepdims=True)
    u = np.clip(h * (1.0 + eta * 60 / np.sum(N_i**2) * (N_i - h @ N_i[:, None])), 0.0, 1.0)
    u /= u.sum(axis=1, keepdims=True)
    if eta:
        assert (u == 0.0).any()  # some memberships are clipped
    step = e_step(Z, components, eta=eta, cardinalities=N_i, fuzzy=fuzzy)
    weights = u**2 if fuzzy else u
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


def test_likelihood_never_falls_without_competition_and_prior():
    X, _ = ellipses(1)
    rng = np.random.default_rng(0)
    components = components_of_partition(X, rng.integers(0, 5, len(X)), no_prior(2))
    values = []
    for _ in range(60):
        step = e_step(X, components)
        values.append(step.log_likelihood)
        components = m_step(step, no_prior(2))
    assert np.diff(values).min() > -1e-8 * abs(values[0])


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


def test_moments_are_weighted_by_the_tails():
    Z = np.random.default_rng(2).standard_t(3.0, size=(50, 2))
    components = replace(random_components(3, M=2, d=2), degrees=NU)
    columns, weights = [], []
    for P, v, F in zip(components.weights, components.means, components.covariances, strict=True):
        columns.append(P * multivariate_t(v, F, df=NU).pdf(Z))
        weights.append((NU + 2) / (NU + np.einsum("na,ab,nb->n", Z - v, np.linalg.inv(F), Z - v)))
    p, w = np.stack(columns, axis=1), np.stack(weights, axis=1)
    h = p / p.sum(axis=1, keepdims=True)
    step = e_step(Z, components)
    assert step.log_likelihood == pytest.approx(np.log(p.sum(axis=1)).sum())
    np.testing.assert_allclose(step.cardinalities, h.sum(axis=0))
    np.testing.assert_allclose(step.weight_sums, (h * w).sum(axis=0))
    for i in range(2):
        np.testing.assert_allclose(step.means[i], np.average(Z, axis=0, weights=h[:, i] * w[:, i]))
        np.testing.assert_allclose(step.covariances[i], np.cov(Z.T, aweights=h[:, i] * w[:, i], bias=True))


def test_the_likelihood_with_tails_never_falls():
    Z = np.vstack(
        [student_samples(4, 200, np.zeros(2), np.eye(2), NU), student_samples(5, 100, [4.0, 0.0], np.eye(2), NU)]
    )
    components = replace(spherical([0.5, 0.5], [[-1.0, 0.0], [1.0, 0.0]]), degrees=NU)
    values = []
    for _ in range(40):
        components, value, _ = expectation_maximization(Z, components, no_prior(2), max_iter=2, tol=-np.inf)
        values.append(value)
    assert (np.diff(values) > -1e-9).all()
    assert values[-1] > values[0] + 5.0


def test_location_and_scale_of_a_student_distribution_are_found():
    F = np.array([[2.0, 0.7], [0.7, 0.5]])
    Z = student_samples(6, 20_000, [1.0, -2.0], F, NU)
    start = replace(components_of_partition(Z, np.zeros(len(Z), dtype=int), no_prior(2)), degrees=NU)
    found, _, converged = expectation_maximization(Z, start, no_prior(2), max_iter=200, tol=1e-9)
    assert converged
    assert found.degrees == NU
    np.testing.assert_allclose(found.means[0], [1.0, -2.0], atol=0.03)
    np.testing.assert_allclose(found.covariances[0], F, rtol=0.04)
