import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from benchmarks.rig.gaussian_mixture_regression import best_mixture, gmr_predict


def mixture(seed=0, M=3, d=4):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(M, d, d))
    return rng.normal(size=(M, d)) * 2, A @ A.transpose(0, 2, 1) + 0.2 * np.eye(d), rng.dirichlet(np.ones(M))


def test_one_gaussian_is_linear_regression():
    means, covariances, _ = mixture(M=1)
    X = np.random.default_rng(1).normal(size=(10, 2))
    gain = covariances[0][np.ix_([3, 1], [0, 2])] @ np.linalg.inv(covariances[0][np.ix_([0, 2], [0, 2])])
    expected = means[0, [3, 1]] + (X - means[0, [0, 2]]) @ gain.T
    np.testing.assert_allclose(gmr_predict(means, covariances, [1.0], X, [0, 2], [3, 1]), expected)


@settings(max_examples=20)
@given(st.integers(0, 1000))
def test_the_mean_is_that_of_the_conditional_density(seed):
    means, covariances, weights = mixture(seed, d=2)
    x = means[0, 0] + 0.3
    grid = np.linspace(means[:, 1].min() - 40, means[:, 1].max() + 40, 40001)
    points = np.column_stack([np.full_like(grid, x), grid])
    density = sum(
        w * multivariate_normal(m, C).pdf(points) for m, C, w in zip(means, covariances, weights, strict=True)
    )
    density /= density.sum()
    mean = gmr_predict(means, covariances, weights, [[x]], [0], [1])
    np.testing.assert_allclose(mean[0, 0], density @ grid, atol=1e-6)


def test_the_prediction_for_a_distant_query_is_finite():
    means, covariances, weights = mixture()
    for far in (1e3, 1e6, 1e9, 1e200):
        assert np.isfinite(gmr_predict(means, covariances, weights, [[far, -far]], [0, 1], [2, 3])).all()


def test_a_covariance_that_is_not_positive_definite_is_named():
    means, _, weights = mixture()
    with pytest.raises(ValueError, match="covariance 0 is not positive definite"):
        gmr_predict(means, np.zeros((3, 4, 4)), weights, np.zeros((2, 2)), [0, 1], [2])


def test_the_mixture_of_smallest_bic_has_the_true_number_of_components():
    rng = np.random.default_rng(0)
    X = np.vstack([rng.normal(size=(100, 2)) + centre for centre in ([0, 0], [20, 0], [0, 20])])
    best = best_mixture(X, 6, random_state=0)
    assert best.n_components == 3
    assert best_mixture(X, 2, random_state=0).n_components == 2
