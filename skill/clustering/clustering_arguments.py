"""Checks of the parameters of `CompetitiveAgglomeration` and of the arguments of its `fit`."""

from __future__ import annotations

import warnings
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils._param_validation import Interval, StrOptions

from skill.arrays import Array

POSITIVE = Interval(Real, 0, None, closed="neither")
NON_NEGATIVE = Interval(Real, 0, None, closed="left")
COUNT = Interval(Integral, 1, None, closed="left")
ITERATION = Interval(Integral, 0, None, closed="left")

PARAMETER_CONSTRAINTS: dict[str, list[Any]] = {
    "distance": [StrOptions({"fmle", "gk", "euclid"})],
    "bias": [StrOptions({"posterior", "literal"})],
    "m_init": [COUNT],
    "eta0": [NON_NEGATIVE, None],
    "tau": [POSITIVE],
    "schedule": [StrOptions({"exp", "ramp"})],
    "rise": [ITERATION],
    "decay": [ITERATION],
    "min_cardinality": [NON_NEGATIVE, None],
    "tails": [StrOptions({"normal", "heavy"})],
    "covariance_type": [StrOptions({"full", "diag"})],
    "shrinkage": [NON_NEGATIVE, None],
    "reg_covar": [NON_NEGATIVE],
    "sensor_variance": ["array-like", None],
    "merge": [StrOptions({"bic"}), None],
    "number": [StrOptions({"states", "density"})],
    "init": [StrOptions({"auto", "k-means++", "phase"}), "array-like"],
    "n_init": [COUNT, None],
    "max_iter": [COUNT],
    "tol": [NON_NEGATIVE],
    "standardize": ["boolean"],
    "random_state": ["random_state"],
}
"""Allowed values of each constructor parameter, as scikit-learn's parameter validation expects them."""


def checked_groups(groups: ArrayLike | None, N: int) -> NDArray[np.intp] | None:
    """Returns the index of the demonstration of each sample, shape (N,).

    Warns if there is a single demonstration.

    Args:
        groups: shape (N,), any labels of the demonstrations, or None.
        N: number of samples.

    Returns:
        None if there are fewer than two demonstrations: the dependence of the samples cannot be measured.

    Raises:
        ValueError: if the shape is wrong.
    """
    if groups is None:
        return None
    given = np.asarray(groups)
    if given.shape != (N,):
        raise ValueError(f"groups has shape {given.shape}, expected ({N},): the recording of each sample")
    names, index = np.unique(given, return_inverse=True)
    if len(names) < 2:
        warnings.warn(
            "groups contains a single demonstration, so all samples count as independent and the number of"
            " states grows with the sampling rate: use two or more demonstrations",
            UserWarning,
            stacklevel=3,
        )
        return None
    return np.asarray(index, dtype=np.intp)


def checked_phase(phase: ArrayLike | None, N: int) -> Array | None:
    """Returns the normalised time of each sample, shape (N,), or None if it is not given.

    Raises:
        ValueError: if the shape is wrong or a value lies outside [0, 1].
    """
    if phase is None:
        return None
    given = np.asarray(phase, dtype=float)
    if given.shape != (N,):
        raise ValueError(f"phase has shape {given.shape}, expected ({N},): the time of each sample")
    if not np.isfinite(given).all() or given.min() < 0.0 or given.max() > 1.0:
        raise ValueError(
            f"phase lies between {given.min():.3g} and {given.max():.3g}, expected [0, 1]: divide the time"
            " since the start of each demonstration by its duration"
        )
    return given


def checked_sensor_variance(variance: ArrayLike | None, d: int) -> Array:
    """Returns the noise variance of each channel, shape (d,); zeros if it is not given.

    Raises:
        ValueError: if the shape is wrong, or a variance is negative, NaN or infinite.
    """
    if variance is None:
        return np.zeros(d)
    given = np.asarray(variance, dtype=float)
    if given.shape != (d,):
        raise ValueError(f"sensor_variance has shape {given.shape}, expected ({d},): one variance for each channel")
    if not np.isfinite(given).all() or (given < 0.0).any():
        raise ValueError(f"sensor_variance is {given}, expected finite variances of at least 0")
    return given
