"""Arrays of samples: their type, the scale of each channel, and the rows that belong together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""An array of 64-bit floats; docstrings give shape and unit."""

ROUND_OFF = 10.0 * float(np.finfo(float).eps)
"""Largest spread of a channel, relative to its greatest magnitude, that counts as round-off."""


def standard_scale(X: Array) -> Array:
    """Returns the standard deviation of each channel; one for a channel that is constant up to round-off, (d,).

    The range of a constant channel is exact for any number of samples. Its standard deviation is not: the error of the
    mean grows with the number of samples.

    Args:
        X: samples, shape (N, d).
    """
    spread: Array = X.std(axis=0)
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
