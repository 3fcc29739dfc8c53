"""Locks: two sessions never write into the same folder or file.

The lock is the kernel's (`flock`) on a small hidden file. It ends with the process that holds it, however that ends, so
that a lock is never stale and the number of a process may be used again. The file says who holds the lock.
"""

from __future__ import annotations

import fcntl
import json
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

LOCK_NAME = ".haptic-skill.lock"

_held: set[Path] = set()  # lock files of this process


class BusyError(OSError):
    """Another process holds the folder or file."""


@contextmanager
def locked_folder(folder: Path) -> Iterator[None]:
    """Holds a folder; creates it, and removes it at the end if it stayed empty. A process may nest it.

    Raises:
        BusyError: if another process holds the folder. The message names the process.
        OSError: if the folder cannot be written.
    """
    with _held_lock(folder / LOCK_NAME, folder):
        yield


@contextmanager
def locked_file(path: Path) -> Iterator[None]:
    """Holds a file that is to be written, as `locked_folder` holds a folder."""
    with _held_lock(path.parent / f".{path.name}.lock", path):
        yield


@contextmanager
def _held_lock(lock: Path, subject: Path) -> Iterator[None]:
    lock = lock.parent.resolve() / lock.name  # a link in its place is not followed
    if lock in _held:
        yield
        return
    missing = [folder for folder in lock.parents if not folder.exists()]
    lock.parent.mkdir(parents=True, exist_ok=True)
    try:
        handle = _acquire(lock, subject)
        _held.add(lock)
        try:
            yield
        finally:
            _held.discard(lock)
            lock.unlink(missing_ok=True)  # while it is held, so that nobody's new lock is removed
            os.close(handle)
    finally:
        for folder in missing:
            with suppress(OSError):  # not empty
                folder.rmdir()


def _acquire(lock: Path, subject: Path) -> int:
    """Returns the file descriptor that holds the lock."""
    while True:
        handle = -1
        try:
            handle = _open(lock)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(handle, lock):
                os.ftruncate(handle, 0)
                os.write(handle, json.dumps(_this_process()).encode())
                return handle
        except BlockingIOError:
            holder = _holder(handle)
            os.close(handle)
            message = f"{subject}: {holder} writes here; wait for it, stop it, or choose another --out"
            raise BusyError(message) from None
        except OSError as error:
            if handle >= 0:
                os.close(handle)
            raise OSError(f"{lock}: the lock cannot be taken ({error.strerror or error})") from error
        os.close(handle)  # its last holder has just removed it


def _open(lock: Path) -> int:
    """Opens or creates a lock file, and refuses what this program did not make."""
    foreign = "not a lock of this program; move it away"
    try:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
    except OSError as error:
        raise OSError(foreign if lock.is_symlink() or lock.is_dir() else error.strerror) from error
    if not stat.S_ISREG(os.fstat(handle).st_mode) or not _is_lock(os.pread(handle, 4096, 0)):
        os.close(handle)
        raise OSError(foreign)
    return handle


def _is_lock(content: bytes) -> bool:
    """Whether the content of a file is that of a lock; it is empty for a moment."""
    try:
        return not content or {*json.loads(content)} == {*_this_process()}
    except (ValueError, TypeError):
        return False


def _is_at(handle: int, path: Path) -> bool:
    """Whether an open file is still the one at a path."""
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except FileNotFoundError:
        return False


def _this_process() -> dict[str, str | int]:
    started = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
    return {"pid": os.getpid(), "started": started, "command": Path(sys.argv[0]).name}


def _holder(handle: int) -> str:
    try:
        owner = json.loads(os.pread(handle, 4096, 0))
        return f"process {owner['pid']} ({owner['command']}, since {owner['started']})"
    except (ValueError, KeyError, TypeError):  # the lock is a moment old
        return "another process"
