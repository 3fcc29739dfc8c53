"""Reads recordings from Parquet files of other programs, and from the demonstrations and rig runs of this one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
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
    chosen: list[Selection] = []

    def choose(schema: pa.Schema) -> Sequence[str]:
        own = any(kind in (schema.metadata or {}) for kind in _OWN_KINDS)
        named = {text.partition("=")[2].strip().partition(":")[0] for text in choice.columns}
        names = dict.fromkeys(name for name in schema.names if not (own and name in ACTIONS and name not in named))
        chosen.append(select_columns(list(names), str(path), choice))
        time, *_ = chosen[0].columns
        for name in chosen[0].names:
            field = schema.field(schema.names.index(name))
            if not (name == time.name and _is_time(field.type)):
                option = {chosen[0].trial: "--trial-column", chosen[0].phase: "--phase-column"}.get(name)
                remedy = f"; {option} '' leaves it out" if option else ""
                check_type(field, str(path), number=name in chosen[0].numbers, remedy=remedy)
        return chosen[0].names

    rows = read_columns(path, choose)
    [selection] = chosen
    return table_recordings(*_frame(rows, selection, path), str(path), path.name)


def read_columns(path: Path, choose: Callable[[pa.Schema], Sequence[str]], *, width: int = 1) -> pa.Table:
    """Reads some columns of a Parquet file, after checking to what they would unpack.

    Args:
        path: file to read.
        choose: returns the names of the columns to read; it is given the schema, with the metadata of the file. Its
            errors are passed on.
        width: largest number of numbers of a row in a column of lists.

    Raises:
        ValueError: if the file is missing, damaged or too large. The message names it.
    """
    with named_parquet_errors(path):
        data = read_bounded(Path(path), MAX_BYTES)
        check_seal(data, required=False)
        metadata = pq.read_metadata(pa.BufferReader(data))
        groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
        chunks = [group.column(k) for group in groups for k in range(metadata.num_columns)]
        schema = metadata.schema.to_arrow_schema().with_metadata(metadata.metadata)
    rows = max(metadata.num_rows, sum(group.num_rows for group in groups))
    check_length(rows, str(path))
    names = list(dict.fromkeys(choose(schema)))
    missing = [name for name in names if name not in schema.names]
    if missing:
        raise ValueError(f"{path}: no column {listed(missing)}; columns are {listed(schema.names)}")
    twice = [name for name in names if schema.names.count(name) > 1]
    if twice:
        raise ValueError(f"{path}: columns {listed(twice)} occur more than once; rename all but one")
    size, counts = 0, Counter[str]()
    for chunk in chunks:
        # PyArrow reads "a.b" too where "a" is asked for.
        if any(chunk.path_in_schema == name or chunk.path_in_schema.startswith(f"{name}.") for name in names):
            size += chunk.total_uncompressed_size
            counts[chunk.path_in_schema] += chunk.num_values
    values = max(counts.values(), default=0)
    if size > MAX_UNPACKED or values > rows * width:
        raise ValueError(
            f"{path}: columns {listed(names)} unpack to {size / 1e6:.0f} MB and {values} values in {rows} rows,"
            f" expected at most {MAX_UNPACKED / 1e6:.0f} MB and {width} values in a row"
        )
    texts = [name for name in names if pa.types.is_string(schema.field(name).type)]
    with named_parquet_errors(path):
        file = pq.ParquetFile(pa.BufferReader(data), read_dictionary=texts, page_checksum_verification=True)
        table: pa.Table = file.read(columns=names)
        return table.select(names).replace_schema_metadata(None)


def check_type(field: pa.Field, where: str, *, number: bool, remedy: str = "") -> None:
    """Refuses a column whose type holds no numbers, or no labels: numbers, texts, truth values and times.

    Raises:
        ValueError: naming the column, its type and the remedy.
    """
    types, kind = pa.types, field.type
    if types.is_dictionary(kind):
        kind = kind.value_type
    numeric = types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind) or types.is_null(kind)
    if types.is_nested(kind) or (number and not numeric):
        expected = "numbers" if number else "single values"
        raise ValueError(f"{where}: column '{field.name}' has type {str(field.type)[:60]}, expected {expected}{remedy}")


def _is_bytes(kind: pa.DataType) -> bool:
    types = pa.types
    return bool(types.is_binary(kind) or types.is_large_binary(kind) or types.is_binary_view(kind))


def _is_time(kind: pa.DataType) -> bool:
    return bool(pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time(kind))


def plain_column(column: pa.ChunkedArray, where: str, *, number: bool) -> pd.Series:
    """Returns a column of a type that `check_type` accepts, as numbers or labels.

    Raises:
        ValueError: if its bytes are no text in UTF-8. The message begins with ``where``.
    """
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if number and not pa.types.is_integer(column.type):
        column = column.cast(kind).cast(pa.float64())
    elif _is_bytes(kind):
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
