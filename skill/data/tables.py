"""Reads and writes validated tables as Parquet files with a JSON header; writes are atomic."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq


def validate_table(table: pd.DataFrame, columns: Sequence[str], where: str, *, min_rows: int = 2) -> None:
    """Checks the columns, the number of rows, that all numbers are finite, and that ``time`` increases.

    Args:
        table: table to check.
        columns: exact set of columns, in any order; ``time`` is one of them.
        where: name of the source, for error messages.
        min_rows: minimum number of rows.

    Raises:
        ValueError: if a check fails. The message names ``where``, what was found and what was expected.
    """
    missing = [c for c in columns if c not in table.columns]
    unknown = [c for c in table.columns if c not in columns]
    if missing or unknown:
        raise ValueError(
            f"{where}: missing columns {missing}, unknown columns {unknown}; expected exactly {list(columns)}"
        )
    if len(table) < min_rows:
        raise ValueError(f"{where}: found {len(table)} samples, expected at least {min_rows}")
    for column in columns:
        if not pd.api.types.is_numeric_dtype(table[column]):
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


def write_atomically(path: Path, data: bytes) -> None:
    """Writes a file completely or not at all: to a temporary file in the same folder, which is then renamed.

    Args:
        path: target; missing parent folders are created.
        data: content of the file.

    Raises:
        OSError: if the data cannot be written; an existing file at ``path`` is then unchanged.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
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


def write_table(
    table: pd.DataFrame,
    columns: Sequence[str],
    path: Path,
    *,
    kind: str,
    version: int,
    header: dict[str, Any],
) -> None:
    """Writes some columns of a table as a Parquet file, as 64-bit floats.

    Args:
        table: table with at least ``columns``.
        columns: columns to write, in this order.
        path: target file.
        kind: kind of file; the name of the metadata entry that holds the header.
        version: version of the file format, stored in the header.
        header: JSON-serialisable values to store with the table.
    """
    rows = pa.Table.from_pandas(table[list(columns)].astype(float), preserve_index=False)
    text = json.dumps({"format_version": version, **header})
    rows = rows.replace_schema_metadata({**(rows.schema.metadata or {}), kind.encode(): text.encode()})
    sink = pa.BufferOutputStream()
    pq.write_table(rows, sink)
    write_atomically(path, sink.getvalue().to_pybytes())


def read_table(
    path: Path, columns: Sequence[str], *, kind: str, version: int, keys: Sequence[str], min_rows: int = 2
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Reads and validates a file of `write_table`.

    Args:
        path: file to read.
        columns: columns that the table must have.
        kind: expected kind of file.
        version: expected version of the file format.
        keys: entries that the header must have.
        min_rows: minimum number of rows.

    Returns:
        The table and its header, without the version.

    Raises:
        ValueError: if the file is missing, truncated, of another kind or version, or fails `validate_table`.
            The message names the file.
    """
    try:
        rows = pq.read_table(path)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such {kind} file") from None
    except (pa.ArrowInvalid, OSError) as error:
        raise ValueError(f"{path}: not a complete Parquet file ({error})") from error
    raw = (rows.schema.metadata or {}).get(kind.encode())
    if raw is None:
        raise ValueError(f"{path}: no '{kind}' metadata; expected a {kind} file of this program")
    try:
        header = json.loads(raw)
    except ValueError as error:
        raise ValueError(f"{path}: damaged '{kind}' metadata ({error})") from error
    found = header.pop("format_version", None)
    if found != version:
        raise ValueError(f"{path}: {kind} format version {found}, expected {version}")
    missing = [key for key in keys if key not in header]
    if missing:
        raise ValueError(f"{path}: '{kind}' metadata lacks {missing}; expected a {kind} file of this program")
    table = rows.to_pandas()
    validate_table(table, columns, str(path), min_rows=min_rows)
    return table, header
