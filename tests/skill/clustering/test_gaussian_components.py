import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from skill.clustering.gaussian_components import (
    QuadraticFeatures,
    cholesky_factors,
    distance_gate,
    log_density_coefficients,
    log_normalizers,
    precision_factors,
    score_variances,
    squared_mahalanobis,
    tail_weights,
    tailed_log_densities,
)
from tests.skill.clustering.components import densities, random_components, student_samples

NU = 4.0


@given(seed=st.integers(0, 2**31), d=st.integers(1, 8), M=st.integers(1, 5))
def test_quadratic_features_give_log_densities_and_moments(seed, d, M):
    components = random_components(seed, M, d)
    rng = np.random.default_rng(seed)
    Z = rng.normal(size=(40, d))
    features = QuadraticFeatures(d)
    phi = features.transform(Z)
    direct = np.log(densities(Z, components))
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


def test_rescaled_components_have_the_units_of_the_samples():
    shift, scale = np.array([5.0, 0.0, -2.0]), np.array([1.0, 10.0, 0.1])
    components = random_components(0)
    found = components.rescaled(shift, scale)
    order = np.argsort(components.weights)[::-1]
    np.testing.assert_array_equal(found.weights, components.weights[order])
    np.testing.assert_allclose(found.means, shift + scale * components.means[order])
    S = np.diag(scale)
    np.testing.assert_allclose(found.covariances, S @ components.covariances[order] @ S)


@pytest.mark.parametrize("degrees", [1.0, 4.0, np.inf])
def test_densities_are_those_of_scipy(degrees):
    components = random_components(0, M=3, d=4, degrees=degrees)
    X = np.random.default_rng(1).normal(scale=4.0, size=(20, 4))
    factors = precision_factors(components.covariances)
    squared = squared_mahalanobis(X, components.means, factors)
    found = tailed_log_densities(log_normalizers(components.weights, factors), squared, 4, degrees)
    np.testing.assert_allclose(found, np.log(densities(X, components)), rtol=1e-10)


def test_gate_worked_by_hand():
    # In two channels, P(q > x) = (1 + x / nu)^(-nu / 2).
    assert distance_gate(0.99, 2, NU) == pytest.approx(NU * (0.01 ** (-2.0 / NU) - 1.0))
    assert distance_gate(0.99, 3) == pytest.approx(chi2.ppf(0.99, 3))
    for probability in (0.0, 1.0):
        with pytest.raises(ValueError, match="expected a probability between 0 and 1"):
            distance_gate(probability, 3)


def test_weights_worked_by_hand():
    np.testing.assert_allclose(tail_weights(np.array([0.0, 3.0, 60.0]), 3, NU), [7 / 4, 1.0, 7 / 64])


@pytest.mark.parametrize("d", [1, 3])
def test_variances_of_the_scores(d):
    y = student_samples(7, 400_000, np.zeros(d), np.eye(d), NU).reshape(-1, d)
    w = tail_weights((y**2).sum(axis=1), d, NU)
    usual, of_diagonal = score_variances(d, NU)
    assert (w * y[:, 0]).var() == pytest.approx(usual, rel=0.01)
    assert (w * y[:, 0] ** 2).var() / 2.0 == pytest.approx(of_diagonal, rel=0.01)
    if d > 1:
        assert (w * y[:, 0] * y[:, 1]).var() == pytest.approx(usual, rel=0.01)
    assert score_variances(d, np.inf) == (1.0, 1.0)
