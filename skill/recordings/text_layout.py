"""Finds in a text which line names the columns, where the numbers begin, and what separates them.

The line of names is that with the most names of channels, usual ones or those of the user, above the first row of
numbers; it may be a comment (``#``). What stands above is not read. A line of units may stand below or above the names.
A text without names gets them from the user, or numbers from 1.
"""

from __future__ import annotations

import csv
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING

from skill.recordings.column_table import ColumnChoice, Selection, select_columns
from skill.recordings.columns import FORCES, MOMENTS, ROWS, STANDARD, channel_of, channel_quantity, listed
from skill.recordings.text_numbers import is_missing, is_number
from skill.recordings.units import is_unit, unit_size

if TYPE_CHECKING:
    import _csv

SEPARATORS = ("\t", ";", ",", " ")
"""What may stand between columns; " " is any number of spaces and tabs."""

MAX_HEAD = 1000
"""Largest number of lines before the numbers."""

_BRACKETS = re.compile(r"^[\[(]\s*|\s*[\])]$")
_SPACED_UNIT = re.compile(r"(?<=\w)\s+(?=[\[(])")
_WORDS = re.compile(r"[\s,;:=()\[\]\"']+")


@dataclass(frozen=True)
class Layout:
    """How a text is divided.

    Attributes:
        names: of the columns, each once.
        separator: one of ``SEPARATORS``.
        start: number of lines before the numbers.
        selection: the columns to read.
    """

    names: list[str]
    separator: str
    start: int
    selection: Selection

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The position of each column of numbers that is read."""
        wanted = self.selection.numbers - {ROWS}
        return {name: self.names.index(name) for name in self.selection.names if name in wanted}

    @cached_property
    def labels(self) -> dict[str, int]:
        """The position of the columns of trials and phases."""
        return {name: self.names.index(name) for name in self.selection.names if name not in self.selection.numbers}

    def is_row(self, fields: Sequence[str]) -> bool:
        """Whether fields look like a row: numbers, or texts for missing ones, where numbers are read."""
        if max(self.numbers.values(), default=0) >= len(fields) or any(fields[len(self.names) :]):
            return False
        return _are_numbers([fields[k] for k in self.numbers.values()])


@dataclass(frozen=True)
class _Line:
    """A line of the head: where it begins, from 0, where the next one begins, its fields, whether it is a comment."""

    first: int
    after: int
    fields: list[str]
    comment: bool


def is_comment(line: str) -> bool:
    """Whether a line is a comment; a '#' elsewhere begins none."""
    return line.lstrip().startswith("#")


def split(line: str, separator: str) -> list[str]:
    """The fields of a line, without spaces around them."""
    return [field.strip() for field in next(divided([line], separator), [])]


def divided(lines: Iterable[str], separator: str, *, strict: bool = False) -> _csv.Reader:
    """Reads lines as records of fields; a field in double quotes may go on in the next line."""
    text = (line.replace("\t", " ") for line in lines) if separator == " " else lines
    return csv.reader(text, delimiter=separator, skipinitialspace=True, strict=strict)


def find_layout(lines: Sequence[str], where: str, choice: ColumnChoice) -> Layout:
    """Finds how a text is divided.

    Args:
        lines: its first lines, at most `MAX_HEAD`.
        where: name of the file, for messages.
        choice: what the user says about the columns.

    Raises:
        ValueError: if no line names columns that can be chosen, or what stands above the names looks like numbers.
    """
    given = [item.strip() for text in choice.columns if "=" not in text for item in text.split(",")]
    choice = replace(choice, columns=[text for text in choice.columns if "=" in text])
    names = _find_names(lines, choice, alone=not given)
    if names is not None and given:
        raise ValueError(
            f"{where}: line {names.line.after} names the columns, {listed(names.line.fields)}; say which of them is"
            " which channel, e.g. --columns fx=COLUMN, or nothing"
        )
    if names is not None:
        return _with_names(lines, names, where, choice)
    if given:
        return _without_names(lines, where, choice, given)
    return _by_number(lines, where, choice)


@dataclass(frozen=True)
class _Names:
    """A line of names: the lines of the text that are not empty, which of them it is, and the separator."""

    head: list[_Line]
    place: int
    separator: str

    @property
    def line(self) -> _Line:
        return self.head[self.place]

    def first_row(self, lines: Sequence[str]) -> str:
        """The first line of the row below, which is no line of units; empty if there is none."""
        below = [line for line in self.head[self.place + 1 :] if not line.comment]
        if below and _units(below[0].fields, len(self.line.fields)):
            del below[0]
        return lines[below[0].first] if below else ""

    def fit(self, lines: Sequence[str], *, exactly: bool) -> bool:
        """Whether there are as many names as the first row has fields by any separator, or no fewer than by its own."""
        first, count = self.first_row(lines), len(self.line.fields)
        if not exactly:
            return count >= len(_filled(split(first, self.separator)))
        return any(count in (len(row), len(_filled(row))) for row in (split(first, s) for s in SEPARATORS))


def _find_names(lines: Sequence[str], choice: ColumnChoice, *, alone: bool) -> _Names | None:
    """The line with the most names of channels; if there is none, that of texts above the first numbers.

    A comment, and any line if the user has named the columns too (not ``alone``), must have as many fields as the row
    below it, and a line with one such name not fewer.
    """
    rests = [text.partition("=")[2].strip() for text in choice.columns]
    said = {part for rest in rests for part in (rest, rest.rpartition(":")[0].strip()) if not is_number(part)}
    best, most = None, 0
    for separator in SEPARATORS:
        head = _head(lines, separator)
        here = 0  # names of channels in the best line with this separator
        for place, line in enumerate(head):
            known = {channel_of(name) or name for name in numbered(line.fields) if channel_of(name) or name in said}
            if here > 1 and not known and not line.comment and _are_numbers(line.fields, part=True):
                break
            names = _Names(head, place, separator)
            if not known or len(known) < here or (len(known) <= most and not here) or (line.comment and not alone):
                continue
            exactly = line.comment or not alone
            if (len(known) > 1 and not exactly) or names.fit(lines, exactly=exactly):
                best, most, here = names, len(known), len(known)
    return best or (_texts_above_numbers(lines) if alone else None)


def _texts_above_numbers(lines: Sequence[str]) -> _Names | None:
    """The line of texts above the first row of numbers, and above that of their units."""
    for separator in SEPARATORS:
        head = _head(lines, separator)
        rows = (k for k, line in enumerate(head) if not line.comment and _are_numbers(line.fields, part=True))
        place = next(rows, 0) - 1
        width = len(head[place + 1].fields) if head else 0
        if place > 0 and _units(head[place].fields, width):
            place -= 1
        fields = head[place].fields if place >= 0 and not head[place].comment else []
        if len(fields) >= max(width, 2) and not any(map(is_number, fields)):
            return _Names(head, place, separator)
    return None


def _with_names(lines: Sequence[str], found: _Names, where: str, choice: ColumnChoice) -> Layout:
    """The layout of a text with a line of names."""
    names = numbered(found.line.fields)
    units: list[str] = []
    used = set(range(found.line.first, found.line.after))
    for place in (found.place + 1, found.place - 1):
        if not units and 0 <= place < len(found.head) and 2 * len(found.head[place].fields) >= len(names):
            units = _units(found.head[place].fields, len(names))
            used |= {found.head[place].first} if units else set()
    layout = Layout(names, found.separator, max(used) + 1, _select(names, units, where, choice))
    first = found.first_row(lines)
    if not layout.is_row(split(first, layout.separator)):
        others = (replace(layout, separator=separator) for separator in SEPARATORS)
        fields = ((other, _filled(split(first, other.separator))) for other in others)
        layout = next((other for other, row in fields if len(row) == len(names) and other.is_row(row)), layout)
    for number in range(min(used)):
        if not is_comment(lines[number]) and layout.is_row(split(lines[number], layout.separator)):
            raise ValueError(
                f"{where}: line {number + 1} looks like data, but the names of the columns are in line {min(used) + 1};"
                " expected them above the data, once"
            )
    _check_units(lines[: layout.start], used, layout.selection, where)
    return layout


def _without_names(lines: Sequence[str], where: str, choice: ColumnChoice, given: Sequence[str]) -> Layout:
    """The layout of a text whose columns are named by the user, in their order, as "channel" or "channel:unit"."""
    pairs = [(name.strip(), unit.strip()) for name, _, unit in (item.partition(":") for item in given)]
    names, units = numbered([name for name, _ in pairs]), [unit for _, unit in pairs]
    chosen = {text.partition("=")[0].strip().lower() for text in choice.columns}
    said = [
        f"{name}={name}{unit and f':{unit}'}"
        for name, unit in zip(names, units, strict=True)
        if name.lower() in STANDARD and name.lower() not in chosen
    ]
    choice = replace(choice, columns=[*said, *choice.columns])
    selection = _select(names, units, where, choice)
    texts = [number for number, line in enumerate(lines) if line.strip() and not is_comment(line)]
    for k, number in enumerate(texts):
        for separator in SEPARATORS:
            layout = Layout(names, separator, texts[k - 1] + 1 if k else 0, selection)
            row = split(lines[number], separator)
            if len(row) >= len(names) and layout.is_row(row):
                return _below(lines, texts[:k], layout, where, choice, units)
    number, count = _first_numbers(lines)
    if count:
        raise ValueError(f"{where}: line {number + 1} has {count} numbers, but {len(names)} columns are named")
    raise ValueError(f"{where}: no line of {len(names)} numbers")


def _below(
    lines: Sequence[str], above: Sequence[int], layout: Layout, where: str, choice: ColumnChoice, units: Sequence[str]
) -> Layout:
    """The layout of a text without names, with the lines above its first row taken into account."""
    used: set[int] = set()
    for number in reversed(above):
        row = split(lines[number], layout.separator)
        fields = _filled(row)
        beside = _units(fields, len(layout.names)) if number == above[-1] else []
        if beside:
            used = {number}
            merged = [unit or other for unit, other in zip_longest(units, beside, fillvalue="")]
            layout = replace(layout, selection=_select(layout.names, merged, where, choice))
        elif len(fields) == len(layout.names) > 1 and not any(map(is_number, fields)) and not all(map(is_missing, row)):
            raise ValueError(
                f"{where}: line {number + 1} names the columns, {listed(fields)}; say instead which of them is which"
                f" channel, e.g. --columns {shlex.quote(f'{layout.names[-1]}={fields[-1]}')}"
            )
        elif (fields and is_number(fields[0])) or (len(row) == len(layout.names) and all(map(is_missing, row))):
            layout = replace(layout, start=number)  # a row that is damaged or without values
    _check_units(lines[: layout.start], used, layout.selection, where)
    return layout


def _by_number(lines: Sequence[str], where: str, choice: ColumnChoice) -> Layout:
    """The layout of a text without names whose columns the user chooses by their numbers; else says what is missing."""
    number, count = _first_numbers(lines)
    if count and choice.columns:
        return _without_names(lines, where, choice, [str(k + 1) for k in range(count)])
    if count:
        timed = count not in (1, 3, 6)
        channels = ["time"] * timed + (["fz"] if count < 3 else [*FORCES, *(MOMENTS if count > 5 else ())])
        names = ",".join([*channels, *[""] * (count - len(channels))])
        raise ValueError(
            f"{where}: line {number + 1} has {count} numbers, expected the names of the columns; say what they are,"
            f" e.g. haptic-skill states {shlex.quote(where)} --columns {names}{'' if timed else ' --sampling-rate 100'}"
        )
    if not any(line.strip() and not is_comment(line) for line in lines):
        raise ValueError(f"{where}: no line of column names; the file has no data")
    raise ValueError(
        f"{where}: no line of column names such as time,fx,fy,fz above lines of numbers, in the first {MAX_HEAD} lines"
    )


def _first_numbers(lines: Sequence[str]) -> tuple[int, int]:
    """The first line of numbers, from 0, and how many it has; 0, 0 if there is none."""
    for number, text in enumerate(lines):
        rows = [_filled(split(text, separator)) for separator in SEPARATORS]
        count = 0 if is_comment(text) else max(len(row) if _are_numbers(row) else 0 for row in rows)
        if count:
            return number, count
    return 0, 0


def _head(lines: Sequence[str], separator: str) -> list[_Line]:
    """The lines that are not empty; a name in quotes may have several lines."""
    found = []
    first = 0
    comments = [is_comment(line) or line.startswith("% ") for line in lines]
    texts = (line.lstrip("#% \t") if comment else line for line, comment in zip(lines, comments, strict=True))
    reader = divided((_SPACED_UNIT.sub("", text) for text in texts) if separator == " " else texts, separator)
    for row in reader:
        fields = [" ".join(field.split()) for field in _filled(row)]
        if fields:
            found.append(_Line(first, reader.line_num, fields, comments[first]))
        first = reader.line_num
    return found


def _filled(fields: list[str]) -> list[str]:
    """The fields without empty ones at the end."""
    return fields[: max((k + 1 for k, field in enumerate(fields) if field), default=0)]


def _are_numbers(fields: Sequence[str], *, part: bool = False) -> bool:
    """Whether all fields, or half of them, are numbers or say that there is none, and one is a number."""
    count = sum(is_number(field) or is_missing(field) for field in fields)
    return count * (1 + part) >= len(fields) and any(map(is_number, fields))


def _units(fields: Sequence[str], width: int) -> list[str]:
    """The units in a line of units for so many columns; empty if it is none."""
    texts = [_BRACKETS.sub("", field) for field in fields]
    units = sum(map(is_unit, texts))
    others = sum(text not in ("", "-", "1") for text in texts) - units
    usual = len(texts) <= width and units >= min(2, width) and units >= others
    return texts if usual and not any(text != "1" and is_number(text) for text in texts) else []


def _check_units(lines: Sequence[str], used: set[int], selection: Selection, where: str) -> None:
    """Refuses to take forces and moments for N and N m if the text above them speaks of another unit."""
    said = {c.channel: channel_quantity(c.channel) for c in selection.columns if not c.stated}
    texts = [(number, line) for number, line in enumerate(lines, start=1) if number - 1 not in used]
    words = [(number, before, word) for number, line in texts for before, word in pairwise(["", *_WORDS.split(line)])]
    for number, before, word in words:
        quantity = next((q for q in ("force", "torque") if is_unit(word, q) and unit_size(word, q) != 1.0), None)
        columns = [c for c in selection.columns if quantity and said.get(c.channel) == quantity]
        if columns and not is_number(before):
            choices = " ".join(f"--columns {shlex.quote(f'{c.channel}={c.name}:{word}')}" for c in columns)
            raise ValueError(
                f"{where}: line {number} speaks of '{word}', but column '{columns[0].name}' has no unit;"
                f" say the units, e.g. {choices}"
            )


def numbered(names: Sequence[str]) -> list[str]:
    """Names of columns, each once: those that occur several times get the number of their column, as in "5:fx"."""
    counts = Counter(names)
    return [f"{k}:{name}" if counts[name] > 1 else name for k, name in enumerate(names, start=1)]


def _select(names: Sequence[str], units: Sequence[str], where: str, choice: ColumnChoice) -> Selection:
    """Chooses the columns; the user may say the number of a column instead of its name."""
    columns = [_by_name(text, names) for text in choice.columns]
    trial, phase = (
        names[int(c) - 1] if c and c not in names and _is_position(c, names) else c
        for c in (choice.trial_column, choice.phase_column)
    )
    return select_columns(names, where, replace(choice, columns=columns, trial_column=trial, phase_column=phase), units)


def _by_name(text: str, names: Sequence[str]) -> str:
    """A choice of the user with the name of the column for its number."""
    channel, _, rest = (part.strip() for part in text.partition("="))
    number, colon, unit = (part.strip() for part in rest.partition(":"))
    if rest in names or rest.rpartition(":")[0].strip() in names or not _is_position(number, names):
        return text
    return f"{channel}={names[int(number) - 1]}{colon}{unit}"


def _is_position(text: str, names: Sequence[str]) -> bool:
    return text.isdecimal() and 1 <= int(text) <= len(names)
