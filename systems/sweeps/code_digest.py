"""A digest of the code that a result depends on: the source of modules and of all that they import."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("models", "skill", "systems")
"""The packages of this project whose modules decide the result of a trial."""

DATA = {"models": ("*.sdf", "*.xml", "scenarios/*.yaml")}
"""Files of a package that are not imported, but read."""


def code_digest(modules: Iterable[str], packages: Iterable[str] = PACKAGES) -> str:
    """Returns a digest of the source of some modules and of all modules of ``packages`` that they import.

    Imports are read from the source, wherever they stand in it; a module that is imported by a name made at run time
    is not seen. A changed line in a module that is not imported, such as that of a page, does not change the digest.

    Raises:
        ValueError: if a module cannot be found.
    """
    return source_digest(sorted(modules_of(modules, packages)), packages)


def source_digest(modules: Iterable[str], packages: Iterable[str] = PACKAGES) -> str:
    """Returns a digest of the source of some modules, without their imports, and of the data files of the packages.

    Raises:
        ValueError: if a module cannot be found.
    """
    digest = hashlib.sha256()
    for name in modules:
        digest.update(f"{name}\0".encode() + _source(name).read_bytes() + b"\0")
    for package in packages:
        for pattern in DATA.get(package, ()):
            for path in sorted(_source(package).parent.glob(pattern)):
                digest.update(f"{package}/{path.name}\0".encode() + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def modules_of(modules: Iterable[str], packages: Iterable[str] = PACKAGES) -> set[str]:
    """Returns the names of the modules whose source `code_digest` reads."""
    return set(_closure(frozenset(modules), (*packages,)))


@lru_cache(maxsize=64)
def _closure(modules: frozenset[str], packages: tuple[str, ...]) -> dict[str, Path]:
    """The source files of modules and of what they import from the packages, by the names of the modules."""
    found: dict[str, Path] = {}
    waiting = sorted(modules)
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name] = _source(name)
        for imported in _imports(found[name]):
            if imported.split(".")[0] in packages and _is_module(imported):
                waiting.append(imported)
    return found


def _imports(path: Path) -> Iterator[str]:
    """The names of modules, or of what is in them, that a source file imports; and their parent packages."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            parts = name.split(".")
            yield from (".".join(parts[: k + 1]) for k in range(len(parts)))


@lru_cache(maxsize=4096)
def _is_module(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # its parent is a module, and this a name in it
        return False


def _source(name: str) -> Path:
    try:
        spec = find_spec(name)
    except ModuleNotFoundError:
        spec = None
    if spec is None or spec.origin is None:
        raise ValueError(f"module {name}: not found; expected one that can be imported from the current folder")
    return Path(spec.origin)
