"""Reads recordings from CSV files: text with commas, semicolons or tabs, a line of column names, and numbers."""

from __future__ import annotations

import csv
import re
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TextIO, cast

import numpy as np
import pandas as pd

from skill.data.files import one_line
from skill.recordings.column_table import (
    NO_CHOICE,
    ColumnChoice,
    Selection,
    check_length,
    select_columns,
    table_recordings,
)
from skill.recordings.columns import FORCES, MOMENTS, listed
from skill.recordings.recording import Recording

MAX_BYTES = 1_000_000_000
"""Largest size of a file; 3.6 million samples of eight columns with 16 characters each have 0.6 GB."""

MAX_LINE = 1_000_000
"""Largest number of bytes of a line."""

SEPARATORS = (",", ";", "\t")
DATE = re.compile(r"\d{4}-\d\d?-\d\d?")
"""How a date begins."""

NO_VALUES = ("", "nan", "NaN", "NAN", "NA", "null")
"""Texts that say that there is no value."""


@dataclass(frozen=True)
class _Layout:
    """How the text of a file is divided: its column names, separator, decimal sign and lines before the numbers."""

    names: list[str]
    separator: str
    decimal: str
    skipped: int


class _Headed:
    """A text with a line before it."""

    def __init__(self, header: str, stream: TextIO) -> None:
        self._header = f"{header}\n"
        self._stream = stream

    def read(self, size: int = -1) -> str:
        """The next characters; the header alone comes first."""
        header, self._header = self._header, ""
        return header or self._stream.read(size)

    def __iter__(self) -> Iterator[str]:
        return iter(self._stream)


def read_bare_file(path: Path, input_rate: float) -> list[Recording]:
    """Reads a text of numbers without names and time, as `numpy.savetxt` writes it: fx fy fz, or fx fy fz mx my mz.

    The units are N and N m, and ``input_rate`` is that of the rows, Hz. The numbers are divided by blanks, commas,
    semicolons or tabs.
    """
    try:
        _check_text(path)
        table = pd.read_csv(path, header=None, comment="#", sep=r"[\s,;]+", engine="python", dtype=float)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: not a text of numbers alone, as --input-rate expects ({one_line(error)})") from error
    table = table.dropna(axis="columns", how="all")  # of blanks at the begin or the end of the lines
    if table.shape[1] not in (3, 6):
        raise ValueError(f"{path}: {table.shape[1]} columns, expected 3 (fx fy fz) or 6 (fx fy fz mx my mz)")
    names = [*FORCES, *MOMENTS][: table.shape[1]]
    table = table.set_axis(names, axis="columns").assign(time=np.arange(len(table)) / input_rate)
    selection = select_columns([*names, "time"], str(path), ColumnChoice(["time=time:s"]))
    return table_recordings(table, selection, str(path), path.name)


def read_csv_file(path: Path, choice: ColumnChoice = NO_CHOICE) -> list[Recording]:
    """Reads the recordings of a CSV file.

    The first line that is neither empty nor a comment (``#``) names the columns; if it has numbers only, the last
    comment before it does. The separator is the one of comma, semicolon and tab that occurs most often in it. With a
    semicolon or tab, numbers may have a decimal comma, all or none. Only the columns that are used must be numbers.
    The text is UTF-8, with or without a byte order mark. An error names the file and, where there is one, the line.
    """
    try:
        _check_text(path)
        layout, rows = _layout(path)
        selection = select_columns(layout.names, str(path), choice)
        layout = replace(layout, decimal=_decimal(rows, layout, selection.numbers))
        table = _table(path, layout, selection)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: not a text in UTF-8 ({one_line(error)})") from error

    def row_name(row: int) -> str:
        number = next((number for number, _ in islice(_lines(path, layout), row, None)), None)
        return f"row {row} of the data" if number is None else f"line {number}"  # None: a text of several lines

    return table_recordings(table, selection, str(path), path.name, row_name=row_name)


