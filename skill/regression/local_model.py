"""One weighted linear model around each query: the numerical core of locally weighted regression.

With samples x_i, outputs y_i and kernel weights w_i around a query q, the local model minimises

    sum_i w_i |y_i - b - B'(x_i - q)|^2 + ridge |B|^2,

and predicts b. The ridge does not penalise b. Two rewritings keep the minimiser and make the computation robust:

* Weights are given as logarithms and divided by the greatest, w_max, and so is the ridge. For any query some weight is
  then 1 and nothing underflows. As ridge / w_max grows, the slope B vanishes: far from all samples the prediction
  becomes the kernel mean instead of an extrapolation.
* The design is centred on the weighted mean m of the samples, not on q. With c_i = x_i - m, S = sum_i w_i c_i c_i' +
  ridge I, n = sum_i w_i and S a = m - q, the prediction is sum_i l_i y_i with the equivalent kernel
  l_i = w_i (1 / n - a'c_i). This needs one small linear system for any number of outputs.

Sources: Atkeson, Moore, Schaal, "Locally weighted learning", Artificial Intelligence Review 11, 1997. Cleveland,
Devlin, "Locally weighted regression", JASA 83, 1988, for the equivalent kernel and the degrees of freedom.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from compiled import compiled
from skill.arrays import Array
from skill.regression.positive_systems import solve_least_norm, solve_positive

MAX_EXPONENT = 690.0
"""exp(690) is near the largest double; slopes are zero to rounding well below it."""


@dataclass(frozen=True)
class LocalPrediction:
    """Predictions with their uncertainty and support.

    Attributes:
        mean: (m, p), the predictions.
        variance: (m, p), variance of the outputs about the local model.
        leverage: (m,), sum of the squared equivalent kernel; the variance of the mean is leverage times ``variance``.
        freedom: (m,), residual degrees of freedom.
        support: (m,), effective number of samples: the sum of the weights, each divided by the greatest.
        log_w_max: (m,), logarithm of the greatest weight: zero at a sample, very negative far from all samples.
    """

    mean: Array
    variance: Array
    leverage: Array
    freedom: Array
    support: Array
    log_w_max: Array

    def standard_deviation(self) -> Array:
        """Standard deviation of a new observation at the query, (m, p)."""
        return np.sqrt(self.variance * (1.0 + self.leverage[:, None]))

    def interval(self, level: float = 0.95, kind: str = "prediction") -> tuple[Array, Array]:
        """Interval from Student's t distribution with the residual degrees of freedom.

        Args:
            level: nominal coverage.
            kind: "prediction" for a new observation, or "variance_only" for the mean. The latter ignores the bias of
                smoothing; its actual coverage is therefore below ``level``.

        Returns:
            Lower and upper bounds, each (m, p).

        Raises:
            ValueError: if ``level`` is not within (0, 1) or ``kind`` is unknown.
        """
        if not 0.0 < level < 1.0:
            raise ValueError(f"level = {level}; expected a probability between 0 and 1, such as 0.95")
        if kind not in ("prediction", "variance_only"):
            raise ValueError(f"kind = {kind!r}; expected 'prediction' or 'variance_only'")
        factor = self.leverage + (1.0 if kind == "prediction" else 0.0)
        t = stdtrit(self.freedom, 0.5 * (1.0 + level))
        half = t[:, None] * np.sqrt(self.variance * factor[:, None])
        return self.mean - half, self.mean + half


def normalised_weights(log_w: Array, ridge: float) -> tuple[Array, Array, Array]:
    """Divides weights and ridge by the greatest weight of each query.

    Args:
        log_w: (..., k), logarithms of the weights.
        ridge: penalty of the slope.

    Returns:
        The divided weights (..., k), the logarithm of the greatest weight (...), and the divided ridge (...).
    """
    log_w_max: Array = log_w.max(axis=-1)
    weights: Array = np.exp(log_w - log_w_max[..., None])
    scaled_ridge = ridge * np.exp(np.minimum(-log_w_max, MAX_EXPONENT))
    return weights, log_w_max, np.asarray(scaled_ridge, dtype=np.float64)


@compiled
def equivalent_kernel(query: Array, x: Array, weights: Array, ridge: float, degree: int) -> Array:
    """Coefficients l (k,) of the prediction l'y at one query.

    Args:
        query: (d,).
        x: (k, d), the neighbours.
        weights: (k,), divided by the greatest weight.
        ridge: penalty of the slope, divided by the greatest weight.
        degree: 0 for the kernel mean, 1 for the local linear model.
    """
    k, d = x.shape
    kernel: Array = weights / weights.sum()
    if degree == 0:
        return kernel
    mean, scatter, a = np.zeros(d), np.zeros((d, d)), np.empty((d, 1))
    for i in range(k):
        for j in range(d):
            mean[j] += kernel[i] * x[i, j]
    centred = np.empty(d)
    for i in range(k):
        for j in range(d):
            centred[j] = x[i, j] - mean[j]
            for m in range(j + 1):
                scatter[j, m] += weights[i] * centred[j] * centred[m]
    for j in range(d):
        scatter[j, j] += ridge
        a[j, 0] = mean[j] - query[j]
        for m in range(j):
            scatter[m, j] = scatter[j, m]
    if not (ridge > 0.0 and solve_positive(scatter.copy(), a)):
        a[:, 0] = solve_least_norm(scatter, mean - query)
    for i in range(k):
        along = 0.0
        for j in range(d):
            along += (x[i, j] - mean[j]) * a[j, 0]
        kernel[i] -= weights[i] * along
    return kernel


@compiled
def scaled_weights(log_w: Array, ridge: float) -> tuple[Array, float, float]:
    """Returns what `normalised_weights` does for one query: weights (k,), greatest logarithm, and divided ridge."""
    greatest = log_w.max()
    return np.exp(log_w - greatest), greatest, ridge * math.exp(min(-greatest, MAX_EXPONENT))


@compiled
def weighted_output(kernel: Array, y: Array, rows: NDArray[np.intp]) -> Array:
    """Returns the prediction (p,) of an equivalent kernel (k,) over rows (k,) of outputs (n, p)."""
    found = np.zeros(y.shape[1])
    for i in range(len(rows)):
        for j in range(len(found)):
            found[j] += kernel[i] * y[rows[i], j]
    return found


def equivalent_kernels(queries: Array, x: Array, weights: Array, ridge: Array, degree: int) -> Array:
    """Equivalent kernels (m, k) of many queries; see `equivalent_kernel`.

    Args:
        queries: (m, d).
        x: (m, k, d), the neighbours of each query.
        weights: (m, k), divided by the greatest weight of each query.
        ridge: (m,), likewise divided.
        degree: 0 or 1.
    """
    normalised: Array = weights / weights.sum(axis=1, keepdims=True)
    if degree == 0:
        return normalised
    mean, weighted, scatter = _scatter(x, weights, normalised, ridge)
    a = _solve(scatter, (mean - queries)[:, :, None], ridge)
    kernel: Array = normalised - (weighted @ a)[:, :, 0]
    return kernel


def local_predictions(
    queries: Array, x: Array, y: Array, log_w: Array, ridge: float, degree: int, marginal_variance: Array
) -> LocalPrediction:
    """Predictions with their uncertainty.

    The variance is sum_i w_i r_i^2 / (n - p), with the residuals r about the local model and
    p = sum_i w_i^2 z_i' A^-1 z_i, z = [1, c], A = diag(n, S). With less than one residual degree of freedom the
    residuals do not determine the noise. The overall variance of the outputs then fills the missing part of this one
    degree. An isolated sample thus has a wide interval, not an empty one.

    Args:
        queries: (m, d).
        x: (m, k, d), the neighbours of each query.
        y: (m, k, p), their outputs.
        log_w: (m, k), logarithms of their kernel weights.
        ridge: penalty of the squared slope, in the units of x.
        degree: 0 or 1.
        marginal_variance: (p,), overall variance of the outputs.
    """
    weights, log_w_max, scaled_ridge = normalised_weights(log_w, ridge)
    total = weights.sum(axis=1)
    normalised = weights / total[:, None]
    y_mean = np.einsum("mk,mkp->mp", normalised, y)
    residual = y - y_mean[:, None, :]
    if degree == 0:
        kernel, mean = normalised, y_mean
        used = np.einsum("mk,mk->m", weights, normalised)
    else:
        m, _, d = x.shape
        x_mean, weighted, scatter = _scatter(x, weights, normalised, scaled_ridge)
        inverse = _solve(scatter, np.broadcast_to(np.eye(d), (m, d, d)), scaled_ridge)
        slope = inverse @ (weighted.transpose(0, 2, 1) @ residual)
        residual = residual - (x - x_mean[:, None, :]) @ slope
        a = inverse @ (x_mean - queries)[:, :, None]
        kernel = normalised - (weighted @ a)[:, :, 0]
        mean = np.einsum("mk,mkp->mp", kernel, y)
        used = np.einsum("mk,mk->m", weights, normalised)
        used += np.einsum("mkd,mkd->m", weighted @ inverse, weighted)
    left = total - used
    missing = np.maximum(0.0, 1.0 - left)
    squares = np.einsum("mk,mkp->mp", weights, residual**2)
    freedom = np.maximum(left, 0.0) + missing
    variance = (squares + missing[:, None] * marginal_variance) / freedom[:, None]
    return LocalPrediction(
        mean=mean,
        variance=variance,
        leverage=np.einsum("mk,mk->m", kernel, kernel),
        freedom=freedom,
        support=total,
        log_w_max=log_w_max,
    )


def _scatter(x: Array, weights: Array, normalised: Array, ridge: Array) -> tuple[Array, Array, Array]:
    """Weighted mean (m, d), weighted centred samples (m, k, d), and their scatter plus ridge (m, d, d)."""
    mean = (normalised[:, None, :] @ x)[:, 0, :]
    centred = x - mean[:, None, :]
    weighted = centred * weights[:, :, None]
    scatter = weighted.transpose(0, 2, 1) @ centred
    d = x.shape[2]
    scatter.reshape(len(x), d * d)[:, :: d + 1] += ridge[:, None]
    return mean, weighted, scatter


def _solve(matrices: Array, right: Array, ridge: Array) -> Array:
    """Solutions of m linear systems (m, d, d); those of minimum norm where a ridge is zero or too small."""
    if (ridge > 0).all():
        try:
            return np.asarray(np.linalg.solve(matrices, right), dtype=np.float64)
        except np.linalg.LinAlgError:  # a ridge below rounding error, relative to the scatter
            pass
    return _min_norm_solution(matrices, right)


def _min_norm_solution(matrices: Array, right: Array) -> Array:
    # Directions in which the samples vary by rounding errors only must not have a slope.
    tolerance = 10 * matrices.shape[1] * np.finfo(float).eps
    inverse = np.linalg.pinv(matrices, rcond=tolerance, hermitian=True)
    return np.asarray(inverse @ right, dtype=np.float64)
