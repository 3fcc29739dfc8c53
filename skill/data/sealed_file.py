"""Files that carry a SHA-256 digest of themselves, so that no change of a single bit goes unnoticed.

The digest is computed over the whole file with zeros in its own place. It is found by its mark in the raw bytes and
compared before any parser sees them.
"""

from __future__ import annotations

import hashlib
import re
import stat
from pathlib import Path

MARK = b"haptic-skill-sha256:"
UNSEALED = MARK + b"0" * 64
"""What a writer puts into a file for `seal` to replace."""

_SEAL = re.compile(re.escape(MARK) + rb"([0-9a-f]{64})")


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


def is_sealed(data: bytes) -> bool:
    """Returns whether a file carries a digest.

    Raises:
        ValueError: if it carries one that does not fit, or more than one.
    """
    found = [place.group(1) for place in _SEAL.finditer(data)]
    if len(found) > 1:
        raise ValueError(f"damaged: {len(found)} digests, expected one")
    if found and found[0].decode() != _digest(data):
        raise ValueError("damaged: the content differs from its SHA-256 digest; use a copy, or make the file again")
    return bool(found)


def read_bounded(path: Path, max_bytes: int) -> bytes:
    """Reads a regular file of limited size.

    Raises:
        FileNotFoundError: if there is no such file.
        OSError: if it cannot be read.
        ValueError: if it is not a regular file, or larger than ``max_bytes``.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"a {'folder' if stat.S_ISDIR(status.st_mode) else 'device or pipe'}, expected a file")
    with path.open("rb") as stream:
        data = stream.read(max_bytes + 1)
    if len(data) > max_bytes:
        raise ValueError(f"{max(status.st_size, len(data)) / 1e6:.0f} MB, expected at most {max_bytes / 1e6:.0f} MB")
    return data


def _digest(data: bytes) -> str:
    """SHA-256 of a file with zeros in the place of its digest."""
    return hashlib.sha256(_SEAL.sub(UNSEALED, data)).hexdigest()
