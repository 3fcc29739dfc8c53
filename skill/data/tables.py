"""Reads and writes validated tables as Parquet files with a JSON header and a digest; writes are atomic."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from skill.data.files import (
    MAX_LENGTH,
    UNSEALED,
    check_regular,
    check_seal,
    no_access,
    one_line,
    parse_object,
    read_bounded,
    seal,
    write_atomically,
)

if TYPE_CHECKING:
    import pyarrow.parquet as pq  # part of an extra: the learner works without it

MAX_ROWS = 300_000
"""Largest number of samples of a file: five minutes at 1 kHz. Reading them takes below 500 MB and a second."""

MAX_BYTES = 100_000_000
"""Largest size of a file; ``MAX_ROWS`` samples of 41 columns have at most 99 MB."""

MIN_CHUNK, MAX_ROW_BYTES = 65_536, 20
"""Bytes to which a column may unpack, and more for each row; numbers need 8."""


KINDS: dict[type, str] = {bool: "true or false", str: "a text", dict: "an object"}
"""What entries of a header are, for messages."""


class TooShortError(ValueError):
    """A table has too few samples."""


def validate_table(table: pd.DataFrame, columns: Sequence[str], where: str, *, min_rows: int = 2) -> None:
    """Checks the columns, the number of rows, that all numbers are finite, and that ``time`` increases.

    Args:
        table: table to check.
        columns: exact set of columns, in any order; ``time`` is one of them.
        where: name of the source, for error messages.
        min_rows: minimum number of rows.

    Raises:
        TooShortError: if there are fewer rows.
        ValueError: if another check fails. The message names ``where``, what was found and what was expected.
    """
    names = list(table.columns)
    missing = [c for c in columns if c not in names]
    unknown = [c for c in names if c not in columns]
    if missing or unknown:
        raise ValueError(
            f"{where}: missing columns {missing}, unknown columns {unknown}; expected exactly {list(columns)}"
        )
    twice = sorted({c for c in names if names.count(c) > 1})
    if twice:
        raise ValueError(f"{where}: columns {twice} occur more than once; expected exactly {list(columns)}")
    if len(table) < min_rows:
        raise TooShortError(f"{where}: found {len(table)} samples, expected at least {min_rows}")
    for column in columns:
        if not _holds_numbers(table[column]):
            raise ValueError(f"{where}: column '{column}' has type {table[column].dtype}, expected numbers")
        bad = np.flatnonzero(~np.isfinite(table[column].to_numpy(dtype=float)))
        if bad.size:
            raise ValueError(
                f"{where}: column '{column}' is not finite in row {bad[0]}"
                f" ({bad.size} such rows); expected finite numbers"
            )
    steps = np.diff(table["time"].to_numpy(dtype=float))
    if np.any(steps <= 0):
        raise ValueError(f"{where}: column 'time' does not increase after row {int(np.argmax(steps <= 0))}")


def _holds_numbers(column: pd.Series) -> bool:
    """Whether a column holds real numbers; booleans are none."""
    types = pd.api.types
    return types.is_numeric_dtype(column) and not (types.is_bool_dtype(column) or types.is_complex_dtype(column))


def write_table(
    table: pd.DataFrame,
    columns: Sequence[str],
    path: Path,
    *,
    kind: str,
    version: int,
    header: dict[str, Any],
) -> None:
    """Writes some columns of a table as a Parquet file, as 64-bit floats, with a digest.

    Args:
        table: table with at least ``columns``.
        columns: columns to write, in this order.
        path: target file.
        kind: kind of file; the name of the metadata entry that holds the header.
        version: version of the file format, stored in the header.
        header: JSON-serialisable values to store with the table.

    Raises:
        ValueError: if the table has more than ``MAX_ROWS`` rows, or the header is too long.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    _check_length(len(table), str(path))
    rows = pa.Table.from_pandas(table[list(columns)].astype(float), preserve_index=False)
    rows = rows.replace_schema_metadata(None)
    text = json.dumps({"format_version": version, **header})
    if len(text) > MAX_LENGTH:
        raise ValueError(f"{path}: metadata of {len(text)} characters, expected at most {MAX_LENGTH}")
    sink = pa.BufferOutputStream()
    # The Arrow schema would hold a second copy of the metadata.
    with pq.ParquetWriter(sink, rows.schema, store_schema=False) as writer:
        writer.write_table(rows)
        writer.add_key_value_metadata({kind: text, "sha256": UNSEALED.decode()})
    write_atomically(path, seal(sink.getvalue().to_pybytes()))


