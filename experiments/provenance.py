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
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "of unknown version"


@cache
def versions() -> dict[str, str]:
    """Returns the versions of the interpreter, of this project and of the packages that affect results.

    They are read from files once; the dictionary is the same for all callers, who do not change it.
    """
    names = ("haptic-skill", "drake", "numpy", "scipy", "scikit-learn")
    return {PYTHON: sys.version.split()[0], **{name: importlib.metadata.version(name) for name in names}}
