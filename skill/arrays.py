"""Arrays of samples: their type, the scale of each channel, and the rows that belong together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from compiled import compiled_within

Array = NDArray[np.float64]
"""An array of 64-bit floats; docstrings give shape and unit."""

ROUND_OFF = 10.0 * float(np.finfo(float).eps)
"""Largest spread of a channel, relative to its greatest magnitude, that counts as round-off."""


@compiled_within
def assign(target: Array, values: Array) -> None:
    """Copies values (n,) into an array (n,), or the beginning of a longer one.

    Compiled code gets no checks of shapes with it, which take seconds to compile.
    """
    for i in range(len(values)):
        target[i] = values[i]


OUTLYING = 0.01
"""Share of the samples on either side of a channel that may be outliers."""

REACH = 2.0
"""What lies farther from the other samples than this many of their ranges is an outlier."""


def outlier_limits(X: Array, weights: Array | None = None) -> tuple[Array, Array]:
    """Returns the lower and the upper limit, (d,) each, beyond which a sample of a channel is an outlier.

    The limits are `REACH` ranges below and above the range of all but the `OUTLYING` smallest and largest samples;
    none where this range is zero. A channel without outliers has no sample beyond its limits.

    Args:
        X: samples, shape (N, d).
        weights: (N,), number of times that each sample counts; None for once.
    """
    low, high = np.quantile(X, [OUTLYING, 1.0 - OUTLYING], axis=0, method="inverted_cdf", weights=weights)
    reach = np.where(high > low, REACH * (high - low), np.inf)
    return low - reach, high + reach


def resolution(X: Array) -> Array:
    """Returns the smallest step between different values of each channel, (d,): that of the sensor, or of a file.

    Args:
        X: samples, shape (N, d).
    """
    steps = np.diff(np.sort(X, axis=0), axis=0)
    smallest: Array = np.where(steps > 0.0, steps, np.inf).min(axis=0, initial=np.inf)
    return np.where(np.isfinite(smallest), smallest, 0.0)


def standard_scale(X: Array, weights: Array | None = None) -> Array:
    """Returns the standard deviation of each channel; one for a channel that is constant up to round-off, (d,).

    An outlier counts as a sample at its limit (`outlier_limits`): one wild sample does not change the scale of a
    channel. The range of a constant channel is exact for any number of samples. Its standard deviation is not: the
    error of the mean grows with the number of samples.

    Args:
        X: samples, shape (N, d).
        weights: (N,), number of times that each sample counts; None for once.
    """
    limited = np.clip(X, *outlier_limits(X, weights))
    if weights is None:
        spread: Array = limited.std(axis=0)
    else:
        spread = np.sqrt(np.average((limited - np.average(limited, axis=0, weights=weights)) ** 2, 0, weights))
    round_off = ROUND_OFF * np.abs(X).max(axis=0)
    varies = (np.ptp(X, axis=0) > 2.0 * round_off) & (spread > round_off)
    return np.where(varies, spread, 1.0)


def sequences(groups: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yields the rows of each demonstration or recording, shape (n,), in their order.

    Args:
        groups: shape (N,), demonstration or recording of each row.
    """
    order = np.argsort(groups, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)
