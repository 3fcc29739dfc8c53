"""The scale of each channel of a set of samples, shared by clustering and regression."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

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


def resolved_scale(feature_scale: ArrayLike | str | None, X: Array) -> Array:
    """Returns the factors (d,) that a parameter asks for: numbers, "standard" (see `standard_scale`), or None for ones.

    Raises:
        ValueError: if they are not d positive, finite numbers.
    """
    if feature_scale is None:
        return np.ones(X.shape[1])
    if isinstance(feature_scale, str):
        return 1.0 / standard_scale(X)
    scale = np.asarray(feature_scale, dtype=float)
    expected = f"expected {X.shape[1]} positive, finite numbers, one for each feature"
    if scale.shape != (X.shape[1],):
        raise ValueError(f"feature_scale has shape {scale.shape}; {expected}")
    if not (np.isfinite(scale).all() and (scale > 0).all()):
        raise ValueError(f"feature_scale is {scale}; {expected}")
    return scale
