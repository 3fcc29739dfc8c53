"""Compilation of numerical functions to machine code, which is kept between processes."""

from __future__ import annotations

import hashlib
from collections import namedtuple
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def _digest() -> str:
    """Returns a digest of the modules that may hold compiled functions, all of `models`, `skill` and `systems`."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for path in sorted(path for room in ("models", "skill", "systems") for path in root.glob(f"{room}/**/*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


# By itself numba compiles again when the file of a function changes, but not when that of a function it calls does.
numba.config.CACHE_DIR = str(Path.home() / ".cache" / "haptic_skill" / _digest())  # type: ignore[attr-defined]


def compiled(function: F) -> F:
    """Returns the function compiled by numba for the types of its arguments; later processes load the code."""
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))


def numbers_class(name: str, parameters: type, module: str) -> Any:
    """Returns a class of named tuples with the fields of a dataclass, which compiled functions can take.

    Args:
        name: of the class; the module must hold it under this name, so that compiled code can be kept.
        parameters: the dataclass; its fields are numbers.
        module: the module that holds the class.
    """
    return namedtuple(name, [field.name for field in fields(parameters)], module=module)
