"""A digest of the code that a result depends on: the source of modules and of all that they import."""

from __future__ import annotations

import ast
import hashlib
import json
import sysconfig
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any

from experiments.provenance import version_of

PACKAGES = ("models", "skill", "systems", "experiments")
"""The packages of this project whose modules decide the result of a trial."""

DATA = (("models", "*.sdf"), ("models", "*.xml"))
"""Packages with files that are not imported, but read."""

INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})
"""Where Python and installed packages are."""


def values_digest(values: Mapping[str, Any]) -> str:
    """Returns a digest of JSON values and dataclasses, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=vars).encode()).hexdigest()[:16]


def code_digest(modules: Iterable[str]) -> str:
    """Returns a digest of the source of some modules, without their imports, and of the data files of `PACKAGES`.

    Each module counts as this process found it first: a line that changes later is not in what the process has loaded.

    Raises:
        ValueError: if a module cannot be found.
    """
    sources = {name: _file_digest(_source(name)) for name in sorted(modules)}
    data = {str(path.name): _file_digest(path) for package, pattern in DATA for path in _data_files(package, pattern)}
    return values_digest({**sources, **data})


@cache
def _file_digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@cache
def _data_files(package: str, pattern: str) -> list[Path]:
    return sorted(_source(package).parent.glob(pattern))


def modules_of(modules: Iterable[str]) -> set[str]:
    """Returns the names of modules and of all that they import from `PACKAGES` and from a user's own modules.

    Imports are read from the source, wherever they stand in it; a module that is imported by a name made at run time
    is not seen. A changed line in a module that is not imported, such as that of a page, does not change the digest.

    Raises:
        ValueError: if a module cannot be found.
    """
    found: set[str] = set()
    waiting = [*modules]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _own_imports(name)
    return found


@cache
def _own_imports(module: str) -> list[str]:
    """The names of the modules of `PACKAGES` and of the user's own that the source of a module imports."""
    return [name for name in {*_imports(_source(module), module)} if is_own(name.split(".")[0]) and _is_module(name)]


def _imports(path: Path, module: str) -> Iterator[str]:
    """The names of modules, or of what is in them, that the source file of a module imports; and their parents."""
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = resolve_name("." * node.level + (node.module or ""), package) if node.level else str(node.module)
            names = [base, *(f"{base}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            parts = name.split(".")
            yield from (".".join(parts[: k + 1]) for k in range(len(parts)))


@cache
def is_own(package: str) -> bool:
    """Whether a top-level package or module is one of `PACKAGES`, or neither installed nor a part of Python."""
    if package in PACKAGES:
        return True
    try:
        spec = find_spec(package)
    except (ModuleNotFoundError, ValueError):
        return False
    places = [*(spec.submodule_search_locations or ()), spec.origin or ""] if spec else []
    if not places or not Path(places[0]).is_absolute():  # built in
        return False
    return not any(Path(places[0]).is_relative_to(folder) for folder in INSTALLED)


@cache
def _is_module(name: str) -> bool:
    """Whether a name is that of a module with a source file; a folder without one has no source."""
    try:
        return bool(_source(name))
    except ValueError:  # its parent is a module, and this a name in it
        return False


@cache
def _source(name: str) -> Path:
    try:
        spec = find_spec(name)
    except ModuleNotFoundError:
        spec = None
    if spec is None or not (spec.origin or "").endswith(".py"):
        raise ValueError(f"module {name}: no source found; expected one that can be imported from the current folder")
    return Path(str(spec.origin))


@dataclass(frozen=True)
class Requirements:
    """What a worker must have to do the work of a client: the same code and the same packages.

    Attributes:
        modules: names of all modules that the work may import.
        code: digest of their source.
        versions: names and versions of Python and of packages.
    """

    modules: tuple[str, ...]
    code: str
    versions: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, modules: Iterable[str], versions: Mapping[str, str]) -> Requirements:
        """Returns the requirements of work with some modules, as they are here, and versions of packages."""
        names = tuple(sorted(modules))
        return cls(names, code_digest(names), tuple(versions.items()))

    def check(self) -> None:
        """Checks that this process has the same.

        Raises:
            ValueError: if it has other code, or another version of a package.
        """
        if code_digest(self.modules) != self.code:
            raise ValueError("a worker has other code than the client; install the same revision, or start again")
        for name, version in self.versions:
            if version_of(name) != version:
                raise ValueError(f"a worker has {name} {version_of(name)}, the client {version}; install the same")
