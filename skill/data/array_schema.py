"""Checks named arrays, as files hold them, against a schema before anything is built from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

KINDS = {"numbers": "fiu", "integers": "iu", "truth values": "b", "texts": "U"}
"""Kinds of NumPy types, by the name of what an array may hold."""


MAX_MAGNITUDE, MIN_POSITIVE = 1e12, 1e-12
"""Largest magnitude of a stored number, and the least of one that is divided by, without limits of their own. Real
numbers lie far within them, and squares and ratios of them stay finite."""


@dataclass(frozen=True)
class ArrayRule:
    """What an array must be.

    Attributes:
        shape: number of elements along each axis; a letter is a number that all arrays share.
        holds: a key of ``KINDS``.
        low: smallest number.
        high: largest number.
        positive: whether numbers must be greater than zero.
        unknown: whether numbers may be NaN.
        choices: the texts that are allowed; all if empty.
        optional: whether the array may be missing.
    """

    shape: tuple[str | int, ...] = ()
    holds: str = "numbers"
    low: float = -MAX_MAGNITUDE
    high: float = MAX_MAGNITUDE
    positive: bool = False
    unknown: bool = False
    choices: tuple[str, ...] = ()
    optional: bool = False


def check_arrays(arrays: Mapping[str, NDArray[Any]], rules: Mapping[str, ArrayRule], source: str) -> dict[str, int]:
    """Checks that there are exactly the expected arrays, and the shape, type and range of each.

    Args:
        arrays: the arrays by name.
        rules: the rules by name.
        source: what made the arrays, for error messages.

    Returns:
        The shared numbers of elements by their letters.

    Raises:
        ValueError: naming the array, what was found and what was expected.
    """
    missing = sorted(name for name, rule in rules.items() if name not in arrays and not rule.optional)
    if missing:
        raise ValueError(f"arrays {missing} are missing; expected the arrays of {source}")
    unknown = sorted(set(arrays) - set(rules))
    if unknown:
        raise ValueError(f"arrays {unknown} are unknown; expected the arrays of {source}")
    sizes: dict[str, int] = {}
    for name, rule in rules.items():
        if name in arrays:
            _check_shape(name, np.asarray(arrays[name]), rule, sizes)
            _check_values(name, np.asarray(arrays[name]), rule)
    return sizes


def _check_shape(name: str, array: NDArray[Any], rule: ArrayRule, sizes: dict[str, int]) -> None:
    expected = f"({', '.join(map(str, rule.shape))}{',' if len(rule.shape) == 1 else ''})"
    if array.ndim != len(rule.shape):
        raise ValueError(f"array '{name}' has shape {array.shape}, expected {expected}")
    for axis, found in zip(rule.shape, array.shape, strict=True):
        wanted = sizes.setdefault(axis, found) if isinstance(axis, str) else axis
        if found != wanted or found == 0:
            known = ", ".join(f"{letter} = {sizes[letter]}" for letter in rule.shape if letter in sizes)
            raise ValueError(
                f"array '{name}' has shape {array.shape}, expected {expected}{f' with {known}' if known else ''}"
            )


def _check_values(name: str, array: NDArray[Any], rule: ArrayRule) -> None:
    if array.dtype.kind not in KINDS[rule.holds]:
        raise ValueError(f"array '{name}' has type {array.dtype}, expected {rule.holds}")
    if rule.choices and not np.isin(array, rule.choices).all():
        raise ValueError(f"array '{name}' is {str(array)[:40]!r}, expected one of {list(rule.choices)}")
    if rule.holds not in ("numbers", "integers"):
        return
    known = array[~np.isnan(array)] if rule.unknown else array
    if not np.isfinite(known).all():
        raise ValueError(f"array '{name}' is not finite; the file is damaged")
    if not known.size:
        return
    low, high = known.min(), known.max()
    if low < rule.low or high > rule.high or (rule.positive and low <= 0):
        expected = f"positive numbers of at most {rule.high:g}" if rule.positive else f"{rule.low:g} to {rule.high:g}"
        raise ValueError(f"array '{name}' lies between {low:g} and {high:g}, expected {expected}")
