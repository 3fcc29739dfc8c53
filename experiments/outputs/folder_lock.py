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

PATIENCE = 0.2  # in units of s: a lock may be taken again while its last holder removes it

_held: set[Path] = set()  # lock files of this process


@contextmanager
def locked_folder(folder: Path, *, name: str = LOCK_NAME, subject: Path | None = None) -> Iterator[None]:
    """Holds a folder; creates it, and removes it at the end if it stayed empty. A process may nest it.

    Args:
        folder: to hold.
        name: of the file of the lock.
        subject: what is held, for messages; the folder if it is None.

    Raises:
        OSError: if another process holds it, which the message names, or the folder cannot be written.
    """
    path = folder.resolve() / name  # a link in its place is not followed
    if path in _held:
        yield
        return
    missing = [folder for folder in path.parents if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = FileLock(path)
    try:
        lock.acquire(timeout=PATIENCE)
        path.write_text(f"process {os.getpid()} ({Path(sys.argv[0]).name}, since {datetime.now():%F %T})")
    except Timeout:
        holder = ""
        with suppress(OSError):  # it has just gone
            holder = path.read_text(errors="replace")
        holder = holder or "another process"
        raise OSError(
            f"{subject or folder}: {holder} writes here; wait for it, stop it, or choose another --out"
        ) from None
    except OSError as error:
        raise OSError(f"{path}: the lock cannot be taken ({error.strerror or error})") from error
    _held.add(path)
    try:
        yield
    finally:
        _held.discard(path)
        path.unlink(missing_ok=True)  # while it is held: whoever has opened it sees that it is gone, and tries again
        lock.release()
        for folder in missing:
            with suppress(OSError):  # not empty
                folder.rmdir()


@contextmanager
def locked_file(path: Path) -> Iterator[None]:
    """Holds a file that is to be written, as `locked_folder` holds a folder; removes what a killed process left."""
    with locked_folder(path.parent, name=f".{path.name}.lock", subject=path):
        remove_unfinished(path.parent, [path.name])
        yield


def remove_unfinished(folder: Path, names: Iterable[str]) -> None:
    """Removes the temporary files that a killed process left beside files with these names."""
    temporary = re.compile(rf"\.(.+){re.escape(TEMPORARY_MARK)}[a-z0-9_]{{8}}")
    known = set(names)
    for path in folder.glob(".*"):
        match = temporary.fullmatch(path.name)
        if match and match[1] in known and path.is_file():
            path.unlink()
