"""Finds in a text which line names the columns, where the numbers begin, and what separates them.

The names stand in the last line before the numbers of which the columns of a recording can be chosen; the line may be a
comment (``#``). What stands above is not read. A line of units may stand below or above the names. A text without names
gets them from the user, or numbers from 1.
"""

from __future__ import annotations

import csv
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, product, zip_longest

from skill.recordings.column_table import ColumnChoice, Selection, select_columns
from skill.recordings.columns import FORCES, MOMENTS, STANDARD, channel_quantity, listed
from skill.recordings.text_numbers import is_missing, is_number
from skill.recordings.units import is_unit, unit_size

SEPARATORS = ("\t", ";", ",", " ")
"""What may stand between columns; " " is any number of spaces and tabs."""

MAX_HEAD = 1000
"""Largest number of lines before the numbers."""

ROWS = "number of the row"
"""Name of the column of the time where the user says the sampling rate."""

_MAX_RECORD = 20  # lines of a name in quotes
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
        texts = [fields[k] for k in self.numbers.values()]
        found = [is_number(text) for text in texts]
        return any(found) and all(ok or is_missing(text) for ok, text in zip(found, texts, strict=True))


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


def divided(lines: Iterable[str], separator: str, *, strict: bool = False) -> Iterator[list[str]]:
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
    layout = _layout(lines, where, choice)
    time = layout.selection.columns[0].name
    if choice.sampling_rate is not None and time != ROWS:
        raise ValueError(f"{where}: has a time, in column '{time}'; expected no sampling rate")
    return layout


def _layout(lines: Sequence[str], where: str, choice: ColumnChoice) -> Layout:
    """The layout, as the user or a line of names says it."""
    given = [item.strip() for text in choice.columns if "=" not in text for item in text.split(",")]
    rest = replace(choice, columns=[text for text in choice.columns if "=" in text])
    texts = ["" if given and is_comment(line) else line for line in lines]
    for separator in SEPARATORS:
        layout = _with_names(texts, separator, where, rest, fitting=bool(given))
        if layout is not None and given:
            raise ValueError(
                f"{where}: line {layout.start} names the columns, {listed(layout.names)}; say which of them is which"
                " channel, e.g. --columns fx=COLUMN, or nothing"
            )
        if layout is not None:
            return layout
    return _without_names(lines, where, rest, given) if given else _otherwise(lines, where, rest)


def _with_names(
    lines: Sequence[str], separator: str, where: str, choice: ColumnChoice, *, fitting: bool
) -> Layout | None:
    """The layout of a text whose line of names has this separator; None if there is no such line.

    A line that does not fit the first row in its number of fields is none, if it is a comment or ``fitting`` is said.
    """
    head = _head(lines, separator)
    names: list[str] = []
    used: set[int] = set()
    first = ""
    for k, line in enumerate(head):
        if line.first in used:
            continue
        found = _named(head, k, separator, where, choice)
        if found is not None:
            names, selection, used = numbered(line.fields), *found
            comment = line.comment
        elif names and not line.comment:
            first = lines[line.first]
            break
    if not names:
        return None
    widths = {len(row) for s in SEPARATORS for row in (split(first, s), _filled(split(first, s)))}
    if (fitting or comment) and len(names) not in widths:
        return None
    layout = Layout(names, separator, max(used) + 1, selection)
    if not layout.is_row(split(first, separator)):
        others = (replace(layout, separator=s) for s in SEPARATORS)
        rows = ((other, _filled(split(first, other.separator))) for other in others)
        layout = next((other for other, row in rows if len(row) == len(names) and other.is_row(row)), layout)
    for number in range(min(used)):
        if not is_comment(lines[number]) and layout.is_row(split(lines[number], layout.separator)):
            raise ValueError(
                f"{where}: line {number + 1} looks like data, but the names of the columns are in line {min(used) + 1};"
                " expected them above the data, once"
            )
    _check_units(lines[: layout.start], used, selection, where)
    return layout


