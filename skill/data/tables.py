"""Validated tables in Parquet files, whose metadata travel in the file and which are written whole or not at all."""

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


def validate_table(table: pd.DataFrame, columns: Sequence[str], where: str, *, least: int = 2) -> None:
    """Checks that a table has exactly ``columns``, ``least`` rows, finite numbers, and a ``time`` that increases.

    Raises:
        ValueError: naming ``where``, what was found and what was expected.
    """
    missing = [c for c in columns if c not in table.columns]
    unknown = [c for c in table.columns if c not in columns]
    if missing or unknown:
        raise ValueError(
            f"{where}: missing columns {missing}, unknown columns {unknown}; expected exactly {list(columns)}"
        )
    if len(table) < least:
        raise ValueError(f"{where}: found {len(table)} samples, expected at least {least}")
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
    """Writes ``data`` under a temporary name in the same folder and renames it: whole or not at all."""
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
    """Writes ``columns`` of a table; ``header`` is stored as JSON under the name ``kind``."""
    rows = pa.Table.from_pandas(table[list(columns)].astype(float), preserve_index=False)
    text = json.dumps({"format_version": version, **header})
    rows = rows.replace_schema_metadata({**(rows.schema.metadata or {}), kind.encode(): text.encode()})
    sink = pa.BufferOutputStream()
    pq.write_table(rows, sink)
    write_atomically(path, sink.getvalue().to_pybytes())


def read_table(
    path: Path, columns: Sequence[str], *, kind: str, version: int, keys: Sequence[str], least: int = 2
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Reads and validates what `write_table` wrote.

    Args:
        path: of the file.
        columns: that it must have.
        kind: under whose name the header is stored.
        version: of the format.
        keys: that the header must have.
        least: number of rows.

    Raises:
        ValueError: naming the file and its fault: missing, truncated, another kind or version, wrong columns.
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
        raise ValueError(f"{path}: '{kind}' metadata lack {missing}; expected a {kind} file of this program")
    table = rows.to_pandas()
    validate_table(table, columns, str(path), least=least)
    return table, header