def _check_text(path: Path) -> None:
    """Refuses a file that is not regular, too large, has too many lines, or NUL bytes or lines without end."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError(f"{path}: expected a file")
    if status.st_size > MAX_BYTES:
        raise ValueError(f"{path}: {status.st_size / 1e6:.0f} MB, expected at most {MAX_BYTES / 1e6:.0f} MB")
    lines = 0
    with path.open("rb") as stream:
        while block := stream.read(MAX_LINE):
            if b"\0" in block:
                raise ValueError(f"{path}: NUL bytes, expected a text in UTF-8 (not UTF-16)")
            if len(block) == MAX_LINE and b"\n" not in block:
                raise ValueError(f"{path}: a line of more than {MAX_LINE} characters")
            lines += block.count(b"\n")
    check_length(lines - 1000, str(path))  # some lines may be comments


def _layout(path: Path) -> tuple[_Layout, list[str]]:
    """Finds the line of column names and the separator; returns the first rows too."""
    comment, skipped = "", 0
    with path.open(encoding="utf-8-sig", newline="") as stream:
        for number, line in enumerate(stream, start=1):
            text = line.strip("\r\n ")
            if text.startswith("#"):
                comment, skipped = text.lstrip("# "), number
            elif text:
                break
        else:
            raise ValueError(f"{path}: no line of column names; the file has no data")
        rows = [line.partition("#")[0] for line in islice(stream, 100)]
    header = text.partition("#")[0]
    separator = max(SEPARATORS, key=header.count)
    if separator not in header:
        hint = "; for numbers without names and time, say the rate of their rows with --input-rate HZ"
        bare = all(_is_number(field, ".") for field in header.split())
        raise ValueError(
            f"{path}: line {number} is '{header[:60]}', expected commas, semicolons or tabs in it{hint if bare else ''}"
        )
    names = _fields(header, separator, f"{path}: line {number}")
    if not all(_is_number(name, ".") or _is_number(name, ",") for name in names):
        skipped = number
    else:
        values, names = names, _fields(comment, separator, f"{path}: line {skipped}")
        if len(names) != len(values):
            raise ValueError(
                f"{path}: line {number} has numbers {listed(values)}, expected the names of the columns; for a wrench"
                " without names and time, say the rate of its rows with --input-rate HZ"
            )
        rows.append(header)
    return _Layout(names, separator, ".", skipped), rows


def _decimal(rows: Sequence[str], layout: _Layout, numbers: set[str]) -> str:
    """The decimal sign: a comma if the columns of numbers have commas and no full stops."""
    if layout.separator == ",":
        return "."
    fields = [
        field
        for row in csv.reader(rows, delimiter=layout.separator)
        for name, field in zip(layout.names, row, strict=False)
        if name in numbers
    ]
    return "," if any("," in field for field in fields) and not any("." in field for field in fields) else "."


def _fields(header: str, separator: str, where: str) -> list[str]:
    """The names in a line."""
    try:
        return [field.strip() for row in csv.reader([header], delimiter=separator, strict=True) for field in row]
    except csv.Error as error:
        raise ValueError(f"{where}: damaged column names ({error})") from error


def _table(path: Path, layout: _Layout, selection: Selection) -> pd.DataFrame:
    """The columns of the selection; a text where a number should be is an error that names the line."""
    numbers = selection.numbers
    width = len(layout.names)  # one more column is read, for what a line has too much
    kinds: dict[str, type] = {str(k): float for k, name in enumerate(layout.names) if name in numbers}
    kinds |= {str(k): str for k, name in enumerate(layout.names) if name == selection.trial}  # "01" is not "1"
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            for _ in range(layout.skipped):
                stream.readline()
            table: pd.DataFrame = pd.read_csv(
                cast("TextIO", _Headed(layout.separator.join(map(str, range(width + 1))), stream)),
                sep=layout.separator,
                decimal=layout.decimal,
                index_col=False,
                usecols=[str(k) for k in (*(layout.names.index(name) for name in selection.names), width)],
                dtype={**kinds, str(width): str},
                comment="#",
                skipinitialspace=True,
                keep_default_na=False,
                na_values=list(NO_VALUES),
            )
    except UnicodeDecodeError:
        raise
    except (ValueError, OverflowError) as error:
        raise ValueError(f"{path}: {_fault(path, layout, numbers) or one_line(error)}") from error
    if table.pop(str(width)).notna().any():
        raise ValueError(f"{path}: {_fault(path, layout, numbers) or 'a line has too many fields'}")
    return table.rename(columns={str(k): name for k, name in enumerate(layout.names)})


def _fault(path: Path, layout: _Layout, numbers: set[str]) -> str:
    """Where a text stands in a column of numbers, or where a line has too many fields; empty if nowhere."""
    try:
        for number, row in _lines(path, layout):
            if any(field.strip() not in NO_VALUES for field in row[len(layout.names) :]):
                return f"line {number} has {len(row)} fields, expected {len(layout.names)}"
            for name, field in zip(layout.names, row, strict=False):
                text = field.strip()
                if name in numbers and text not in NO_VALUES and not _is_number(text, layout.decimal):
                    hint = "; convert dates to seconds first" if DATE.match(text) else ""
                    return f"line {number}: '{text[:60]}' in column '{name}', expected a number{hint}"
    except csv.Error as error:
        return f"damaged text ({error})"
    return ""


def _lines(path: Path, layout: _Layout) -> Iterator[tuple[int, list[str]]]:
    """The number and the fields of each line with data."""
    blanks = " \r\n" if layout.separator == "\t" else " \t\r\n"
    with path.open(encoding="utf-8-sig", newline="") as stream:
        for number, line in enumerate(stream, start=1):
            if number > layout.skipped and not line.startswith("#") and line.strip(blanks):
                text = line.partition("#")[0].rstrip("\r\n")
                yield number, next(csv.reader([text], delimiter=layout.separator, skipinitialspace=True), [])


def _is_number(text: str, decimal: str) -> bool:
    try:
        float(text.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in text and (decimal == "." or "." not in text)