def _named(
    head: Sequence[_Line], k: int, separator: str, where: str, choice: ColumnChoice
) -> tuple[Selection, set[int]] | None:
    """The selection from a line of names, and which lines say names and units; None if this line names no columns."""
    names = numbered(head[k].fields)
    if (len(names) < 2 and separator != " ") or all(map(is_number, names)):
        return None
    units: list[str] = []
    used = set(range(head[k].first, head[k].after))
    for other in (k + 1, k - 1):
        if not units and 0 <= other < len(head) and 2 * len(head[other].fields) >= len(names):
            units = _units(head[other].fields, len(names))
            used |= {head[other].first} if units else set()
    try:
        selection = _select(names, units, where, choice)
    except ValueError:
        return None
    numbers = selection.numbers & set(names)
    return None if any(map(is_number, numbers)) else (selection, used)


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
    for number in texts:
        count = max(_count_numbers(split(lines[number], separator)) for separator in SEPARATORS)
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
        elif len(row) == len(layout.names) and all(is_number(field) or is_missing(field) for field in row):
            layout = replace(layout, start=number)  # a row without values
        elif len(fields) == len(layout.names) > 1 and not any(map(is_number, fields)):
            raise ValueError(
                f"{where}: line {number + 1} names the columns, {listed(fields)}; say instead which of them is which"
                f" channel, e.g. --columns {shlex.quote(f'{layout.names[-1]}={fields[-1]}')}"
            )
        elif fields and is_number(fields[0]):
            layout = replace(layout, start=number)  # a damaged row
    _check_units(lines[: layout.start], used, layout.selection, where)
    return layout


def _otherwise(lines: Sequence[str], where: str, choice: ColumnChoice) -> Layout:
    """The layout of a text without names whose columns the user chooses by their numbers; else says what is missing."""
    likely: tuple[int, list[str], list[str]] = (0, [], [])
    for separator in SEPARATORS:
        head = _head(lines, separator)
        widest = likely[0]
        for k, line in enumerate(head):
            width = len(line.fields)
            if k > 0 and _count_numbers(line.fields, part=True) and not line.comment and width > widest:
                below = _units(head[k - 1].fields, width)
                above = head[k - 2 if below and k > 1 else k - 1]
                said = choice.columns or not above.comment  # a comment of so many words is not yet a line of names
                if said and len(above.fields) >= max(width, 2) and not any(map(is_number, above.fields)):
                    likely = (width, above.fields, below)
    if likely[0]:
        _select(numbered(likely[1]), likely[2], where, choice)  # says what is wrong with these names
    for number, text in enumerate(lines):
        count = 0 if is_comment(text) else max(_count_numbers(split(text, separator)) for separator in SEPARATORS)
        if count and choice.columns:
            return _without_names(lines, where, choice, [str(k + 1) for k in range(count)])
        if count:
            raise ValueError(
                f"{where}: line {number + 1} has {count} numbers, expected the names of the columns; say what they are,"
                f" e.g. haptic-skill states {shlex.quote(where)} {_flags(count)}"
            )
    if not any(line.strip() and not is_comment(line) for line in lines):
        raise ValueError(f"{where}: no line of column names; the file has no data")
    raise ValueError(
        f"{where}: no line of column names such as time,fx,fy,fz above lines of numbers, in the first {MAX_HEAD} lines"
    )


def _flags(count: int) -> str:
    """The options that name so many columns."""
    timed = count not in (1, 3, 6)
    channels = ["time"] * timed + (["fz"] if count < 3 else [*FORCES, *(MOMENTS if count > 5 else ())])
    names = ",".join([*channels, *[""] * (count - len(channels))])
    return f"--columns {names}{'' if timed else ' --sampling-rate 100'}"


