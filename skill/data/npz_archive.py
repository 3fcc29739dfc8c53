"""Reads npz archives of plain arrays within fixed limits, whatever the archive claims."""

from __future__ import annotations

import io
import lzma
import math
import tokenize
import zipfile
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_MEMBERS = 100
MAX_UNPACKED = 100_000_000
"""Largest number of bytes of all arrays together, unless the caller says another."""

PLAIN = "biufU"
"""Kinds of NumPy types that are read: truth values, numbers and texts."""


def read_archive(data: bytes, max_unpacked: int = MAX_UNPACKED) -> dict[str, NDArray[Any]]:
    """Returns the arrays of an npz archive by name. Nothing is unpickled.

    Args:
        data: the file.
        max_unpacked: largest number of bytes of all arrays together.

    Raises:
        ValueError: if this is not such an archive, or it is damaged, encrypted or too large. The message names the
            member.
    """
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as error:
        raise ValueError(f"not a zip archive: {error}") from error
    members = archive.infolist()
    names = [member.filename for member in members]
    if len(names) > MAX_MEMBERS or len(set(names)) < len(names):
        raise ValueError(f"{len(names)} members, expected at most {MAX_MEMBERS}, each once")
    unpacked = sum(member.file_size for member in members)
    if unpacked > max_unpacked:
        raise ValueError(f"{unpacked / 1e6:.0f} MB of arrays, expected at most {max_unpacked / 1e6:.0f} MB")
    return {member.filename.removesuffix(".npy"): _member(archive, member) for member in members}


def _member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    where = f"member '{member.filename[:60]}'"
    if not member.filename.endswith(".npy"):
        raise ValueError(f"{where} is foreign; expected arrays (.npy)")
    try:
        # A member never unpacks to more than its size in the directory, which is limited.
        with archive.open(member) as stream:
            content = stream.read(member.file_size + 1)
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, OSError, EOFError, ValueError, RuntimeError) as error:
        raise ValueError(f"{where} is damaged ({error})") from error
    try:
        return _array(content)
    except ValueError as error:
        raise ValueError(f"{where}: {' '.join(str(error).split())[:120]}") from error


def _array(content: bytes) -> NDArray[Any]:
    """The array of an npy file, in memory of its own."""
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
        elif version == (2, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(stream)
        else:
            raise ValueError(f"npy version {version}, expected (1, 0) or (2, 0)")
    except (SyntaxError, TypeError, MemoryError, RecursionError, OverflowError, tokenize.TokenError) as error:
        raise ValueError(f"damaged npy header ({type(error).__name__})") from error
    if dtype.kind not in PLAIN or dtype.itemsize == 0:
        raise ValueError(f"type {dtype}, expected numbers, truth values or texts")
    if any(type(n) is not int for n in shape):  # NumPy takes a truth value for a number
        raise ValueError(f"shape {shape}, expected whole numbers")
    rest = content[stream.tell() :]
    if min(shape, default=0) < 0 or math.prod(shape) * dtype.itemsize != len(rest):
        raise ValueError(f"shape {shape} of {dtype} in {len(rest)} bytes, expected {math.prod(shape) * dtype.itemsize}")
    return np.frombuffer(rest, dtype).reshape(shape, order="F" if fortran else "C").copy()
