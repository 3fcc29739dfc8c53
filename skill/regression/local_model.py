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

from compiled import compiled, compiled_within
from skill.arrays import Array, assign
from skill.regression.neighbourhood import RegressionNumbers, neighbourhood
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

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Bounds, each (m, p), for a new observation, by Student's t with the residual degrees of freedom.

        Args:
            level: nominal coverage.

        Raises:
            ValueError: if ``level`` is not within (0, 1).
        """
        if not 0.0 < level < 1.0:
            raise ValueError(f"level = {level}; expected a probability between 0 and 1, such as 0.95")
        half = stdtrit(self.freedom, 0.5 * (1.0 + level))[:, None] * self.standard_deviation()
        return self.mean - half, self.mean + half


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
        assign(a[:, 0], solve_least_norm(scatter, mean - query))
    for i in range(k):
        along = 0.0
        for j in range(d):
            along += (x[i, j] - mean[j]) * a[j, 0]
        kernel[i] -= weights[i] * along
    return kernel


@compiled_within
def scaled_weights(log_w: Array, ridge: float) -> tuple[Array, float, float]:
    """Divides weights and ridge by the greatest weight.

    Args:
        log_w: (k,), logarithms of the weights.
        ridge: penalty of the slope.

    Returns:
        The divided weights (k,), the logarithm of the greatest weight, and the divided ridge.
    """
    greatest = log_w.max()
    return np.exp(log_w - greatest), greatest, ridge * math.exp(min(-greatest, MAX_EXPONENT))


@compiled_within
def weighted_output(kernel: Array, y: Array, rows: NDArray[np.intp]) -> Array:
    """Returns the prediction (p,) of an equivalent kernel (k,) over rows (k,) of outputs (n, p)."""
    found = np.zeros(y.shape[1])
    for i in range(len(rows)):
        for j in range(len(found)):
            found[j] += kernel[i] * y[rows[i], j]
    return found


@compiled_within
def local_model(p: RegressionNumbers, query: Array, q: Array) -> tuple[NDArray[np.intp], Array, Array, float, float]:
    """Returns rows, weights and equivalent kernel (k,) of the samples at one query, the ridge and the log weight.

    Weights and ridge are divided by the greatest weight, whose logarithm is the last value; see `local_prediction`.
    """
    rows, log_w = neighbourhood(p, query, q)
    weights, log_w_max, ridge = scaled_weights(log_w, p.ridge)
    kernel = equivalent_kernel(query, p.search.points[rows], weights, ridge, p.degree)
    return rows, weights, kernel, ridge, log_w_max


@compiled_within
def local_prediction(p: RegressionNumbers, query: Array, q: Array) -> tuple[Array, NDArray[np.intp], Array, float]:
    """Returns the prediction (p,) at one query, and rows (k,), weights (k,) and greatest log weight of its samples.

    Args:
        p: the regression.
        query: (d,), scaled features.
        q: (K,), contact-state probabilities of the query.
    """
    rows, weights, kernel, _, log_w_max = local_model(p, query, q)
    return weighted_output(kernel, p.y, rows), rows, weights, log_w_max


@compiled
def local_predictions(p: RegressionNumbers, queries: Array, Q: Array) -> tuple[Array, Array]:
    """Returns predictions (m, p) and greatest log weights (m,) at queries (m, d) with probabilities (m, K)."""
    predicted, support = np.empty((len(queries), p.y.shape[1])), np.empty(len(queries))
    for i in range(len(queries)):
        predicted[i], _, _, support[i] = local_prediction(p, queries[i], Q[i])
    return predicted, support


def predictions_with_uncertainty(p: RegressionNumbers, queries: Array, Q: Array) -> LocalPrediction:
    """Returns predictions at queries (m, d) with probabilities (m, K), and their uncertainty.

    The variance is sum_i w_i r_i^2 / (n - p), with the residuals r about the local model and
    p = sum_i w_i^2 z_i' A^-1 z_i, z = [1, c], A = diag(n, S). With less than one residual degree of freedom the
    residuals do not determine the noise. The overall variance of the outputs then fills the missing part of this one
    degree. An isolated sample thus has a wide interval, not an empty one.
    """
    found = [_with_uncertainty(p, query, q) for query, q in zip(queries, Q, strict=True)]
    return LocalPrediction(*(np.array(values) for values in zip(*found, strict=True)))


def _with_uncertainty(p: RegressionNumbers, query: Array, q: Array) -> tuple[Array | float, ...]:
    """Returns the attributes of `LocalPrediction` at one query."""
    rows, weights, kernel, ridge, log_w_max = local_model(p, query, q)
    x, y = p.search.points[rows], p.y[rows]
    total = weights.sum()
    normalised = weights / total
    centred = x - normalised @ x
    weighted = centred * weights[:, None]
    # Directions in which the samples vary by rounding errors only must not have a slope.
    rounding = 10 * x.shape[1] * np.finfo(float).eps
    inverse = p.degree * np.linalg.pinv(weighted.T @ centred + ridge * np.eye(x.shape[1]), rounding, hermitian=True)
    residual = y - normalised @ y
    residual -= centred @ (inverse @ (weighted.T @ residual))
    left = total - weights @ normalised - np.einsum("kd,de,ke->", weighted, inverse, weighted)
    missing = max(0.0, 1.0 - left)
    freedom = max(left, 0.0) + missing
    variance = (weights @ residual**2 + missing * p.y.var(axis=0)) / freedom
    return weighted_output(kernel, p.y, rows), variance, kernel @ kernel, freedom, total, log_w_max
