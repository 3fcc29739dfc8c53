import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from skill.clustering.gaussian_components import (
    QuadraticFeatures,
    cholesky_factors,
    log_densities,
    log_density_coefficients,
    log_normalizers,
    parameters_per_component,
    precision_factors,
    shrunk_covariances,
    squared_mahalanobis,
)
from tests.skill.clustering.components import random_components


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


def test_features_of_one_sample():
    features = QuadraticFeatures(2)
    np.testing.assert_array_equal(features.transform(np.array([[2.0, 3.0]]))[:, 0], [1, 2, 3, 4, 6, 9])
    assert features.size == 6
    C = features.coefficients(np.array([[[1.0, 2.0], [2.0, 5.0]]]), np.array([[7.0, 8.0]]), np.array([9.0]))
    np.testing.assert_array_equal(C, [[9, 7, 8, 1, 4, 5]])


def test_features_are_written_into_the_buffer():
    features = QuadraticFeatures(2)
    Z = np.random.default_rng(0).normal(size=(3, 2))
    buffer = np.full((features.size, 5), np.nan)
    phi = features.transform(Z, out=buffer)
    assert np.shares_memory(phi, buffer)
    assert np.isnan(buffer[:, 3:]).all()
    np.testing.assert_array_equal(phi, features.transform(Z))


def test_moments_without_weight_are_zero():
    totals, means, covariances = QuadraticFeatures(2).moments(np.zeros((1, 6)))
    assert totals[0] == 0.0
    assert not means.any()
    assert not covariances.any()


def test_log_densities_against_scipy():
    components = random_components(1)
    Z = np.random.default_rng(2).normal(size=(10, 3))
    factors = precision_factors(components.covariances)
    found = log_densities(Z, components.weights, components.means, factors)
    for i in range(4):
        gaussian = multivariate_normal(components.means[i], components.covariances[i])
        np.testing.assert_allclose(found[:, i], np.log(components.weights[i]) + gaussian.logpdf(Z))


def test_factors_and_squared_distances():
    components = random_components(3)
    R = precision_factors(components.covariances)
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.linalg.inv(components.covariances))
    np.testing.assert_array_equal(R, np.triu(R))
    L = cholesky_factors(components.covariances)
    np.testing.assert_allclose(L @ L.transpose(0, 2, 1), components.covariances)
    z = np.array([[0.3, -1.0, 2.0]])
    offset = z[0] - components.means[2]
    expected = offset @ np.linalg.inv(components.covariances[2]) @ offset
    assert squared_mahalanobis(z, components.means, R)[0, 2] == pytest.approx(expected)


def test_zero_weight_has_no_density():
    assert log_normalizers(np.array([0.0, 1.0]), np.ones((2, 1, 1)))[0] == -np.inf


def test_singular_covariance_is_reported_with_its_smallest_eigenvalue():
    with pytest.raises(ValueError, match=r"smallest eigenvalue -1\).*raise reg_covar"):
        precision_factors(np.array([np.eye(2), [[1.0, 2.0], [2.0, 1.0]]]))


def test_shrunk_covariances_worked_by_hand():
    covariances = np.array([[[4.0, 1.0], [1.0, 2.0]]])
    arguments = {"prior_count": 3.0, "prior_variance": 0.5, "floor": np.array([0.1, 0.2])}
    # (5 F + 3 * 0.5 I) / 8 + diag(0.1, 0.2)
    expected = [[21.5 / 8 + 0.1, 5 / 8], [5 / 8, 11.5 / 8 + 0.2]]
    full = shrunk_covariances(covariances, np.array([5.0]), diagonal=False, **arguments)
    np.testing.assert_allclose(full[0], expected)
    diagonal = shrunk_covariances(covariances, np.array([5.0]), diagonal=True, **arguments)
    np.testing.assert_allclose(diagonal[0], np.diag(np.diag(expected)))


def test_shrunk_covariance_without_samples_and_prior_is_the_floor():
    shrunk = shrunk_covariances(
        np.zeros((1, 2, 2)),
        np.zeros(1),
        prior_count=0.0,
        prior_variance=1.0,
        floor=np.array([1.0, 2.0]),
        diagonal=False,
    )
    np.testing.assert_array_equal(shrunk[0], np.diag([1.0, 2.0]))


def test_numbers_of_parameters():
    assert parameters_per_component(3, diagonal=False) == 3 + 6
    assert parameters_per_component(3, diagonal=True) == 3 + 3
