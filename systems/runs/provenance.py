"""What a result depends on besides its scenario."""

from __future__ import annotations

import importlib.metadata
import sys


def versions() -> dict[str, str]:
    """Of the interpreter, this project and the packages that decide a result."""
    names = ("haptic-skill", "drake", "numpy", "scipy", "scikit-learn")
    return {"python": sys.version.split()[0], **{name: importlib.metadata.version(name) for name in names}}