def read_table(
    path: Path,
    *,
    kind: str,
    version: int,
    entries: Mapping[str, type],
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Reads a file of `write_table`; whoever makes something of the table validates it.

    Args:
        path: file to read.
        kind: expected kind of file.
        version: expected version of the file format.
        entries: types of the entries that the header must have.

    Returns:
        The table and its header, without the version.

    Raises:
        ValueError: if the file is missing, truncated, changed, too large, or of another kind or version. The message
            names the file.
    """
    with named_parquet_errors(path, f"{kind} file"):
        file = _open(path)
        table = file.read().to_pandas(ignore_metadata=True)
    return table, _header(file.metadata.metadata or {}, path, kind=kind, version=version, entries=entries)


def is_rig_run(path: Path) -> bool:
    """Whether a file is a rig run; else it is a demonstration.

    Raises:
        ValueError: if it is neither, missing, truncated, changed or too large. The message names the file.
    """
    with named_parquet_errors(path, "file"):
        metadata = _open(path, sealed=False).metadata.metadata or {}
    if not {b"demonstration", b"rig_run"} & metadata.keys():
        raise ValueError(f"{path}: neither a demonstration nor a rig run (a Parquet file of another kind)")
    return b"rig_run" in metadata


def _open(path: Path, *, sealed: bool = True) -> pq.ParquetFile:
    """Returns a Parquet file in memory, after checking its digest, if it must have one, and to what it will unpack."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    data = read_bounded(Path(path), MAX_BYTES)
    check_seal(data, required=sealed)
    file = pq.ParquetFile(pa.BufferReader(data))
    groups = [file.metadata.row_group(k) for k in range(file.num_row_groups)]
    rows = max(file.metadata.num_rows, sum(group.num_rows for group in groups))
    _check_length(rows, str(path))
    size = sum(group.total_byte_size for group in groups)
    most = file.metadata.num_columns * (MIN_CHUNK + MAX_ROW_BYTES * rows)
    if size > most:
        raise ValueError(f"{size} bytes after unpacking, expected at most {most} for {rows} samples")
    return file


@contextmanager
def named_parquet_errors(path: Path, what: str = "file") -> Iterator[None]:
    """Turns all errors of reading a Parquet file into one `ValueError` that names it."""
    import pyarrow as pa

    try:
        check_regular(path)
        yield
    except (FileNotFoundError, PermissionError) as error:
        raise ValueError(f"{path}: {no_access(error, what)}") from None
    except (pa.ArrowException, OSError, ValueError, MemoryError, OverflowError) as error:
        raise ValueError(f"{path}: not a complete Parquet file ({one_line(error)})") from error


def _header(
    metadata: dict[bytes, bytes], path: Path, *, kind: str, version: int, entries: Mapping[str, type]
) -> dict[str, Any]:
    """Returns the header of a file, without its version."""
    raw = metadata.get(kind.encode())
    if raw is None:
        raise ValueError(f"{path}: no '{kind}' metadata; expected a {kind} file of this program")
    try:
        header = parse_object(raw)
    except ValueError as error:
        raise ValueError(f"{path}: damaged '{kind}' metadata ({one_line(error)})") from error
    found = header.pop("format_version", None)
    if type(found) is not int or found != version:
        raise ValueError(f"{path}: {kind} format version {found}, expected {version}")
    for name, expected in entries.items():
        if not isinstance(header.get(name), expected):
            found = f"{header.get(name)!r:.60}"
            raise ValueError(f"{path}: '{name}' in the metadata is {found}, expected {KINDS[expected]}")
    return header


def _check_length(rows: int, where: str) -> None:
    if rows > MAX_ROWS:
        raise ValueError(f"{where}: found {rows} samples, expected at most {MAX_ROWS}; lower the sampling rate")
