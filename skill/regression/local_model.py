"""One weighted linear model around each query: the numerical core of locally weighted regression.

With samples x_i, outputs y_i and kernel weights w_i around a query q, the local model minimises

    sum_i w_i |y_i - b - B'(x_i - q)|^2 + ridge |B|^2,

and predicts b. The ridge does not penalise b. Two rewritings leave the minimiser as it is and make it safe:

* Weights enter as logarithms and are divided by the greatest, w_max, and so is the ridge. However far the
  query, some weight is then 1, nothing underflows, and as ridge / w_max grows the slope vanishes: the
  prediction degrades to the kernel mean instead of extrapolating.
* The design is centred on the weighted mean of the samples, not on q. With c_i = x_i - m and S = sum w c c'
  + ridge I, the prediction is sum_i l_i y_i with the equivalent kernel l_i = w_i (1 / n - a'c_i), S a = m -
  q, n = sum w: one small solve whatever the number of outputs.

Source: Atkeson, Moore, Schaal, "Locally weighted learning", Artificial Intelligence Review 11, 1997;
    Cleveland and
Devlin, "Locally weighted regression", JASA 83, 1988, for the equivalent kernel and the degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.special import stdtrit

from skill.arrays import Array

# exp(690) is the largest power that leaves headroom in a double; slopes are long zero by then.
LARGEST_EXPONENT = 690.0


@dataclass(frozen=True)
class LocalPrediction:
    """Predictions with their uncertainty and support.

    Attributes:
        mean: (m, p).
        variance: (m, p), of the outputs about the local model.
        leverage: (m,), sum of the squared equivalent kernel; the mean's variance is this times ``variance``.
        freedom: (m,), residual degrees of freedom, n - p.
        support: (m,), n = sum of the weights over the greatest: how many samples had a say.
        log_w_max: (m,), log of the greatest weight: zero on top of a sample, very negative far from all of
            them.
    """

    mean: Array
    variance: Array
    leverage: Array
    freedom: Array
    support: Array
    log_w_max: Array

    def standard_deviation(self) -> Array:
        """Of a new observation at the query, (m, p)."""
        return np.sqrt(self.variance * (1.0 + self.leverage[:, None]))

    def interval(self, level: float = 0.95, kind: str = "prediction") -> tuple[Array, Array]:
        """Bounds (lower, upper), each (m, p), from Student's t with the residual degrees of freedom.

        Args:
            level: nominal coverage.
            kind: "prediction", for a new observation; or "variance_only", for the mean, which leaves out
                the bias of smoothing and therefore covers the truth less often than its level says.

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
    """Weights over the greatest (m, k), log of the greatest (m,), and the ridge over the greatest (m,)."""
    log_w_max = log_w.max(axis=-1)
    weights = np.exp(log_w - log_w_max[..., None])
    scaled_ridge = ridge * np.exp(np.minimum(-log_w_max, LARGEST_EXPONENT))
    return weights, log_w_max, scaled_ridge


def equivalent_kernel(query: Array, x: Array, weights: Array, ridge: float, degree: int) -> Array:
    """Coefficients l (k,) with prediction l'y, for one query.

    Args:
        query: (d,).
        x: (k, d), the neighbours.
        weights: (k,), over the greatest.
        ridge: over the greatest weight.
        degree: 0 for the kernel mean, 1 for the local linear model.
    """
    normalised = weights / weights.sum()
    if degree == 0:
        return normalised
    mean = normalised @ x
    centred = x - mean
    weighted = centred * weights[:, None]
    scatter = weighted.T @ centred
    scatter.flat[:: len(mean) + 1] += ridge
    offset = mean - query
    if ridge > 0:
        _, a, info = dposv(scatter, offset)
        if info == 0:
            return normalised - weighted @ a
    a = _least_norm(scatter[None], offset[None, :, None])[0, :, 0]
    return normalised - weighted @ a


def equivalent_kernels(queries: Array, x: Array, weights: Array, ridge: Array, degree: int) -> Array:
    """The same for many queries: (m, d), (m, k, d), (m, k), (m,) -> (m, k)."""
    normalised = weights / weights.sum(axis=1, keepdims=True)
    if degree == 0:
        return normalised
    mean, weighted, scatter = _scatter(x, weights, normalised, ridge)
    a = _solve(scatter, (mean - queries)[:, :, None], ridge)
    return normalised - (weighted @ a)[:, :, 0]


def local_predictions(
    queries: Array, x: Array, y: Array, log_w: Array, ridge: float, degree: int, marginal_variance: Array
) -> LocalPrediction:
    """Predictions with uncertainty.

    The variance is sum w r^2 / (n - p) with residuals r about the local model and p = sum_i w_i^2 z_i' A^-1
    z_i, z = [1, c], A = diag(n, S). Where fewer than one degree of freedom is left, residuals say nothing
    of the noise: the missing part of that one degree is filled by the outputs' overall variance, so that an
    isolated sample yields a wide interval and not an empty one.

    Args:
        queries: (m, d).
        x: (m, k, d), the neighbours of each query.
        y: (m, k, p), their outputs.
        log_w: (m, k), logarithms of their kernel weights.
        ridge: on the slope, in the units of x.
        degree: 0 or 1.
        marginal_variance: (p,), the outputs' overall variance.
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
    """Weighted mean (m, d), weighted centred samples (m, k, d) and their ridged scatter (m, d, d)."""
    mean = (normalised[:, None, :] @ x)[:, 0, :]
    centred = x - mean[:, None, :]
    weighted = centred * weights[:, :, None]
    scatter = weighted.transpose(0, 2, 1) @ centred
    d = x.shape[2]
    scatter.reshape(len(x), d * d)[:, :: d + 1] += ridge[:, None]
    return mean, weighted, scatter


def _solve(matrices: Array, right: Array, ridge: Array) -> Array:
    """Solutions of (m, d, d) ridged systems; of least norm where there is no ridge to keep them regular."""
    if (ridge > 0).all():
        try:
            return np.asarray(np.linalg.solve(matrices, right), dtype=np.float64)
        except np.linalg.LinAlgError:  # a ridge below rounding, relative to the samples' spread
            pass
    return _least_norm(matrices, right)


def _least_norm(matrices: Array, right: Array) -> Array:
    # Directions in which the samples do not spread, but for rounding, must not carry a slope.
    tolerance = 10 * matrices.shape[1] * np.finfo(float).eps
    inverse = np.linalg.pinv(matrices, rcond=tolerance, hermitian=True)
    return np.asarray(inverse @ right, dtype=np.float64)
