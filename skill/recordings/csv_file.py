"""Reads recordings from texts: columns of numbers with commas, semicolons, tabs or spaces between them."""

from __future__ import annotations

import codecs
import csv
import re
from array import array
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pandas as pd

from skill.arrays import Array
from skill.data.files import one_line
from skill.recordings.column_table import NO_CHOICE, ColumnChoice, check_length, table_recordings
from skill.recordings.columns import ROWS
from skill.recordings.recording import Recording
from skill.recordings.text_layout import MAX_HEAD, Layout, divided, find_layout, is_comment, split
from skill.recordings.text_numbers import DECIMALS, is_number, numbers

MAX_BYTES = 1_000_000_000
"""Largest size of a file; 3.6 million samples of eight columns with 16 characters each have 0.6 GB."""

CHUNK = 20_000
"""Number of rows that are converted at a time."""

DATE = re.compile(r"\d{1,4}[-./]\d\d?[-./]\d{1,4}|\d\d?:\d\d")
"""How a date or a time of day begins."""

_BREAKS = re.compile(r"\s*[\r\n]\s*")

NO_LABELS = ("", "nan", "NaN", "NAN", "NA", "null")
"""Texts that say that a row has no trial or phase."""

MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF32_LE: "utf-32",  # begins as the next one
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
    codecs.BOM_UTF32_BE: "utf-32",
}
"""Byte order marks and what they stand for; without one, a text is UTF-8."""


def read_csv_file(path: Path, choice: ColumnChoice = NO_CHOICE) -> list[Recording]:
    """Reads the recordings of a text.

    `skill.recordings.text_layout` says how the columns are found. Lines that begin with ``#`` are comments, quotes are
    those of CSV. Every other line below the names is a row; all have the same number of fields, apart from texts at the
    end. Only the columns that are used must be numbers, as `skill.recordings.text_numbers` describes. Whether commas
    or points are decimal signs follows from all numbers of the file. An error names the file and the line.
    """
    where = str(path)
    try:
        encoding = _check_text(path)
        with path.open(encoding=encoding, newline="") as stream:
            layout = find_layout(list(islice(stream, MAX_HEAD)), where, choice)
        with path.open(encoding=encoding, newline="") as stream:
            table, lines = _Rows(layout, where, choice.decimal).read(stream)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeError) as error:
        raise ValueError(f"{path}: not a text in UTF-8 ({one_line(error)}); convert it to UTF-8") from error
    except csv.Error as error:
        raise ValueError(f"{path}: damaged text ({one_line(error)})") from error
    if choice.sampling_rate is not None:
        trial = layout.selection.trial
        count = np.arange(len(table)) if trial is None else table.groupby(trial, dropna=False).cumcount().to_numpy()
        table[ROWS] = count / choice.sampling_rate
    return table_recordings(table, layout.selection, where, path.name, row_name=lambda row: f"line {lines[row]}")


def _check_text(path: Path) -> str:
    """Refuses a file that is not regular or too large, or is no text; returns its encoding."""
    if path.exists() and not path.is_file():
        raise ValueError(f"{path}: expected a file")
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise ValueError(f"{path}: {size / 1e6:.0f} MB, expected at most {MAX_BYTES / 1e6:.0f} MB")
    with path.open("rb") as stream:
        begin = stream.read(1000)
    encoding = next((name for mark, name in MARKS.items() if begin.startswith(mark)), "utf-8")
    if b"\0" in begin and encoding.startswith("utf-8"):
        raise ValueError(f"{path}: NUL bytes, expected a text in UTF-8, or in UTF-16 with a byte order mark")
    return encoding


