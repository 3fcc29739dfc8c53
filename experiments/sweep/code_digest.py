"""Digests of the code that a result depends on: the source of this project's packages and of a user's own."""

from __future__ import annotations

import hashlib
import json
import re
import sysconfig
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from experiments.provenance import version_of, versions

PACKAGES = ("models", "skill", "systems", "experiments")
"""The packages of this project that decide the result of a trial."""

SOURCES = {".py", ".sdf", ".xml"}
"""Endings of the files that count."""

INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})
"""Where Python and installed packages are."""


def values_digest(values: Mapping[str, Any]) -> str:
    """Returns a digest of JSON values and dataclasses, whatever the order of their keys."""
    text = json.dumps(values, sort_keys=True, default=lambda value: getattr(value, "__dict__", str(value)))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def code_digest(packages: tuple[str, ...] = PACKAGES) -> str:
    """Returns a digest of the source of top-level packages or modules.

    It is as this process found them first: a line that changes later is not in what the process has loaded.

    Raises:
        ValueError: if one cannot be found.
    """
    return values_digest({name: _source_digest(name) for name in packages})


def _source_digest(package: str) -> str:
    root = _place(package)
    if root is None:
        raise ValueError(f"{package}: no source found; expected a package or module beside the current folder")
    files = sorted(path for path in root.rglob("*") if path.suffix in SOURCES) if root.is_dir() else [root]
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()


def own_packages(paths: Iterable[str]) -> tuple[str, ...]:
    """Returns the sorted top-level packages of some import paths that are neither installed nor a part of Python."""
    tops = {re.split("[.:]", path)[0] for path in paths}
    return tuple(sorted(filter(_is_own, tops)))


def _is_own(package: str) -> bool:
    place = _place(package)
    return package in PACKAGES or (place is not None and not any(place.is_relative_to(folder) for folder in INSTALLED))


def _place(package: str) -> Path | None:
    """The folder of a package, or the file of a module; None if it has no source."""
    try:
        spec = find_spec(package)
    except (ModuleNotFoundError, ValueError):
        return None
    if spec is None:
        return None
    place = Path([*(spec.submodule_search_locations or ()), spec.origin or ""][0])
    return place if place.is_absolute() else None  # what is built in has no place


@dataclass(frozen=True)
class Requirements:
    """What a worker must have to do the work of a client: the same code and the same packages.

    Attributes:
        packages: names of the packages and modules that the work imports.
        code: digest of their source.
        versions: versions of Python and of installed packages.
    """

    packages: tuple[str, ...]
    code: str
    versions: dict[str, str]

    @classmethod
    def of(cls, own: Iterable[str] = (), installed: Mapping[str, str] | None = None) -> Requirements:
        """Returns the requirements of trials, and of further packages of a user and installed ones."""
        packages = tuple(sorted({*PACKAGES, *own}))
        return cls(packages, code_digest(packages), {**versions(), **(installed or {})})

    def check(self) -> None:
        """Checks that this process has the same.

        Raises:
            ValueError: if it has other code, or another version of a package.
        """
        if code_digest(self.packages) != self.code:
            raise ValueError("a worker has other code than the client; install the same revision, or start again")
        for name, version in self.versions.items():
            if version_of(name) != version:
                raise ValueError(f"a worker has {name} {version_of(name)}, the client {version}; install the same")