def _head(lines: Sequence[str], separator: str) -> list[_Line]:
    """The lines that are not empty; a name in quotes may have several lines."""
    found: list[_Line] = []
    after = 0
    while after < len(lines):
        first, text = after, lines[after]
        after += 1
        comment = is_comment(text) or text.startswith("% ")
        if comment:
            text = text.lstrip("#% \t")
        else:
            stops = range(after, first + _MAX_RECORD + 1)
            after = next((k for k in stops if not _is_open("".join(lines[first:k]), separator)), after)
            text = "".join(lines[first:after])
        if separator == " ":
            text = _SPACED_UNIT.sub("", text)
        fields = [" ".join(field.split()) for field in _filled(split(text, separator))]
        if fields:
            found.append(_Line(first, after, fields, comment))
    return found


def _is_open(text: str, separator: str) -> bool:
    """Whether a text in quotes goes on in the next line."""
    try:
        list(divided([text], separator, strict=True))
    except csv.Error as error:
        return "unexpected end" in str(error)
    return False


def _filled(fields: list[str]) -> list[str]:
    """The fields without empty ones at the end."""
    return fields[: max((k + 1 for k, field in enumerate(fields) if field), default=0)]


def _count_numbers(fields: Sequence[str], *, part: bool = False) -> int:
    """The number of fields, if all of them are numbers or say that there is none, or half of them; else 0."""
    fields = _filled(list(fields))
    count = sum(is_number(field) or is_missing(field) for field in fields)
    enough = 2 * count >= len(fields) if part else count == len(fields)
    return len(fields) if enough and any(map(is_number, fields)) else 0


def _units(fields: Sequence[str], width: int) -> list[str]:
    """The units in a line of units for so many columns; empty if it is none."""
    texts = [_BRACKETS.sub("", field) for field in fields]
    units = sum(map(is_unit, texts))
    others = sum(text not in ("", "-", "1") for text in texts) - units
    usual = len(texts) <= width and units >= min(2, width) and units >= others
    return texts if usual and not any(text != "1" and is_number(text) for text in texts) else []


def _check_units(lines: Sequence[str], used: set[int], selection: Selection, where: str) -> None:
    """Refuses to take forces and moments for N and N m if the text above them speaks of another unit."""
    for number, line in enumerate(lines):
        words = [] if number in used else _WORDS.split(line)
        for (before, word), quantity in product(pairwise(["", *words]), ("force", "torque")):
            other = is_unit(word, quantity) and unit_size(word, quantity) != 1.0 and not is_number(before)
            open_columns = [c for c in selection.columns if not c.stated and channel_quantity(c.channel) == quantity]
            if other and open_columns:
                choices = " ".join(f"--columns {shlex.quote(f'{c.channel}={c.name}:{word}')}" for c in open_columns)
                raise ValueError(
                    f"{where}: line {number + 1} speaks of '{word}', but column '{open_columns[0].name}' has no unit;"
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
    alone = ColumnChoice(columns, trial, phase)
    with_rows = replace(alone, columns=[*columns, f"time={ROWS}:s"])
    try:
        return select_columns(names, where, alone, units)
    except ValueError as error:
        try:
            selection = select_columns([*names, ROWS], where, with_rows, units)
        except ValueError:
            raise error from None
        if choice.sampling_rate is None:
            raise ValueError(f"{error}; without a time, say the rate of the rows, e.g. --sampling-rate 100") from None
        return selection


def _by_name(text: str, names: Sequence[str]) -> str:
    """A choice of the user with the name of the column for its number."""
    channel, _, rest = (part.strip() for part in text.partition("="))
    number, colon, unit = (part.strip() for part in rest.partition(":"))
    if rest in names or rest.rpartition(":")[0].strip() in names or not _is_position(number, names):
        return text
    return f"{channel}={names[int(number) - 1]}{colon}{unit}"


def _is_position(text: str, names: Sequence[str]) -> bool:
    return text.isdecimal() and 1 <= int(text) <= len(names)
