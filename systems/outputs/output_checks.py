"""Checks of outputs before the work begins: the place can be written, there is room, and no two files collide."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

RECORDING_SIZE = 60_000  # bytes of a recording or a run, about
REPORT_SIZE = 3_000_000  # bytes of a report with its replay or figures, at most
TEMPORARY = len("..abcdefgh")  # what `write_atomically` adds to the name of a file


def check_folder(folder: Path, *, option: str = "--out", size: int = 0) -> None:
    """Checks that a folder exists or can be made, can be written, and has room for ``size`` bytes.

    Raises:
        OSError: if not. The message names the option, the path and the reason.
    """
    existing = next(path for path in (folder, *folder.absolute().parents) if os.path.lexists(path))
    if not existing.is_dir():
        raise NotADirectoryError(f"{option} {folder}: {existing} is not a folder; choose another place")
    _check_name(folder, existing, option)
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        raise OSError(f"{option} {folder}: cannot write in {existing} ({error.strerror})") from error
    free = shutil.disk_usage(existing).free
    if free < size:
        raise OSError(f"{option} {folder}: needs about {_megabytes(size)}, but only {_megabytes(free)} are free")


def check_file(path: Path, *, option: str = "--out", size: int = 0) -> None:
    """Checks that a file can be written or replaced, as `check_folder` checks a folder.

    Raises:
        OSError: if not. The message names the option, the path and the reason.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{option} {path}: is a folder; expected the name of a file")
    if path.exists() and not path.is_file():
        raise OSError(f"{option} {path}: is a device or a pipe; expected the name of a file")
    check_folder(path.parent, option=option, size=size)
    _check_name(path, path.parent, option)


def require_distinct(files: Mapping[str, Path]) -> None:
    """Checks that the files of a command, by the names of their options, are different ones.

    Raises:
        ValueError: if two are the same. The message names both.
    """
    seen: dict[Path, str] = {}
    for name, path in files.items():
        other = seen.setdefault(path.resolve(), name)
        if other != name:
            raise ValueError(f"{other} and {name} are the same file, {path}; choose another name for one of them")


@contextmanager
def named_errors(path: Path, kept: str) -> Iterator[None]:
    """Turns an OSError while a file is written into one line that names the file and says what is kept."""
    try:
        yield
    except OSError as error:
        raise OSError(f"{path}: not written ({error.strerror or error}); {kept}") from error


def _check_name(path: Path, existing: Path, option: str) -> None:
    longest = os.pathconf(existing if existing.exists() else "/", "PC_NAME_MAX") - TEMPORARY
    if len(os.fsencode(path.name)) > longest:
        raise OSError(f"{option} {path}: the name is longer than {longest} bytes; choose a shorter one")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:,.0f} MB"
