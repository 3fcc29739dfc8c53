"""Responses to an own input, regressed locally: the outputs are linear in the input, and the coefficients vary.

At features x and input u, the samples j have the weights w_j = r_j exp(-|x - x_j|^2 / 2 h^2). With a = (1, u),

    y = B'a + e,    B = (sum_j w_j a_j a_j' + n_0 I)^-1 sum_j w_j a_j y_j',

is the weighted ridge regression on the inputs of the samples near x (a varying-coefficient model: Hastie, Tibshirani,
J. R. Stat. Soc. B 55(4), 1993). The variance of a new output is

    v = (sum_j w_j (y_j - B'a_j)^2 + n_0) / (sum_j w_j + n_0) (1 + a'(sum_j w_j a_j a_j' + n_0 I)^-1 a).

Features, inputs and outputs are in units of their standard deviations over all samples, so that n_0 acts like n_0
samples with the mean and the spread of all: far from all samples, the prediction is the mean of all samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.compiled import compiled
from skill.data.array_schema import MIN_POSITIVE, ArrayRule
from skill.regression.positive_systems import solve_positive

PRIOR_SAMPLES = 3.0
"""n_0. The choice matters only where the weights add up to a few samples."""

TAIL = 4.0
"""Degrees of freedom of the Student-t distribution of the outputs: impacts and slips are more frequent than a normal
distribution allows."""

RESPONSE_RULES = {
    "features": ArrayRule(("n", "d")),
    "inputs": ArrayRule(("n", "q")),
    "outputs": ArrayRule(("n", "p")),
    "feature_spread": ArrayRule(("d",), low=MIN_POSITIVE),
    "input_spread": ArrayRule(("q",), low=MIN_POSITIVE),
    "output_spread": ArrayRule(("p",), low=MIN_POSITIVE),
    "output_mean": ArrayRule(("p",)),
}
"""The arrays of `response_arrays`: n samples."""


@dataclass(frozen=True)
class ResponseSamples:
    """Samples of responses, in units of their standard deviations.

    Attributes:
        X: (n, d), features.
        U: (n, q), inputs.
        Y: (n, p), outputs.
    """

    X: Array
    U: Array
    Y: Array

    def __len__(self) -> int:
        return len(self.X)

    def kernel(self, queries: Array, bandwidth: float) -> Array:
        """Returns the kernel weights (m, n) of the samples at scaled features (m, d)."""
        squares = (queries**2).sum(axis=1)[:, None] + (self.X**2).sum(axis=1) - 2.0 * queries @ self.X.T
        weights: Array = np.exp(np.maximum(squares, 0.0) / (-2.0 * bandwidth**2))
        return weights


Scales = tuple[Array, Array, Array]
"""Standard deviations of the features (d,), the inputs (q,) and the outputs (p,)."""


def response_arrays(samples: ResponseSamples, scales: Scales, centre: Array) -> dict[str, NDArray[Any]]:
    """Returns samples, their scales, and the mean of the outputs (p,), as arrays that can be stored without pickle."""
    return {
        "features": samples.X,
        "inputs": samples.U,
        "outputs": samples.Y,
        "feature_spread": scales[0],
        "input_spread": scales[1],
        "output_spread": scales[2],
        "output_mean": centre,
    }


def restored_responses(arrays: Mapping[str, NDArray[Any]]) -> tuple[ResponseSamples, Scales, Array]:
    """Returns what `response_arrays` was given."""
    X, U, Y, *scales, centre = (np.array(arrays[name], dtype=float) for name in RESPONSE_RULES)
    return ResponseSamples(X, U, Y), (scales[0], scales[1], scales[2]), centre


class ResponseModel:
    """The regression of the module's docstring, for one set of samples and many sets of weights r.

    Args:
        samples: the samples.

    Attributes:
        moments: (n, f), of each sample: a a', a y', y^2 and 1.
    """

    def __init__(self, samples: ResponseSamples) -> None:
        self._Y = samples.Y
        self._A = _with_constant(samples.U)
        n, q = self._A.shape
        self.moments = np.hstack(
            [
                (self._A[:, :, None] * self._A[:, None, :]).reshape(n, q * q),
                (self._A[:, :, None] * samples.Y[:, None, :]).reshape(n, -1),
                samples.Y**2,
                np.ones((n, 1)),
            ]
        )

    def residuals(self, weights: Array, inputs: Array, outputs: Array) -> tuple[Array, Array]:
        """Returns the errors (m, p) of the predictions at queries, and the variances (m, p) that the model expects.

        Args:
            weights: (m, n), the weights w of the samples at each query.
            inputs: (m, q), u of the queries.
            outputs: (m, p), y of the queries.
        """
        sums = weights @ self.moments
        return residuals_of_sums(sums, np.ascontiguousarray(inputs), np.ascontiguousarray(outputs))

    def coefficients(self, weights: Array) -> Array:
        """Returns B (m, 1 + q, p) of the regressions at queries with the weights (m, n) of the samples."""
        q, p = self._A.shape[1], self._Y.shape[1]
        sums = weights @ self.moments
        S = sums[:, : q * q].reshape(-1, q, q) + PRIOR_SAMPLES * np.eye(q)
        found = np.linalg.solve(S, sums[:, q * q : q * (q + p)].reshape(-1, q, p))
        return np.asarray(found, dtype=float)

    def log_likelihoods(
        self, kernel: Array, memberships: Array, inputs: Array, outputs: Array, correlation_times: Array
    ) -> Array:
        """Returns the log-likelihood (m, K) of each query in each of K sets of samples.

        Args:
            kernel: (m, n), kernel weights of the samples at each query.
            memberships: (n, K), the weights r of the samples in each set.
            inputs: (m, q), u of the queries.
            outputs: (m, p), y of the queries.
            correlation_times: (p,), by which the log-densities of the outputs are divided.
        """
        found = []
        for r in memberships.T:
            errors, variances = self.residuals(kernel * r, inputs, outputs)
            found.append(log_density(errors, variances) @ (1.0 / correlation_times))
        return np.column_stack(found)


@compiled
def residuals_of_sums(sums: Array, inputs: Array, outputs: Array) -> tuple[Array, Array]:
    """Returns errors (m, p) and variances (m, p) as `ResponseModel.residuals` does.

    Args:
        sums: (m, f), of the moments of the samples, each with its weight at the query.
        inputs: (m, q), u of the queries.
        outputs: (m, p), y of the queries.
    """
    m, q, p = len(sums), inputs.shape[1] + 1, outputs.shape[1]
    errors, variances = np.empty((m, p)), np.empty((m, p))
    S, M, B, a = np.empty((q, q)), np.empty((q, q)), np.empty((q, p + 1)), np.ones(q)
    for row in range(m):
        found = sums[row]
        a[1:] = inputs[row]
        for i in range(q):
            for j in range(q):
                S[i, j] = found[q * i + j]
            for k in range(p):
                B[i, k] = found[q * q + p * i + k]
            B[i, p] = a[i]
        M[:] = S
        for i in range(q):
            M[i, i] += PRIOR_SAMPLES
        solve_positive(M, B)
        leverage = 1.0
        for i in range(q):
            leverage += a[i] * B[i, p]
        for k in range(p):
            # sum w (y - B'a)^2 = sum w y^2 - 2 B'C + B'S B.
            predicted, rest = 0.0, found[q * (q + p) + k]
            for i in range(q):
                predicted += B[i, k] * a[i]
                along = -2.0 * found[q * q + p * i + k]
                for j in range(q):
                    along += S[i, j] * B[j, k]
                rest += B[i, k] * along
            spread = (max(rest, 0.0) + PRIOR_SAMPLES) / (found[-1] + PRIOR_SAMPLES)
            errors[row, k], variances[row, k] = outputs[row, k] - predicted, spread * leverage
    return errors, variances


@compiled
def log_density(errors: Array, variances: Array) -> Array:
    """Returns the logarithm of the Student-t density of errors with these squared scales, less its constant."""
    density: Array = -0.5 * (TAIL + 1.0) * np.log1p(errors**2 / (TAIL * variances)) - 0.5 * np.log(variances)
    return density


def _with_constant(inputs: Array) -> Array:
    return np.column_stack([np.ones(len(inputs)), inputs])
