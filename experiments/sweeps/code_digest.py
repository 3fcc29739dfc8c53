"""A digest of the code that a result depends on: the source of modules and of all that they import."""

from __future__ import annotations

import ast
import hashlib
import json
import sysconfig
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, lru_cache
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any

PACKAGES = ("models", "skill", "systems", "experiments")
"""The packages of this project whose modules decide the result of a trial."""

DATA = {"models": ("*.sdf", "*.xml")}
"""Files of a package that are not imported, but read."""

INSTALLED = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})
"""Where Python and installed packages are."""


def values_digest(values: Mapping[str, Any]) -> str:
    """Returns a digest of JSON values, whatever the order of their keys."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def code_digest(modules: Iterable[str], packages: Iterable[str] = PACKAGES) -> str:
    """Returns a digest of the source of some modules and of all modules of ``packages`` that they import.

    Imports are read from the source, wherever they stand in it; a module that is imported by a name made at run time
    is not seen. A changed line in a module that is not imported, such as that of a page, does not change the digest.

    Raises:
        ValueError: if a module cannot be found.
    """
    return _digest_of(sorted(modules_of(modules, packages)), packages, _module_source, _package_data)


def first_digest(modules: Iterable[str]) -> str:
    """Returns a digest of the source of some modules, without their imports, and of the data files of `PACKAGES`.

    Each module counts as this process found it first: a line that changes later is not in what the process has loaded.

    Raises:
        ValueError: if a module cannot be found.
    """
    return _digest_of(modules, PACKAGES, _first_module_source, _first_package_data)


def _digest_of(
    modules: Iterable[str],
    packages: Iterable[str],
    module_source: Callable[[str], bytes],
    package_data: Callable[[str], bytes],
) -> str:
    digest = hashlib.sha256()
    for name in modules:
        digest.update(module_source(name))
    for package in packages:
        digest.update(package_data(package))
    return digest.hexdigest()[:16]


def _module_source(name: str) -> bytes:
    """Name and digest of the source of a module."""
    return f"{name} {hashlib.sha256(_source(name).read_bytes()).hexdigest()}\n".encode()


def _package_data(package: str) -> bytes:
    """Names and digests of the data files of a package."""
    patterns = DATA.get(package, ())
    paths = [path for pattern in patterns for path in sorted(_source(package).parent.glob(pattern))]
    lines = [f"{package}/{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n" for path in paths]
    return "".join(lines).encode()


_first_module_source, _first_package_data = cache(_module_source), cache(_package_data)


def modules_of(modules: Iterable[str], packages: Iterable[str] = PACKAGES) -> set[str]:
    """Returns the names of the modules whose source `code_digest` reads."""
    return set(_closure(frozenset(modules), (*packages,)))


@lru_cache(maxsize=64)
def _closure(modules: frozenset[str], packages: tuple[str, ...]) -> dict[str, Path]:
    """The source files of modules and of what they import from the packages, by the names of the modules.

    If one of the modules is a user's own, the other own modules that they import belong to them too.
    """
    own = any(is_local(name.split(".")[0]) for name in modules if name.split(".")[0] not in PACKAGES)
    found: dict[str, Path] = {}
    waiting = sorted(modules)
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        found[name] = _source(name)
        for imported in _imports(found[name], name):
            package = imported.split(".")[0]
            if (package in packages or (own and is_local(package))) and _is_module(imported):
                waiting.append(imported)
    return found


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


@lru_cache(maxsize=4096)
def _is_module(name: str) -> bool:
    """Whether a name is that of a module with a source file; a folder without one has no source."""
    try:
        spec = find_spec(name)
    except ModuleNotFoundError:  # its parent is a module, and this a name in it
        return False
    return spec is not None and (spec.origin or "").endswith(".py")


@lru_cache(maxsize=4096)
def is_local(package: str) -> bool:
    """Whether a top-level package or module is neither installed nor a part of Python, but a user's own."""
    try:
        spec = find_spec(package)
    except (ModuleNotFoundError, ValueError):
        return False
    places = [*(spec.submodule_search_locations or ()), spec.origin or ""] if spec else []
    if not places or not Path(places[0]).is_absolute():  # built in
        return False
    return not any(Path(places[0]).is_relative_to(folder) for folder in INSTALLED)


def _source(name: str) -> Path:
    try:
        spec = find_spec(name)
    except ModuleNotFoundError:
        spec = None
    if spec is None or not (spec.origin or "").endswith(".py"):
        raise ValueError(f"module {name}: no source found; expected one that can be imported from the current folder")
    return Path(str(spec.origin))
