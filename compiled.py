"""Compilation of numerical functions to machine code, which is kept between processes, checkouts and clones."""

from __future__ import annotations

import ast
import hashlib
import os
import pickle
import warnings
from collections import namedtuple
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import FunctionCache, _CacheLocator
from numba.core.types import unliteral

F = TypeVar("F", bound=Callable[..., Any])

ROOMS = ("models", "skill", "systems", "experiments")
"""The packages that may hold compiled functions, or constants that they use."""

DECORATORS = {"compiled", "compiled_within"}

KEPT = Path.home() / ".cache" / "haptic_skill"


def code_digest(sources: list[str]) -> str:
    """Returns a digest of what compiled functions can see in the modules with these texts.

    These are the compiled functions, all other statements outside of functions, and what functions these call.
    Comments, docstrings, methods, and functions that run in Python only do not count.
    """
    seen: list[ast.AST] = []
    plain: list[ast.FunctionDef] = []
    for node in (node for source in sources for node in ast.parse(source).body):
        if isinstance(node, ast.FunctionDef) and not DECORATORS & set(map(ast.unparse, node.decorator_list)):
            plain.append(node)
        elif isinstance(node, ast.ClassDef):
            seen += [
                *node.bases,
                *node.decorator_list,
                *(part for part in node.body if not isinstance(part, ast.FunctionDef)),
            ]
        elif not isinstance(node, (ast.Import, ast.ImportFrom)):
            seen.append(node)
    found = [part for part in seen if not (isinstance(part, ast.Expr) and isinstance(part.value, ast.Constant))]
    for part in found:  # grows by the functions that are called
        names = {node.id for node in ast.walk(part) if isinstance(node, ast.Name)}
        called = [function for function in plain if function.name in names]
        found += called
        plain = [function for function in plain if function not in called]
    for function in (part for part in found if isinstance(part, ast.FunctionDef)):
        if ast.get_docstring(function) is not None:
            function.body = function.body[1:]
    return hashlib.sha256("\n".join(map(ast.dump, found)).encode()).hexdigest()[:16]


@cache
def _digest() -> str:
    """Returns `code_digest` of this checkout; it is kept, since parsing takes as long as starting."""
    own = Path(__file__)
    paths = (path for room in ROOMS for path in sorted(own.parent.glob(f"{room}/**/*.py")))
    sources = [path.read_bytes() for path in (own, *paths)]
    known = KEPT / "sources" / hashlib.sha256(b"\0".join(sources)).hexdigest()[:32]
    if known.exists():
        return known.read_text()
    digest = code_digest([source.decode() for source in sources])
    with suppress(OSError):  # `KeptCode` warns
        known.parent.mkdir(parents=True, exist_ok=True)
        partial = known.with_suffix(f".{os.getpid()}")
        partial.write_text(digest)
        partial.replace(known)
    return digest


class CodeLocator(_CacheLocator):  # type: ignore[misc]
    """Tells numba where the code of a function of ours is kept: by module and name, for all checkouts of equal code.

    By itself numba compiles again for each path, and does not when a function changes that the function calls.
    """

    def __init__(self, module: str, py_file: str, line: int) -> None:
        self._module, self._py_file, self._lineno = module, py_file, line  # the last two stand in warnings of numba

    def get_cache_path(self) -> str:  # the three that numba asks for
        """Returns the folder."""
        return str(KEPT / _digest())

    def get_source_stamp(self) -> str:
        """Returns what kept code must have been compiled from."""
        return _digest()

    def get_disambiguator(self) -> str:
        """Returns what tells functions of one name apart."""
        return self._module

    @classmethod
    def from_function(cls, py_func: FunctionType, py_file: str) -> CodeLocator | None:
        """Returns the locator of a function; None if it is not one of ours."""
        if py_func.__module__.split(".")[0] not in ROOMS:
            return None
        locator = cls(py_func.__module__, py_file, py_func.__code__.co_firstlineno)
        locator.ensure_cache_path()  # type: ignore[no-untyped-call]
        return locator


_OTHERS = "UserProvidedCacheLocator,InTreeCacheLocator,UserWideCacheLocator,IPythonCacheLocator"
numba.config.CACHE_LOCATOR_CLASSES = f"compiled.CodeLocator,{_OTHERS}"  # type: ignore[attr-defined]


class KeptCode(FunctionCache):  # type: ignore[misc]
    """The kept code of a function. What cannot be read or written is compiled again, with a warning."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Returns the code for a signature, or None."""
        try:
            return super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception as error:  # a damaged file can raise anything
            _warn(error)
            with suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps the code for a signature, where that is possible."""
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except (OSError, EOFError, pickle.PickleError) as error:
            _warn(error)


def _warn(error: Exception) -> None:
    _warn_of(f"{type(error).__name__}: {error}")


@cache  # a text is shown once
def _warn_of(text: str) -> None:
    warnings.warn(f"{KEPT}: {text}; what is not kept is compiled again, a minute", RuntimeWarning, stacklevel=4)


def is_kept(function: Callable[..., Any]) -> bool:
    """Returns whether code of a compiled function is kept for this version of Python."""
    cache = getattr(function, "_cache", None)
    return not isinstance(cache, KeptCode) or Path(cache.cache_path, cache._cache_file._index_name).exists()


def _compiled(function: F, **options: Any) -> F:
    """Returns the function compiled by numba: one version for a type, where numba makes another for each literal."""
    found: Any = numba.njit(error_model="numpy", **options)(function)
    if not hasattr(found, "get_call_template"):  # by NUMBA_DISABLE_JIT
        return function
    try:
        found._cache = KeptCode(function)  # type: ignore[no-untyped-call]
    except OSError as error:
        _warn(error)
    for_types = found.get_call_template
    found.get_call_template = lambda types, kws: for_types([unliteral(t) for t in types], kws)  # type: ignore[no-untyped-call]
    return cast(F, found)


def compiled(function: F) -> F:
    """Returns the function compiled for the types of its arguments, which are positional; later processes load it."""
    return _compiled(function, no_cfunc_wrapper=True)


def compiled_within(function: F) -> F:
    """Returns the function compiled as a part of each compiled one that calls it.

    A level of calls costs seconds of compilation, since all code below a function is compiled again with it.
    """
    return _compiled(function, no_cfunc_wrapper=True, inline="always")


def numbers_class(name: str, parameters: type, module: str) -> Any:
    """Returns a class of named tuples with the fields of a dataclass, which compiled functions can take.

    Args:
        name: of the class; the module must hold it under this name, so that compiled code can be kept.
        parameters: the dataclass; its fields are numbers.
        module: the module that holds the class.
    """
    return namedtuple(name, [field.name for field in fields(parameters)], module=module)
