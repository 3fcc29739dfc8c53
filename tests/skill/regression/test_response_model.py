"""The local regression of responses, against formulas worked out with loops."""

import math

import numpy as np
import pytest
from scipy import stats

from skill.regression.response_model import PRIOR_SAMPLES, TAIL, ResponseModel, ResponseSamples, log_density


@pytest.fixture(scope="module")
def samples():
    rng = np.random.default_rng(0)
    return ResponseSamples(rng.normal(size=(40, 3)), rng.normal(size=(40, 2)), rng.normal(size=(40, 4)))


def test_the_kernel_is_gaussian_in_the_distance(samples):
    queries = np.random.default_rng(1).normal(size=(5, 3))
    expected = [[math.exp(-sum((q - x) ** 2) / (2 * 0.7**2)) for x in samples.X] for q in queries]
    np.testing.assert_allclose(samples.kernel(queries, 0.7), expected, rtol=1e-10)


def test_errors_and_variances_are_those_of_a_weighted_ridge_regression(samples):
    rng = np.random.default_rng(2)
    w, u, y = rng.uniform(size=40), rng.normal(size=2), rng.normal(size=4)
    A = np.column_stack([np.ones(40), samples.U])
    M = A.T @ np.diag(w) @ A + PRIOR_SAMPLES * np.eye(3)
    B = np.linalg.inv(M) @ A.T @ np.diag(w) @ samples.Y
    a = np.array([1.0, *u])
    residual = samples.Y - A @ B
    spread = ((w[:, None] * residual**2).sum(axis=0) + PRIOR_SAMPLES) / (w.sum() + PRIOR_SAMPLES)
    errors, variances = ResponseModel(samples).residuals(w[None], u[None], y[None])
    np.testing.assert_allclose(errors[0], y - a @ B, rtol=1e-10)
    np.testing.assert_allclose(variances[0], spread * (1 + a @ np.linalg.inv(M) @ a), rtol=1e-10)


def test_coefficients_are_those_of_a_weighted_ridge_regression(samples):
    w = np.random.default_rng(2).uniform(size=(2, 40))
    A = np.column_stack([np.ones(40), samples.U])
    found = ResponseModel(samples).coefficients(w)
    for weights, B in zip(w, found, strict=True):
        M = A.T @ np.diag(weights) @ A + PRIOR_SAMPLES * np.eye(3)
        np.testing.assert_allclose(B, np.linalg.inv(M) @ A.T @ np.diag(weights) @ samples.Y, rtol=1e-9)


def test_far_from_all_samples_the_prediction_is_the_mean_with_the_spread_of_all(samples):
    u, y = np.array([[0.3, -2.0]]), np.ones((1, 4))
    errors, variances = ResponseModel(samples).residuals(np.zeros((1, 40)), u, y)
    np.testing.assert_allclose(errors, y)
    np.testing.assert_allclose(variances, 1 + (1 + 0.3**2 + 2.0**2) / PRIOR_SAMPLES)


def test_a_law_with_many_samples_is_recovered():
    rng = np.random.default_rng(3)
    U = rng.normal(size=(2000, 2))
    Y = (1.0 + U @ [2.0, -3.0] + 0.1 * rng.normal(size=2000))[:, None]
    model = ResponseModel(ResponseSamples(np.zeros((2000, 1)), U, Y))
    errors, variances = model.residuals(np.ones((1, 2000)), np.array([[1.0, 1.0]]), np.zeros((1, 1)))
    assert errors[0, 0] == pytest.approx(-(1.0 + 2.0 - 3.0), abs=0.02)
    assert math.sqrt(variances[0, 0]) == pytest.approx(0.1, abs=0.02)


def test_the_density_is_that_of_a_student_t_distribution():
    errors, scale = np.linspace(-5, 5, 11), 1.7
    expected = stats.t.logpdf(errors, TAIL, scale=scale)
    found = log_density(errors, np.full(11, scale**2))
    np.testing.assert_allclose(found - found[0], expected - expected[0], rtol=1e-12)
