"""Checks of the parameters and fit arguments of `CompetitiveAgglomeration`; messages name the remedy."""

from __future__ import annotations

import warnings
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array

CHOICES: dict[str, tuple[Any, ...]] = {
    "distance": ("fmle", "gk", "euclid"),
    "bias": ("posterior", "literal"),
    "schedule": ("exp", "ramp"),
    "covariance_type": ("full", "diag"),
    "merge": ("bic", None),
}
COUNTS = ("m_init", "max_iter", "n_init")
NUMBERS = ("eta0", "tau", "min_cardinality", "shrinkage", "reg_covar", "tol")
OPTIONAL = ("n_init", "eta0", "min_cardinality", "shrinkage")


def check_parameters(estimator: Any) -> None:
    """Raises a ValueError that names the first parameter of the estimator that is out of range."""
    for name, allowed in CHOICES.items():
        if getattr(estimator, name) not in allowed:
            raise ValueError(f"{name}={getattr(estimator, name)!r}: expected one of {allowed}")
    if isinstance(estimator.init, str) and estimator.init not in ("auto", "k-means++", "phase"):
        raise ValueError(f"init={estimator.init!r}: expected 'auto', 'k-means++', 'phase', centres or labels")
    for name in (*COUNTS, *NUMBERS):
        value = getattr(estimator, name)
        if value is None and name in OPTIONAL:
            continue
        if name in COUNTS:
            if not isinstance(value, Integral) or int(value) < 1:
                raise ValueError(f"{name}={value!r}: expected an integer of at least 1")
            continue
        number = float(value) if isinstance(value, Real) else float("nan")
        if not np.isfinite(number) or number < 0.0 or (name == "tau" and number == 0.0):
            bound = "positive" if name == "tau" else "non-negative"
            raise ValueError(f"{name}={value!r}: expected a {bound} finite number")


def checked_groups(groups: ArrayLike | None, N: int) -> NDArray[np.intp] | None:
    """Index of the demonstration of each sample, or None when the dependence cannot be measured."""
    if groups is None:
        return None
    given = np.asarray(groups)
    if given.shape != (N,):
        raise ValueError(f"groups has shape {given.shape}, expected ({N},): the demonstration of each sample")
    names, index = np.unique(given, return_inverse=True)
    if len(names) < 2:
        warnings.warn(
            "groups names a single demonstration, so its samples count as independent and the number of"
            " states will grow with the sampling rate: give two or more demonstrations",
            UserWarning,
            stacklevel=3,
        )
        return None
    return np.asarray(index, dtype=np.intp)


def checked_phase(phase: ArrayLike | None, N: int) -> Array | None:
    """Normalised time of each sample."""
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
