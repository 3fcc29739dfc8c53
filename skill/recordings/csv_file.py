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


class _NoNumberError(ValueError):
    """A text in a column of numbers is none with a decimal sign: its line, itself, its column and the sign."""

    def __init__(self, line: int, text: str, name: str, sign: str) -> None:
        super().__init__(line, text, name, sign)
        self.line, self.text, self.name, self.sign = line, text, name, sign


def read_csv_file(path: Path, choice: ColumnChoice = NO_CHOICE) -> list[Recording]:
    """Reads the recordings of a text.

    `skill.recordings.text_layout` says how the columns are found. Lines that begin with ``#`` are comments, quotes are
    those of CSV. Every other line below the names is a row; all have the same number of fields, apart from texts at the
    end. Only the columns that are used must be numbers, as `skill.recordings.text_numbers` describes. Whether commas
    or points are decimal signs follows from all numbers of the file. An error names the file and the line.
    """
    where = str(path)
    found: list[tuple[pd.DataFrame, Sequence[int]]] = []
    failures: list[_NoNumberError] = []
    try:
        encoding = _check_text(path)
        with path.open(encoding=encoding, newline="") as stream:
            layout = find_layout(list(islice(stream, MAX_HEAD)), where, choice)
        for sign in DECIMALS if choice.decimal is None else choice.decimal:
            with path.open(encoding=encoding, newline="") as stream:
                try:
                    found.append(_table(stream, layout, where, sign))
                except _NoNumberError as failure:
                    failures.append(failure)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeError) as error:
        raise ValueError(f"{path}: not a text in UTF-8 ({one_line(error)}); convert it to UTF-8") from error
    except csv.Error as error:
        raise ValueError(f"{path}: damaged text ({one_line(error)})") from error
    if not found:
        raise ValueError(f"{path}: {_failure(failures)}")
    table, lines = found[0]
    _check_same(table, found[-1][0], layout, lines, where)
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


def _table(stream: TextIO, layout: Layout, where: str, sign: str) -> tuple[pd.DataFrame, Sequence[int]]:
    """The table of the columns that are read, with a decimal sign, and the line in which each row begins."""
    columns: list[list[Array]] = [[] for _ in layout.numbers]
    labels: list[list[str | float]] = [[] for _ in layout.labels]
    known: dict[str, str | float] = dict.fromkeys(NO_LABELS, np.nan)
    lines = array("q")
    rows = _rows(stream, layout, where)
    while chunk := list(islice(rows, CHUNK)):
        check_length(len(lines) + len(chunk), where)
        texts = {name: [row[k] for _, row in chunk] for name, k in layout.numbers.items()}
        converted = [numbers(column, sign) for column in texts.values()]
        failures = [(row, name) for row, name in zip(converted, texts, strict=True) if isinstance(row, int)]
        if failures:
            row, name = min(failures, key=lambda failure: failure[0])
            raise _NoNumberError(chunk[row][0], texts[name][row].strip(), name, sign)
        for pieces, piece in zip(columns, converted, strict=True):
            pieces.append(np.asarray(piece))
        for k, column in zip(layout.labels.values(), labels, strict=True):
            column.extend(known.setdefault(label, label) for label in (_shown(row[k]) for _, row in chunk))
        lines.extend(number for number, _ in chunk)
    table: dict[str, Any] = {
        name: np.concatenate(pieces) if pieces else np.empty(0)
        for name, pieces in zip(layout.numbers, columns, strict=True)
    }
    for name, found in zip(layout.labels, labels, strict=True):
        table[name] = found if name == layout.selection.trial else _label_numbers(found)
    return pd.DataFrame(table), lines


def _rows(stream: TextIO, layout: Layout, where: str) -> Iterator[tuple[int, list[str]]]:
    """The line and the fields of each row; refuses one with another number of fields than the first one, apart from
    texts at its end.
    """
    last = max((*layout.numbers.values(), *layout.labels.values()))
    first = width = -1  # number of fields of the first row, with and without texts at its end
    for number, row in _records(stream, layout, where):
        if len(row) != width:
            if len(row) < 2 and not any(map(str.strip, row)):
                continue  # an empty line
            if first < 0:
                first = width = min(len(row), len(layout.names))
                while width > last + 1 and (text := row[width - 1].strip()) and not is_number(text):
                    width -= 1
            if len(row) < width or last >= len(row) or any(map(str.strip, row[len(layout.names) :])):
                expected = first if last < len(row) < first else len(layout.names)
                raise ValueError(f"{where}: line {number} has {len(row)} fields, expected {expected}")
        yield number, row


def _failure(failures: Sequence[_NoNumberError]) -> str:
    """Which text is no number, with the decimal sign that fitted for longer."""
    worst = max(failures, key=lambda failure: failure.line)
    expected = f"line {worst.line}: '{_shown(worst.text)[:60]}' in column '{worst.name}', expected a number"
    if DATE.match(worst.text):
        return f"{expected}; convert dates to seconds first"
    if not is_number(worst.text):
        return expected
    others = [f", as {f.text!r} in line {f.line}" for f in failures if f.text != worst.text and is_number(f.text)]
    return f"{expected} with a decimal {DECIMALS[worst.sign]}{''.join(others[:1])}"


def _check_same(points: pd.DataFrame, commas: pd.DataFrame, layout: Layout, lines: Sequence[int], where: str) -> None:
    """Refuses numbers that could be read in two ways."""
    for name in layout.numbers:
        point, comma = points[name].to_numpy(), commas[name].to_numpy()
        bad = np.flatnonzero((point != comma) & ~np.isnan(point))
        if bad.size:
            row = bad[0]
            raise ValueError(
                f"{where}: line {lines[row]}: column '{name}' is {point[row]:.9g} with decimal points,"
                f" {comma[row]:.9g} with decimal commas; say which, with --decimal . or --decimal ,"
            )


def _shown(text: str) -> str:
    """A text on one line."""
    return _BREAKS.sub(" ", text.strip())


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
