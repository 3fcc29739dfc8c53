"""The software versions that a result depends on."""

from __future__ import annotations

import importlib.metadata
import sys
from functools import cache

PYTHON = "python"


def version_of(distribution: str) -> str:
    """Returns the version of Python or of an installed distribution, or "of unknown version"."""
    if distribution == PYTHON:
        return sys.version.split()[0]
    try:
        return _installed(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "of unknown version"


def versions() -> dict[str, str]:
    """Returns the versions of the interpreter, of this project and of the packages that affect results."""
    names = ("haptic-skill", "drake", "numpy", "scipy", "scikit-learn")
    return {PYTHON: version_of(PYTHON), **{name: _installed(name) for name in names}}


@cache
def _installed(distribution: str) -> str:
    """Returns the version of a distribution as this process found it first; it is read from a file."""
    return importlib.metadata.version(distribution)
