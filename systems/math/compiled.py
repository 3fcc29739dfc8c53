"""Compilation of numerical functions to machine code, which is kept between processes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def _digest() -> str:
    """Returns a digest of the modules that hold compiled functions, all of `models` and `systems`."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for path in sorted([*root.glob("models/*.py"), *root.glob("systems/**/*.py")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


# By itself numba compiles again when the file of a function changes, but not when that of a function it calls does.
numba.config.CACHE_DIR = str(Path.home() / ".cache" / "haptic_skill" / _digest())  # type: ignore[attr-defined]


def compiled(function: F) -> F:
    """Returns the function compiled by numba for the types of its arguments; later processes load the code."""
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))


def inlined(function: F) -> F:
    """As `compiled`, but the function becomes part of those that call it, so that their loops can use vectors."""
    return cast(F, numba.njit(inline="always", error_model="numpy")(function))
