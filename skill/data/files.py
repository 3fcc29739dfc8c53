"""Reads and writes whole files: limits of their size, digests, JSON texts, and writing completely or not at all.

Files of this program carry a SHA-256 digest of themselves, so that no change of a single bit goes unnoticed. It is
computed over the whole file with zeros in its own place, is found by its mark in the raw bytes, and is compared before
any parser sees them.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
import tempfile
from pathlib import Path
from typing import Any

MARK = b"haptic-skill-sha256:"
UNSEALED = MARK + b"0" * 64
"""What a writer puts into a file for `seal` to replace."""

_SEAL = re.compile(re.escape(MARK) + rb"([0-9a-f]{64})")

TEMPORARY_MARK = ".tmp-"
"""What the name of a temporary file has between the name of its target and eight random characters."""

MAX_DIGITS = 100
"""Largest number of digits of an integer in JSON; more than 308 could not become a float."""

MAX_LENGTH = 10_000_000
"""Largest number of characters of a JSON text; its objects then take below 500 MB."""


def seal(data: bytes) -> bytes:
    """Returns a file with its digest in the place of ``UNSEALED``.

    Raises:
        ValueError: if ``UNSEALED`` or another digest does not occur exactly once.
    """
    places = list(_SEAL.finditer(data))
    if len(places) != 1 or places[0].group() != UNSEALED:
        raise ValueError(f"found {len(places)} places for a digest, expected one with zeros; rename the metadata")
    start, end = places[0].span(1)
    return data[:start] + _digest(data).encode() + data[end:]


def check_seal(data: bytes, *, required: bool = True) -> None:
    """Checks the digest of a file.

    Args:
        data: the file.
        required: whether a file without a digest is refused.

    Raises:
        ValueError: if the digest does not fit or is missing, or there is more than one.
    """
    found = [place.group(1) for place in _SEAL.finditer(data)]
    if required and not found:
        raise ValueError("no SHA-256 digest of the content; expected a file of this program")
    if len(found) > 1:
        raise ValueError(f"damaged: {len(found)} digests, expected one")
    if found and found[0].decode() != _digest(data):
        raise ValueError("damaged: the content differs from its SHA-256 digest; use a copy, or make the file again")


def _digest(data: bytes) -> str:
    """SHA-256 of a file with zeros in the place of its digest."""
    return hashlib.sha256(_SEAL.sub(UNSEALED, data)).hexdigest()


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Reads a regular file of limited size.

    Raises:
        FileNotFoundError: if there is no such file.
        OSError: if it cannot be read.
        ValueError: if it is not a regular file, or larger than ``max_bytes``.
    """
    size = check_regular(path)
    with path.open("rb") as stream:
        data = stream.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise ValueError(f"{max(size, len(data)) / 1e6:.0f} MB, expected at most {max_bytes / 1e6:.0f} MB")
    return data


def check_regular(path: Path) -> int:
    """Returns the size of a regular file; opening a pipe would wait for ever.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if it is not a regular file.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"a {'folder' if stat.S_ISDIR(status.st_mode) else 'device or pipe'}, expected a file")
    return status.st_size


def no_access(error: FileNotFoundError | PermissionError, what: str = "file") -> str:
    """Returns in words why a file cannot be opened."""
    return f"no such {what}" if isinstance(error, FileNotFoundError) else f"no permission to read this {what}"


def write_atomically(path: Path, data: bytes) -> None:
    """Writes a file completely or not at all: to a temporary file in the same folder, which is then renamed.

    The temporary file of ``name`` is ``.name.tmp-`` and eight random characters.

    Args:
        path: target; missing parent folders are created.
        data: content of the file.

    Raises:
        OSError: if the data cannot be written; an existing file at ``path`` is then unchanged.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}{TEMPORARY_MARK}")
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def parse_object(text: bytes | str) -> dict[str, Any]:
    """Returns a JSON object; NaN and infinite numbers are allowed.

    Raises:
        ValueError: if the text is not JSON, not an object, nested too deeply, longer than ``MAX_LENGTH``, or has an
            integer of more than ``MAX_DIGITS`` digits.
    """
    if len(text) > MAX_LENGTH:
        raise ValueError(f"{len(text)} characters, expected at most {MAX_LENGTH}")
    try:
        value = json.loads(text, parse_int=_integer)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    if not isinstance(value, dict):
        raise ValueError(f"found {'null' if value is None else type(value).__name__}, expected an object")
    return value


def _integer(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"an integer of {len(digits)} digits, expected at most {MAX_DIGITS}")
    return int(digits)


def one_line(error: BaseException) -> str:
    """Returns the message of an exception on one line, at most 200 characters of it."""
    return " ".join(str(error).split())[:200] or type(error).__name__


def is_number(value: object) -> bool:
    """Whether a value of JSON is a number, which may be infinite or NaN."""
    return isinstance(value, int | float) and not isinstance(value, bool)
