"""Locks: two sessions never write into the same folder or file.

The lock is the kernel's (`flock`, by the package filelock) on a small hidden file that says who holds it. It ends with
its process, however that ends, so that a lock is never stale.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from filelock import FileLock, Timeout

from skill.data.files import TEMPORARY_MARK

LOCK_NAME = ".haptic-skill.lock"
HOLDER = "held by "
"""How the content of a lock begins."""

PATIENCE = 0.2  # in units of s: a lock may be taken again while its last holder removes it

_held: set[Path] = set()  # lock files of this process


class BusyError(OSError):
    """Another process holds the folder or file."""


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Holds a folder; creates it, and removes it at the end if it stayed empty. A process may nest it.

    Raises:
        BusyError: if another process holds the folder. The message names the process.
        OSError: if the folder cannot be written, or something else than a lock has its name.
    """
    with _locked(folder / LOCK_NAME, folder):
        yield


@contextmanager
def locked_file(path: Path) -> Iterator[None]:
    """Holds a file that is to be written, as `locked_folder` holds a folder; removes what a killed process left."""
    with _locked(path.parent / f".{path.name}.lock", path):
        remove_unfinished(path.parent, [path.name])
        yield


def remove_unfinished(folder: Path, names: Iterable[str]) -> list[Path]:
    """Removes the temporary files that a killed process left beside files with these names; returns their paths."""
    temporary = re.compile(rf"\.(.+){re.escape(TEMPORARY_MARK)}[a-z0-9_]{{8}}")
    known, removed = set(names), []
    for path in sorted(folder.glob(".*")):
        match = temporary.fullmatch(path.name)
        if match and match[1] in known and path.is_file():
            path.unlink()
            removed.append(path)
    return removed


@contextmanager
def _locked(path: Path, subject: Path) -> Iterator[None]:
    path = path.parent.resolve() / path.name  # a link in its place is not followed
    if path in _held:
        yield
        return
    missing = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path)
    try:
        try:
            if os.path.lexists(path) and _content(path) is None:
                raise OSError("not a lock of this program; move it away")
            lock.acquire(timeout=PATIENCE)
            path.write_text(f"{HOLDER}process {os.getpid()} ({Path(sys.argv[0]).name}, since {datetime.now():%F %T})")
        except Timeout:
            holder = (_content(path) or "").removeprefix(HOLDER) or "another process"
            raise BusyError(f"{subject}: {holder} writes here; wait for it, stop it, or choose another --out") from None
        except OSError as error:
            raise OSError(f"{path}: the lock cannot be taken ({error.strerror or error})") from error
        try:
            _held.add(path)
            yield
        finally:
            _held.discard(path)
            path.unlink(
                missing_ok=True
            )  # while it is held: whoever has opened it sees that it is gone, and tries again
            lock.release()
    finally:
        for folder in missing:
            with suppress(OSError):  # not empty
                folder.rmdir()


def _content(path: Path) -> str | None:
    """The text in a lock, empty if it is new or just gone; None if something else is in its place."""
    try:
        text = path.read_bytes().decode(errors="replace") if path.is_file() and not path.is_symlink() else None
    except FileNotFoundError:
        return ""
    if text is None:
        return None if os.path.lexists(path) else ""
    return text if not text or text.startswith(HOLDER) else None
