"""Reads recordings from Parquet files of other programs, and from the demonstrations and rig runs of this one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from skill.data.demonstration import ACTIONS
from skill.data.files import check_seal, read_bounded
from skill.data.tables import named_parquet_errors
from skill.recordings.column_table import (
    NO_CHOICE,
    ColumnChoice,
    Selection,
    check_length,
    select_columns,
    table_recordings,
)
from skill.recordings.columns import listed
from skill.recordings.recording import Recording

MAX_BYTES = 500_000_000
"""Largest size of a file; 3.6 million samples of seven 64-bit numbers have at most 0.2 GB."""

MAX_UNPACKED = 1_000_000_000
"""Largest number of bytes to which the columns that are read may unpack."""

_OWN_KINDS = (b"demonstration", b"rig_run")
_TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def read_parquet_file(path: Path, choice: ColumnChoice = NO_CHOICE) -> list[Recording]:
    """Reads the recordings of a Parquet file.

    A column of time stamps, durations or times of the day is a time in its own unit. In a demonstration or a rig run of
    this program the action of the operator (``rx ry rz``) is no orientation, and is left out unless the user names it.
    """
    file = open_parquet(path)
    schema = file.schema_arrow
    own = any(kind in (schema.metadata or {}) for kind in _OWN_KINDS)
    named = {text.partition("=")[2].strip().partition(":")[0] for text in choice.columns}
    names = dict.fromkeys(name for name in schema.names if not (own and name in ACTIONS and name not in named))
    selection = select_columns(list(names), str(path), choice)
    rows = read_columns(file, selection.names, path)
    return table_recordings(*_frame(rows, selection, path), str(path), path.name)


def open_parquet(path: Path) -> pq.ParquetFile:
    """Opens a Parquet file in memory.

    Raises:
        ValueError: if the file is missing, damaged or too large. The message names it.
    """
    with named_parquet_errors(path):
        data = read_bounded(path, MAX_BYTES)
        check_seal(data, required=False)
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
    check_length(file.metadata.num_rows, str(path))
    return file


def read_columns(file: pq.ParquetFile, names: Sequence[str], path: Path) -> pa.Table:
    """Reads some columns of a Parquet file, after checking to what they unpack.

    Raises:
        ValueError: if a column is missing or there twice, or the columns are damaged or too large.
    """
    found = file.schema_arrow.names
    missing = [name for name in names if name not in found]
    if missing:
        raise ValueError(f"{path}: no column {listed(missing)}; columns are {listed(found)}")
    twice = [name for name in names if found.count(name) > 1]
    if twice:
        raise ValueError(f"{path}: columns {listed(twice)} occur more than once; rename all but one")
    groups = [file.metadata.row_group(k) for k in range(file.num_row_groups)]
    chunks = [group.column(k) for group in groups for k in range(file.metadata.num_columns)]
    paths = (*names, *(f"{name}.list.element" for name in names))
    size = sum(chunk.total_uncompressed_size for chunk in chunks if chunk.path_in_schema in paths)
    if size > MAX_UNPACKED:
        raise ValueError(
            f"{path}: columns {listed(names)} unpack to {size / 1e6:.0f} MB, expected at most"
            f" {MAX_UNPACKED / 1e6:.0f} MB"
        )
    with named_parquet_errors(path):
        return file.read(columns=names).select(names)


def _is_time(kind: pa.DataType) -> bool:
    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind))


def plain_column(column: pa.ChunkedArray, where: str, *, number: bool) -> pd.Series:
    """Returns a column as numbers, or as labels: numbers, texts, truth values and times.

    Raises:
        ValueError: if its type holds neither, or its bytes are no text in UTF-8. The message begins with ``where``.
    """
    types, kind = pa.types, column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    numeric = types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_null(kind)
    if number and not numeric:
        raise ValueError(f"{where} has type {str(kind)[:60]}, expected numbers")
    if types.is_nested(kind):
        raise ValueError(f"{where} has type {str(kind)[:60]}, expected single values; an empty name leaves it out")
    if number and not types.is_integer(column.type):
        column = column.cast(kind).cast(pa.float64())
    elif types.is_binary(kind) or types.is_large_binary(kind) or types.is_binary_view(kind):
        try:
            column = column.cast(kind).cast(pa.string())
        except pa.ArrowInvalid:
            raise ValueError(f"{where} has bytes that are no text in UTF-8") from None
    series: pd.Series = column.to_pandas()
    return series


def _frame(rows: pa.Table, selection: Selection, path: Path) -> tuple[pd.DataFrame, Selection]:
    """A table as pandas columns; time stamps become integers, and their unit goes into the selection."""
    time, *channels = selection.columns
    kind = rows.schema.field(time.name).type
    if _is_time(kind):
        ticks = rows[time.name].cast(pa.int32() if pa.types.is_time32(kind) else pa.int64())
        rows = rows.set_column(rows.schema.get_field_index(time.name), time.name, ticks)
        time = replace(time, size=_TIME_UNITS[kind.unit], stated=True)
    numbers = {column.name for column in selection.columns}
    table = {
        name: plain_column(rows[name], f"{path}: column '{name}'", number=name in numbers) for name in selection.names
    }
    return pd.DataFrame(table), replace(selection, columns=(time, *channels))
