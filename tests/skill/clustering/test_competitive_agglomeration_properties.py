"""Invariances of the learner, its parts worked by hand, and what it refuses."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from sklearn.metrics import adjusted_rand_score
from sklearn.mixture import GaussianMixture
from threadpoolctl import threadpool_limits

from benchmarks.learners.cluster_sets import demonstrations_and_phase, ellipses, insertion, separated, spheres
from skill.clustering.cluster_competition import exponential_schedule, ramp_schedule, survivors
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.cluster_merging import merge_closest, merge_path, merged_pair
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.effective_sample_size import design_effect
from skill.clustering.expectation_maximization import CovariancePrior, em_step, updated
from skill.clustering.gaussian_components import (
    GaussianComponents,
    QuadraticFeatures,
    log_densities,
    log_density_coefficients,
    precision_factors,
)
from skill.clustering.prototype_competition import competitive_memberships, log_squared_distances


def no_prior(d):
    return CovariancePrior(count=0.0, variance=1.0, floor=np.zeros(d), diagonal=False)


def random_components(seed, M=4, d=3):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(M, d, d))
    return GaussianComponents(
        rng.dirichlet(np.ones(M)), rng.normal(size=(M, d)), A @ A.transpose(0, 2, 1) + 0.1 * np.eye(d)
    )


def fit(X, **arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return CompetitiveAgglomeration(n_init=1, random_state=0).fit(X, **arguments)


# --- the products -------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**31), d=st.integers(1, 8), M=st.integers(1, 5))
@settings(max_examples=25, deadline=None)
def test_quadratic_features_give_log_densities_and_moments(seed, d, M):
    components = random_components(seed, M, d)
    rng = np.random.default_rng(seed)
    Z = rng.normal(size=(40, d))
    features = QuadraticFeatures(d)
    phi = features.transform(Z)
    direct = log_densities(Z, components.weights, components.means, precision_factors(components.covariances))
    np.testing.assert_allclose(log_density_coefficients(components, features) @ phi, direct.T, rtol=1e-8, atol=1e-8)
    W = rng.uniform(size=(M, 40))
    totals, means, covariances = features.moments(W @ phi.T)
    np.testing.assert_allclose(totals, W.sum(axis=1))
    for i in range(M):
        np.testing.assert_allclose(means[i], np.average(Z, axis=0, weights=W[i]), atol=1e-12)
        expected = np.atleast_2d(np.cov(Z.T, aweights=W[i], bias=True))
        np.testing.assert_allclose(covariances[i], expected, atol=1e-10)


def test_blocks_do_not_matter(monkeypatch):
    X, _ = separated(0, N=900, d=5)
    components = random_components(1, 4, 5)
    whole = em_step(X, components)
    monkeypatch.setattr("skill.clustering.expectation_maximization.BLOCK", 7)
    blocks = em_step(X, components)
    np.testing.assert_allclose(blocks.means, whole.means, rtol=1e-9)
    np.testing.assert_allclose(blocks.covariances, whole.covariances, rtol=1e-7, atol=1e-9)
    assert blocks.log_likelihood == pytest.approx(whole.log_likelihood, rel=1e-12)


def test_posteriors_equal_those_of_scikit_learn():
    X, _ = spheres(0)
    mixture = GaussianMixture(4, random_state=0).fit(X)
    components = components_of_partition(X, mixture.predict(X), no_prior(2))
    mixture.weights_, mixture.means_ = components.weights, components.means
    mixture.covariances_ = components.covariances
    mixture.precisions_cholesky_ = np.linalg.inv(np.linalg.cholesky(components.covariances)).transpose(0, 2, 1)
    log_density = log_densities(X, components.weights, components.means, precision_factors(components.covariances))
    posterior = np.exp(log_density - np.logaddexp.reduce(log_density, axis=1)[:, None])
    np.testing.assert_allclose(posterior, mixture.predict_proba(X), atol=1e-10)
    assert em_step(X, components).log_likelihood == pytest.approx(mixture.score(X) * len(X), rel=1e-12)


def test_likelihood_never_falls_without_competition_and_prior():
    X, _ = ellipses(1)
    rng = np.random.default_rng(0)
    components = components_of_partition(X, rng.integers(0, 5, len(X)), no_prior(2))
    values = []
    for _ in range(60):
        result = em_step(X, components)
        values.append(result.log_likelihood)
        components = updated(result, no_prior(2))
    assert np.diff(values).min() > -1e-8 * abs(values[0])


# --- the competition ----------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**31), M=st.integers(2, 6), eta=st.floats(0.0, 20.0))
@settings(max_examples=50, deadline=None)
def test_memberships_sum_to_one_and_lie_between_zero_and_one(seed, M, eta):
    rng = np.random.default_rng(seed)
    previous = rng.dirichlet(np.ones(M), size=30)
    U = competitive_memberships(rng.normal(size=(30, M)) * 30.0, previous, eta)
    np.testing.assert_allclose(U.sum(axis=1), 1.0, atol=1e-12)
    assert U.min() >= 0.0
    assert U.max() <= 1.0 + 1e-12


def test_memberships_satisfy_the_stationarity_conditions():
    # 2 u d^2 - 2 alpha N_i is the same for all clusters of a sample, the half of the printed (8) and (9) cancelling.
    rng = np.random.default_rng(0)
    d2 = rng.uniform(1.0, 4.0, (50, 3))
    previous = rng.dirichlet(np.ones(3), size=50)
    N_i = previous.sum(axis=0)
    eta = 1e-3
    U = competitive_memberships(np.log(d2), previous, eta)
    alpha = eta * np.sum(previous**2 * d2) / np.sum(N_i**2)
    multipliers = 2.0 * U * d2 - 2.0 * alpha * N_i
    np.testing.assert_allclose(multipliers - multipliers[:, :1], 0.0, atol=1e-13)


def test_membership_of_the_fmle_distance_is_the_posterior():
    components = random_components(3)
    Z = np.random.default_rng(0).normal(size=(20, 3))
    H = competitive_memberships(log_squared_distances(Z, components, "fmle"), None, 1.0)
    densities = np.stack(
        [
            P * multivariate_normal(v, F).pdf(Z)
            for P, v, F in zip(components.weights, components.means, components.covariances, strict=True)
        ],
        axis=1,
    )
    np.testing.assert_allclose(H, densities / densities.sum(axis=1, keepdims=True), atol=1e-12)


def test_gustafson_kessel_distance_has_unit_volume():
    components = random_components(2)
    Z = np.random.default_rng(1).normal(size=(5, 3))
    log_d2 = log_squared_distances(Z, components, "gk")
    F, v = components.covariances[1], components.means[1]
    offset = Z[0] - v
    expected = np.linalg.det(F) ** (1 / 3) * offset @ np.linalg.inv(F) @ offset
    assert np.exp(log_d2[0, 1]) == pytest.approx(expected)


def test_competition_takes_from_the_small_and_gives_to_the_large():
    X, _ = spheres(0)
    labels = (X[:, 0] > 60).astype(int)
    components = components_of_partition((X - X.mean(0)) / X.std(0), labels, no_prior(2))
    Z = (X - X.mean(0)) / X.std(0)
    plain = em_step(Z, components)
    biased = em_step(Z, components, eta=1.0, cardinalities=plain.cardinalities)
    large = int(np.argmax(plain.cardinalities))
    assert biased.cardinalities[large] > plain.cardinalities[large]
    assert biased.cardinalities.sum() == pytest.approx(len(Z))


def test_schedules():
    exponential = exponential_schedule(5.0, 10.0, begin=3)
    assert [exponential(k) for k in (0, 3, 13)] == pytest.approx([5.0, 5.0, 5.0 / np.e])
    ramp = ramp_schedule(5.0, 10.0, 10, 30)
    assert [ramp(k) for k in (0, 10, 29, 40)] == pytest.approx([5.0 / np.e, 5.0, 5.0, 5.0 / np.e])


def test_at_most_a_tenth_dies_at_once_and_somebody_survives():
    keep = survivors(np.arange(20.0), 15.0)
    np.testing.assert_array_equal(np.flatnonzero(~keep), [0, 1])
    assert survivors(np.array([1.0]), 10.0).all()


# --- merging and the effective sample size ------------------------------------------------------------------


def test_merging_keeps_the_moments():
    components = random_components(5)
    merged = merge_closest(components)
    assert len(merged) == 3

    def moments(c):
        mean = c.weights @ c.means
        return mean, np.einsum("m,mab->ab", c.weights, c.covariances) + (c.weights * c.means.T) @ c.means

    for a, b in zip(moments(components), moments(merged), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
    pair = merged_pair(components, np.array([0]), np.array([0]))
    np.testing.assert_allclose(pair.covariances[0], components.covariances[0])


def test_path_ends_at_the_single_gaussian():
    X, y = separated(0, N=500, d=3)
    path = merge_path(X, components_of_partition(X, y, no_prior(3)), no_prior(3))
    assert [len(mixture.components) for mixture in path] == [6, 5, 4, 3, 2, 1]
    np.testing.assert_allclose(path[-1].components.means[0], X.mean(axis=0), atol=1e-9)
    expected = multivariate_normal(X.mean(0), np.cov(X.T, bias=True)).logpdf(X).sum()
    assert path[-1].log_likelihood == pytest.approx(expected, rel=1e-9)


def test_design_effect_of_independent_and_of_repeated_samples():
    rng = np.random.default_rng(0)
    Z = rng.normal(size=(2000, 2))
    single = components_of_partition(Z, np.zeros(2000, dtype=int), no_prior(2))
    groups = np.repeat(np.arange(200), 10)
    assert design_effect(Z, single, groups) == pytest.approx(1.0, abs=0.15)
    # Ten copies of each sample count as one.
    alone = components_of_partition(Z[:200], np.zeros(200, dtype=int), no_prior(2))
    expected = 10.0 * design_effect(Z[:200], alone, np.arange(200))
    assert design_effect(np.repeat(Z[:200], 10, axis=0), alone, groups) == pytest.approx(expected, rel=1e-9)


# --- invariances --------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**31))
@settings(max_examples=5, deadline=None)
def test_units_of_the_channels_do_not_matter(seed):
    X, y = insertion(0, 900)
    groups, phase = demonstrations_and_phase(y)
    rng = np.random.default_rng(seed)
    scale, shift = np.exp(rng.uniform(-8, 8, 14)), rng.normal(size=14) * 10
    plain = fit(X, groups=groups, phase=phase)
    other = fit(X * scale + shift * scale, groups=groups, phase=phase)
    assert other.n_clusters_ == plain.n_clusters_
    assert adjusted_rand_score(plain.labels_, other.labels_) > 0.999
    np.testing.assert_allclose(other.means_, (plain.means_ + shift) * scale, rtol=1e-4, atol=1e-4 * scale.max())


@given(seed=st.integers(0, 2**31))
@settings(max_examples=5, deadline=None)
def test_order_of_samples_and_channels_does_not_matter(seed):
    X, y = insertion(0, 900)
    groups, phase = demonstrations_and_phase(y)
    rng = np.random.default_rng(seed)
    rows, channels = rng.permutation(len(X)), rng.permutation(14)
    plain = fit(X, groups=groups, phase=phase)
    other = fit(X[rows][:, channels], groups=groups[rows], phase=phase[rows])
    assert other.n_clusters_ == plain.n_clusters_
    assert adjusted_rand_score(plain.labels_[rows], other.labels_) > 0.999


def test_names_of_demonstrations_do_not_matter():
    X, y = insertion(1, 900)
    groups, phase = demonstrations_and_phase(y)
    names = np.array([f"demonstration {g * 7 % 30}" for g in groups])
    a, b = fit(X, groups=groups, phase=phase), fit(X, groups=names, phase=phase)
    np.testing.assert_array_equal(a.labels_, b.labels_)


def test_same_seed_and_any_number_of_threads_give_the_same_bits():
    X, _ = separated(0, N=1200)
    with threadpool_limits(1):
        one = CompetitiveAgglomeration(n_init=1, random_state=3).fit(X)
    with threadpool_limits(2):
        two = CompetitiveAgglomeration(n_init=1, random_state=3).fit(X)
    np.testing.assert_array_equal(one.means_, two.means_)
    np.testing.assert_array_equal(one.covariances_, two.covariances_)


@given(N=st.integers(2, 40), d=st.integers(1, 6), seed=st.integers(0, 2**31), kind=st.sampled_from(["full", "diag"]))
@settings(max_examples=30, deadline=None)
def test_any_finite_data_gives_finite_states(N, d, seed, kind):
    rng = np.random.default_rng(seed)
    X = np.round(rng.normal(size=(N, d)) * 2.0)  # many duplicates and ties
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dut = CompetitiveAgglomeration(covariance_type=kind, n_init=2, random_state=0).fit(X)
    assert 1 <= dut.n_clusters_ <= max(1, N // (2 * (d + 1)))
    assert np.isfinite(dut.covariances_).all()
    np.testing.assert_allclose(dut.predict_proba(X).sum(axis=1), 1.0)
    assert dut.weights_.sum() == pytest.approx(1.0)


def test_constant_and_repeated_channels():
    X, y = separated(0, N=900, d=4)
    dut = fit(np.column_stack([X, np.full(900, 3.7), X[:, 0]]))
    assert dut.n_clusters_ == 6
    assert adjusted_rand_score(y, dut.labels_) > 0.95
    assert fit(np.full((50, 3), 2.5)).n_clusters_ == 1


def test_forces_that_are_exactly_zero_in_free_motion():
    X, y = insertion(0)
    X[y == 0, 3:9] = 0.0
    groups, phase = demonstrations_and_phase(y)
    dut = CompetitiveAgglomeration(random_state=0).fit(X, groups=groups, phase=phase)
    assert adjusted_rand_score(y, dut.labels_) >= 0.95


# --- refusals -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"distance": "cosine"}, "distance='cosine': expected one of"),
        ({"bias": "none"}, "bias='none'"),
        ({"schedule": "linear"}, "schedule='linear'"),
        ({"covariance_type": "tied"}, "covariance_type='tied'"),
        ({"merge": "aic"}, "merge='aic'"),
        ({"init": "random"}, "init='random'"),
        ({"init": "phase"}, r"pass fit\(X, phase=...\)"),
        ({"init": np.zeros((3, 9))}, r"expected centres \(M, 2\)"),
        ({"m_init": 0}, "m_init=0: expected an integer of at least 1"),
        ({"n_init": 1.5}, "n_init=1.5"),
        ({"tau": 0.0}, "tau=0.0: expected a positive"),
        ({"reg_covar": -1.0}, "reg_covar=-1.0"),
        ({"eta0": np.inf}, "eta0=inf"),
        ({"sensor_variance": [1.0]}, "sensor_variance has shape"),
    ],
)
def test_wrong_parameters(parameters, message):
    with pytest.raises(ValueError, match=message):
        CompetitiveAgglomeration(**parameters).fit(spheres(0)[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"groups": [0, 1]}, r"groups has shape \(2,\), expected \(575,\)"),
        ({"phase": [0.5]}, r"phase has shape \(1,\)"),
        ({"phase": np.linspace(0, 2, 575)}, "divide the time since the start"),
        ({"phase": np.full(575, np.nan)}, r"expected \[0, 1\]"),
    ],
)
def test_wrong_groups_and_phase(arguments, message):
    with pytest.raises(ValueError, match=message):
        CompetitiveAgglomeration().fit(spheres(0)[0], **arguments)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_samples_that_are_not_finite(bad):
    X, _ = spheres(0)
    X[7, 1] = bad
    with pytest.raises(ValueError, match=r"NaN|infinity"):
        CompetitiveAgglomeration().fit(X)


def test_singular_covariance_names_the_remedy():
    X = np.column_stack([np.arange(100.0), np.arange(100.0)])
    with pytest.raises(ValueError, match="raise reg_covar"):
        CompetitiveAgglomeration(reg_covar=0.0, shrinkage=0.0).fit(X)


@pytest.mark.parametrize("channels", [[0, 0], [2], [-1], [], [0.5], [[0]]])
def test_wrong_channels(channels):
    dut = fit(spheres(0)[0])
    with pytest.raises(ValueError, match="expected different indices between 0 and 1"):
        dut.predict_proba(np.zeros((1, 1)), channels=channels)


def test_wrong_number_of_columns_and_gate():
    dut = fit(spheres(0)[0])
    with pytest.raises(ValueError, match="X has 2 columns, expected 1"):
        dut.predict(np.zeros((1, 2)), channels=[0])
    with pytest.raises(ValueError, match=r"gate=2.0: expected a probability"):
        dut.predict(np.zeros((1, 2)), gate=2.0)
