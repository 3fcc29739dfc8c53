"""Responses to an own input, regressed locally: the outputs are linear in the input, and the coefficients vary.

At features x and input u, the samples j have the weights w_j = r_j exp(-|x - x_j|^2 / 2 h^2). With a = (1, u),

    y = B'a + e,    B = (sum_j w_j a_j a_j' + n_0 I)^-1 sum_j w_j a_j y_j',

is the weighted ridge regression on the inputs of the samples near x (a varying-coefficient model: Hastie, Tibshirani,
J. R. Stat. Soc. B 55(4), 1993).

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
from skill.data.array_schema import MIN_POSITIVE, ArrayRule

PRIOR_SAMPLES = 3.0
"""n_0. The choice matters only where the weights add up to a few samples."""

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
    """

    def __init__(self, samples: ResponseSamples) -> None:
        self._A, self._Y = np.column_stack([np.ones(len(samples.U)), samples.U]), samples.Y
        n, q = self._A.shape
        self._moments = np.hstack(
            [
                (self._A[:, :, None] * self._A[:, None, :]).reshape(n, q * q),
                (self._A[:, :, None] * samples.Y[:, None, :]).reshape(n, -1),
            ]
        )

    def coefficients(self, weights: Array) -> Array:
        """Returns B (m, 1 + q, p) of the regressions at queries with the weights (m, n) of the samples."""
        q, p = self._A.shape[1], self._Y.shape[1]
        sums = weights @ self._moments
        S = sums[:, : q * q].reshape(-1, q, q) + PRIOR_SAMPLES * np.eye(q)
        found = np.linalg.solve(S, sums[:, q * q :].reshape(-1, q, p))
        return np.asarray(found, dtype=float)
