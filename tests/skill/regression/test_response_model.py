"""The local regression of responses, against formulas worked out with loops."""

import numpy as np

from skill.regression.response_model import PRIOR_SAMPLES, ResponseModel, ResponseSamples


def test_coefficients_are_those_of_a_weighted_ridge_regression():
    rng = np.random.default_rng(0)
    samples = ResponseSamples(rng.normal(size=(40, 3)), rng.normal(size=(40, 2)), rng.normal(size=(40, 4)))
    w = rng.uniform(size=(2, 40))
    A = np.column_stack([np.ones(40), samples.U])
    found = ResponseModel(samples).coefficients(w)
    for weights, B in zip(w, found, strict=True):
        M = A.T @ np.diag(weights) @ A + PRIOR_SAMPLES * np.eye(3)
        np.testing.assert_allclose(B, np.linalg.inv(M) @ A.T @ np.diag(weights) @ samples.Y, rtol=1e-9)


def test_far_from_all_samples_the_prediction_is_zero():
    samples = ResponseSamples(np.ones((3, 1)), np.ones((3, 2)), np.ones((3, 4)))
    np.testing.assert_array_equal(ResponseModel(samples).coefficients(np.zeros((1, 3))), np.zeros((1, 3, 4)))
