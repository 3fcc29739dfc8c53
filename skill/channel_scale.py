"""The scale of each channel of a set of samples, shared by clustering and regression."""

from __future__ import annotations

import numpy as np

from skill.arrays import Array

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