class _Rows:
    """The rows of a text, converted piece by piece, with each decimal sign as long as all numbers fit it."""

    def __init__(self, layout: Layout, where: str, decimal: str | None) -> None:
        self._layout = layout
        self._where = where
        self._columns: dict[str, list[list[Array]]] = {
            sign: [[] for _ in layout.numbers] for sign in DECIMALS if decimal in (None, sign)
        }
        self._failures: list[tuple[int, str, str, str]] = []  # line, text, name of the column, decimal sign
        self._labels: list[list[str | float]] = [[] for _ in layout.labels]
        self._known: dict[str, str | float] = dict.fromkeys(NO_LABELS, np.nan)
        self._lines = array("q")
        self._first = self._width = -1  # number of fields of the first row, with and without texts at its end

    def read(self, stream: TextIO) -> tuple[pd.DataFrame, Sequence[int]]:
        """The table of the columns that are read, and the line in which each row begins."""
        rows: list[list[str]] = []
        for number, row in _records(stream, self._layout, self._where):
            if len(row) != self._width:
                if len(row) < 2 and not any(map(str.strip, row)):
                    continue  # an empty line
                self._check_width(number, row)
            self._lines.append(number)
            rows.append(row)
            if len(rows) == CHUNK:
                self._convert(rows)
                rows.clear()
        if rows:
            self._convert(rows)
        table: dict[str, Any] = dict(zip(self._layout.numbers, self._numbers(), strict=True))
        for name, found in zip(self._layout.labels, self._labels, strict=True):
            table[name] = found if name == self._layout.selection.trial else _label_numbers(found)
        return pd.DataFrame(table), self._lines

    def _check_width(self, number: int, row: list[str]) -> None:
        """Refuses a row with another number of fields than the first one, apart from texts at its end."""
        layout = self._layout
        last = max((*layout.numbers.values(), *layout.labels.values()))
        if self._first < 0:
            self._first = self._width = min(len(row), len(layout.names))
            while self._width > last + 1 and (text := row[self._width - 1].strip()) and not is_number(text):
                self._width -= 1
        if len(row) < self._width or last >= len(row) or any(map(str.strip, row[len(layout.names) :])):
            expected = self._first if last < len(row) < self._first else len(layout.names)
            raise ValueError(f"{self._where}: line {number} has {len(row)} fields, expected {expected}")

    def _convert(self, rows: Sequence[list[str]]) -> None:
        """Converts some rows with each decimal sign that has fitted so far."""
        check_length(len(self._lines), self._where)
        names = list(self._layout.numbers)
        texts = [[row[k] for row in rows] for k in self._layout.numbers.values()]
        for sign in list(self._columns):
            found = [numbers(column, sign) for column in texts]
            failures = [(row, k) for k, row in enumerate(found) if isinstance(row, int)]
            if failures:
                row, k = min(failures)
                line = self._lines[len(self._lines) - len(rows) + row]
                self._failures.append((line, texts[k][row].strip(), names[k], sign))
                del self._columns[sign]
            else:
                for pieces, piece in zip(self._columns[sign], found, strict=True):
                    pieces.append(np.asarray(piece))
        if not self._columns:
            raise ValueError(f"{self._where}: {self._failure()}")
        for k, labels in zip(self._layout.labels.values(), self._labels, strict=True):
            labels.extend(
                self._known.setdefault(label, label) for label in (_BREAKS.sub(" ", row[k].strip()) for row in rows)
            )

    def _failure(self) -> str:
        """Which text is no number, with the decimal sign that fitted for longer."""
        line, text, name, sign = max(self._failures, key=lambda failure: failure[0])
        other = next(((n, t) for n, t, *_ in self._failures if t != text and is_number(t)), None)
        expected = f"line {line}: '{_BREAKS.sub(' ', text)[:60]}' in column '{name}', expected a number"
        if DATE.match(text):
            return f"{expected}; convert dates to seconds first"
        if not is_number(text):
            return expected
        return f"{expected} with a decimal {DECIMALS[sign]}{f', as {other[1]!r} in line {other[0]}' if other else ''}"

    def _numbers(self) -> list[Array]:
        """The columns of numbers; refuses those that could be read in two ways."""
        columns = [
            [np.concatenate(pieces) if pieces else np.empty(0) for pieces in found] for found in self._columns.values()
        ]
        for name, point, comma in zip(self._layout.numbers, columns[0], columns[-1], strict=True):
            bad = np.flatnonzero((point != comma) & ~np.isnan(point))
            if bad.size:
                row = bad[0]
                raise ValueError(
                    f"{self._where}: line {self._lines[row]}: column '{name}' is {point[row]:.9g} with decimal points,"
                    f" {comma[row]:.9g} with decimal commas; say which, with --decimal . or --decimal ,"
                )
        return columns[0]


def _records(stream: Iterable[str], layout: Layout, where: str) -> Iterator[tuple[int, list[str]]]:
    """The line in which each record begins, and its fields; refuses a record that swallows rows."""
    begin, inside = layout.start, False

    def feed() -> Iterator[str]:
        nonlocal begin, inside
        for number, line in enumerate(islice(stream, layout.start, None), start=layout.start + 1):
            if inside:
                if layout.is_row(split(line, layout.separator)):
                    raise ValueError(
                        f"{where}: line {number} looks like data, but is inside a text in quotes that begins in line"
                        f" {begin}"
                    )
            elif "#" in line and is_comment(line) and not _is_row(line, number):
                continue
            else:
                begin, inside = number, True
            yield line

    def _is_row(line: str, number: int) -> bool:
        """Whether a line is a row in spite of its "#", as in "#N/A"."""
        fields = split(line, layout.separator)
        if not layout.is_row(fields):
            return False
        if 0 not in layout.numbers.values():
            raise ValueError(
                f"{where}: line {number} looks like data, but is a comment; put '{fields[0][:60]}' in double quotes, or"
                " remove the line"
            )
        return True

    try:
        for row in divided(feed(), layout.separator, strict=True):
            yield begin, row
            inside = False
    except csv.Error as error:
        raise ValueError(f"{where}: line {begin}: damaged text ({error})") from error


def _label_numbers(labels: list[str | float]) -> pd.Series:
    """Labels as numbers, if all of them are."""
    texts, names = pd.Series(labels), pd.Series(list(set(labels)))
    try:
        return texts.map(dict(zip(names, pd.to_numeric(names), strict=True)))
    except ValueError:
        return texts
