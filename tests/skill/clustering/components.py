"""Gaussian components and priors for the tests of this folder."""

import numpy as np
from scipy.stats import multivariate_t

from skill.clustering.expectation_maximization import CovariancePrior
from skill.clustering.gaussian_components import GaussianComponents


def no_prior(d):
    """A prior that leaves covariances unchanged."""
    return CovariancePrior(count=0.0, variance=1.0, floor=np.zeros(d))


def random_components(seed, M=4, d=3, degrees=np.inf):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(M, d, d))
    return GaussianComponents(
        rng.dirichlet(np.ones(M)), rng.normal(size=(M, d)), A @ A.transpose(0, 2, 1) + 0.1 * np.eye(d), degrees
    )


def spherical(weights, means, variances=None):
    """Spherical components with the given means (M, d) and variances (M,), one by default."""
    means = np.asarray(means, dtype=float)
    variances = np.ones(len(means)) if variances is None else np.asarray(variances, dtype=float)
    return GaussianComponents(
        np.asarray(weights, dtype=float), means, variances[:, None, None] * np.eye(means.shape[1])
    )


def densities(Z, components):
    """P_i p(z_j | v_i, F_i) of Gaussians or Student distributions, shape (N, M)."""
    columns = []
    for P, v, F in zip(components.weights, components.means, components.covariances, strict=True):
        columns.append(P * np.atleast_1d(multivariate_t(v, F, df=components.degrees).pdf(Z)))
    return np.stack(columns, axis=1)


def weighted_moments(Z, W):
    """Means (M, d) and covariances (M, d, d) of samples with weights W (N, M)."""
    means = np.stack([np.average(Z, axis=0, weights=w) for w in W.T])
    covariances = np.stack([np.atleast_2d(np.cov(Z.T, aweights=w, bias=True)) for w in W.T])
    return means, covariances


def student_samples(seed, n, v, F, degrees):
    return multivariate_t(v, F, df=degrees, seed=np.random.default_rng(seed)).rvs(n)
