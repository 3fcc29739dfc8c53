"""Gaussian mixture regression, and the choice of a mixture by the Bayesian information criterion (BIC).

Gaussian mixture regression predicts outputs by conditioning the Gaussians of the joint distribution on the inputs.

With means m, covariances C split into inputs x and outputs y, and weights p, component k predicts the mean

    y_k(x) = m_y + C_yx C_xx^-1 (x - m_x),

and the mixture weighs the components by h_k(x) ~ p_k N(x | m_x, C_xx). The Gaussians may come from any clustering.

Source: Ghahramani and Jordan, "Supervised learning from incomplete data via an EM approach", NIPS 6, 1994.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import LinAlgError, cholesky, solve_triangular
from scipy.special import logsumexp
from sklearn.mixture import GaussianMixture

from skill.arrays import Array

MAX_QUERY = 1e100
"""Queries are clipped to this magnitude, so that their squared distances stay finite."""


def best_mixture(Z: ArrayLike, max_components: int, **settings: Any) -> GaussianMixture:
    """The Gaussian mixture with the smallest BIC among those with 1 to ``max_components`` components.

    Args:
        Z: (N, d), samples.
        max_components: largest number of components.
        **settings: further arguments of ``GaussianMixture``.
    """
    mixtures = [GaussianMixture(k, **settings).fit(Z) for k in range(1, max_components + 1)]
    return min(mixtures, key=lambda mixture: mixture.bic(Z))


def gmr_predict(
    means: ArrayLike,
    covariances: ArrayLike,
    weights: ArrayLike,
    X: ArrayLike,
    input_channels: ArrayLike,
    output_channels: ArrayLike,
) -> Array:
    """Conditional mean of the output channels.

    Args:
        means: (M, d), means of the Gaussians.
        covariances: (M, d, d), positive definite on the input channels.
        weights: (M,), non-negative, not all zero.
        X: (n, a), values of the input channels.
        input_channels: (a,), the channels of ``X``, as indices into d.
        output_channels: (b,), the channels to predict.

    Returns:
        The conditional mean, (n, b).

    Raises:
        ValueError: if a covariance is not positive definite.
    """
    m, C = np.asarray(means, dtype=float), np.asarray(covariances, dtype=float)
    p, queries = np.asarray(weights, dtype=float), np.asarray(X, dtype=float).clip(-MAX_QUERY, MAX_QUERY)
    a, b = np.asarray(input_channels, dtype=np.intp), np.asarray(output_channels, dtype=np.intp)
    log_h, y = np.empty((len(queries), len(m))), np.empty((len(queries), len(m), len(b)))
    for k in range(len(m)):
        try:
            L = cholesky(C[k][np.ix_(a, a)], lower=True)
        except LinAlgError:
            raise ValueError(
                f"covariance {k} is not positive definite on the input channels;"
                " fit the Gaussians with a greater covariance floor"
            ) from None
        whitened = solve_triangular(L, (queries - m[k, a]).T, lower=True)
        y[:, k] = m[k, b] + whitened.T @ solve_triangular(L, C[k][np.ix_(a, b)], lower=True)
        with np.errstate(divide="ignore"):  # a component of weight zero has no effect
            log_h[:, k] = np.log(p[k]) - np.log(np.diag(L)).sum() - 0.5 * (whitened**2).sum(axis=0)
    h = np.exp(log_h - logsumexp(log_h, axis=1, keepdims=True))
    return np.asarray(np.einsum("nk,nkb->nb", h, y))
