"""Makes recordings of a table: converts units, splits it into trials and refuses rows that are incomplete."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skill.arrays import Array
from skill.recordings.columns import PHASE_COLUMNS, ROWS, TRIAL_COLUMNS, Column, choose_columns, label_column
from skill.recordings.orientation import with_rotation_vector
from skill.recordings.recording import MAX_SAMPLES, Recording
from skill.recordings.units import UNITS

RATES = (10.0, 1e6)
"""Range of plausible sampling rates, Hz."""

SURE_RATE, SURE_DURATION = 50.0, 3600.0  # Hz, s
"""A time without a unit is in seconds at this rate or more and up to this duration: few sensors are a thousand times
faster, and few recordings longer. 20 kHz in ms looks like 20 Hz."""

EPOCH = (1e9, 4e9)
"""Range of time stamps that count from 1970, s: of the years 2001 to 2096. They show their unit."""

MAX_PHASES = 200
"""Largest number of different phases; more are no phases but numbers or notes."""

MAX_LABEL = 60
"""Largest number of characters of a trial or a phase."""


FLAGS = {"true", "false", "t", "f", "yes", "no", "y", "n", "on", "off"}
"""What a column of truth values holds, in lower case."""


@dataclass(frozen=True)
class Selection:
    """Which columns of a table are read.

    Attributes:
        columns: time first, then the channels.
        trial: column that says to which trial a row belongs; None where all rows are one.
        phase: column with the phase of each row; None where there is none.
        guessed: whether the column of trials follows from its name alone.
    """

    columns: tuple[Column, ...]
    trial: str | None
    phase: str | None
    guessed: bool = False

    @property
    def names(self) -> list[str]:
        """Names of all columns to read, each once."""
        labels = [name for name in (self.trial, self.phase) if name is not None]
        return list(dict.fromkeys([*(column.name for column in self.columns), *labels]))

    @property
    def numbers(self) -> set[str]:
        """Names of the columns that must be numbers."""
        return {column.name for column in self.columns} - {self.trial, self.phase}


@dataclass(frozen=True)
class ColumnChoice:
    """What the user says about the columns of a table.

    Attributes:
        columns: texts "channel=column" or "channel=column:unit"; see `skill.recordings.columns.choose_columns`.
        trial_column: column of the trials; None for one with a usual name, "" for none.
        phase_column: column of the phases; None for one with a usual name, "" for none.
        sampling_rate: rate of the rows of a text without a time, Hz; None for a table with a time.
        decimal: "." or ",", the decimal sign of a text; None where its numbers leave no doubt.
    """

    columns: Sequence[str] = ()
    trial_column: str | None = None
    phase_column: str | None = None
    sampling_rate: float | None = None
    decimal: str | None = None


NO_CHOICE = ColumnChoice()


def select_columns(names: Sequence[str], where: str, choice: ColumnChoice, units: Sequence[str] = ()) -> Selection:
    """Chooses what to read of a table.

    Args:
        names: names of all columns.
        where: name of the file, for messages.
        choice: what the user says about them.
        units: see `skill.recordings.columns.choose_columns`.

    Raises:
        ValueError: if columns are missing or ambiguous. The message names the file.
    """
    selection = Selection(
        choose_columns(names, choice.columns, where, units, rows=choice.sampling_rate is not None),
        label_column(names, choice.trial_column, TRIAL_COLUMNS, where),
        label_column(names, choice.phase_column, PHASE_COLUMNS, where),
        guessed=choice.trial_column is None,
    )
    time = selection.columns[0].name
    if choice.sampling_rate is not None and time != ROWS:
        raise ValueError(f"{where}: has a time, in column '{time}'; expected no sampling rate")
    return selection


def check_length(rows: int, where: str) -> None:
    """Refuses a table with more than ``MAX_SAMPLES`` rows.

    Raises:
        ValueError: naming the file.
    """
    if rows > MAX_SAMPLES:
        raise ValueError(f"{where}: {rows} samples, expected at most {MAX_SAMPLES}; lower the rate or split it")


def table_recordings(
    table: pd.DataFrame,
    selection: Selection,
    where: str,
    name: str,
    *,
    row_name: Callable[[int], str] = "row {}".format,
) -> list[Recording]:
    """Returns the trials of a table, in the order in which they first occur.

    Rows in which no channel has a value are left out: they hold no sample, but those of another sensor. A row in which
    some channels have a value and others have none is refused, and so is a value that is infinite. An orientation
    becomes a rotation vector (`skill.recordings.orientation`).

    Args:
        table: table with the columns of the selection; numbers, apart from trials and phases.
        selection: which columns are what.
        where: the file, for messages.
        name: name of the recordings; a trial adds its own.
        row_name: returns what a row is called in messages, by its position in the table.

    Raises:
        ValueError: if a value is missing, infinite or no number, or a trial is no valid recording.
    """
    check_length(len(table), where)
    time, *channels = selection.columns
    values = np.column_stack([_numbers(table[c.name], c, where) for c in channels])
    kept: NDArray[np.bool_] = np.any(~np.isnan(values), axis=1)
    stamps = _numbers(table[time.name], time, where)
    for column, numbers in ((time, stamps), *zip(channels, values.T, strict=True)):
        bad = np.flatnonzero(kept & ~np.isfinite(numbers))
        if bad.size:
            what = "has no value" if np.isnan(numbers[bad[0]]) else "is infinite"
            raise ValueError(
                f"{where}: column '{column.name}' {what} in {row_name(int(bad[0]))} ({bad.size} such rows);"
                " expected a number, or no value in any channel of the row"
            )
    if not kept.any():
        raise ValueError(f"{where}: no samples; expected at least 2 rows with values")
    phases = None if selection.phase is None else _phases(table[selection.phase], kept, where, row_name)
    trials = None if selection.trial is None else _labels(table[selection.trial], kept, where, row_name)
    if trials is not None and selection.guessed:
        _check_trials(trials, f"{where}: column '{selection.trial}'", str(selection.trial))
    rows = np.flatnonzero(kept)
    stamps, values = stamps[kept], values[kept]
    names, values = with_rotation_vector(channels, values, where, lambda row: row_name(int(rows[row])))
    epoch = None if time.stated else _epoch_unit(stamps)
    if epoch is not None:
        stamps, time = stamps * epoch, replace(time, size=epoch, stated=True)
    recordings = []
    for label, of in _trials(trials, len(stamps)):
        recordings.append(
            Recording(
                f"{name}{label and f', {_trial_word(selection.trial)} {label}'}",
                stamps[of],
                values[of],
                names,
                None if phases is None else phases[of],
                label,
            )
        )
        _check_rate(recordings[-1], time)
    return recordings


def _numbers(column: pd.Series, what: Column, where: str) -> Array:
    """The numbers of a column in SI units; NaN where there is none."""
    if pd.api.types.is_bool_dtype(column) or not pd.api.types.is_numeric_dtype(column):
        raise ValueError(f"{where}: column '{what.name}' has type {column.dtype}, expected numbers")
    numbers = column.to_numpy(dtype=float, na_value=np.nan)
    return numbers if what.size == 1.0 else numbers * what.size


def _labels(
    column: pd.Series, kept: NDArray[np.bool_], where: str, row_name: Callable[[int], str]
) -> NDArray[np.int64] | NDArray[np.str_]:
    """Labels of the rows that are kept, as integers or texts."""
    missing = np.flatnonzero(kept & column.isna().to_numpy())
    if missing.size:
        raise ValueError(
            f"{where}: column '{column.name}' has no value in {row_name(int(missing[0]))} ({missing.size} such rows)"
        )
    codes, names = pd.factorize(column[kept])
    if pd.api.types.is_numeric_dtype(names) and not pd.api.types.is_bool_dtype(names):
        numbers = names.to_numpy(dtype=float)
        if np.array_equal(numbers, np.round(numbers)) and np.abs(numbers).max() < 2**53:
            return np.asarray(numbers.astype(np.int64)[codes])
    longest = max(len(str(name)) for name in names)
    if longest > MAX_LABEL:
        raise ValueError(
            f"{where}: column '{column.name}' has a text of {longest} characters, expected at most {MAX_LABEL}"
        )
    return np.array([str(name) for name in names])[codes]


def _phases(
    column: pd.Series, kept: NDArray[np.bool_], where: str, row_name: Callable[[int], str]
) -> NDArray[np.int64] | NDArray[np.str_]:
    """Phases of the rows that are kept; an error says how to leave the column out."""
    try:
        phases = _labels(column, kept, where, row_name)
        number = len(np.unique(phases))
        if number > MAX_PHASES:
            raise ValueError(
                f"{where}: column '{column.name}' has {number} different values, expected at most {MAX_PHASES} phases"
            )
    except ValueError as error:
        raise ValueError(f"{error}; to leave the phases out, give an empty name for their column") from error
    return phases


def _check_trials(labels: NDArray[Any], what: str, column: str) -> None:
    """Refuses a column that has the name of a column of trials, but says something else of the rows."""
    names, counts = np.unique(labels, return_counts=True)
    begins = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
    if FLAGS.issuperset(str(name).strip().lower() for name in names):
        found = f"is a flag with the values {' and '.join(map(str, names))}"
    elif len(begins) > len(names):
        found = f"changes {len(begins) - 1} times between {len(names)} values"
    elif counts.max() < 2:
        found = "has another value in each row"
    else:
        return
    raise ValueError(
        f"{what} {found}, expected rows of one trial after those of another; if it says which trial a row belongs to,"
        f" choose it (--trial-column {column}); if not, choose none (--trial-column '')"
    )


def _trials(labels: NDArray[Any] | None, rows: int) -> list[tuple[str, Any]]:
    """The name and the rows of each trial, in the order in which they first occur."""
    if labels is None:
        return [("", slice(0, rows))]
    names, first, codes = np.unique(labels, return_index=True, return_inverse=True)
    order = np.argsort(codes, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(codes))[:-1])
    return [(str(names[k]), parts[k]) for k in np.argsort(first)]


def _trial_word(column: str | None) -> str:
    """What a trial is called in the name of its recording, by the name of the column."""
    word = (column or "").strip().lower().removesuffix("_index")
    return word if word in TRIAL_COLUMNS else "trial"


def _epoch_unit(stamps: Array) -> float | None:
    """The size of the unit of time stamps that count from 1970, s; None for others."""
    interval = float(np.median(np.abs(np.diff(stamps)))) if len(stamps) > 1 else 0.0
    for size in UNITS["time"].values():
        since_epoch = EPOCH[0] <= stamps.min() * size and stamps.max() * size <= EPOCH[1]
        if since_epoch and interval > 0 and RATES[0] <= 1 / (interval * size) <= RATES[1]:
            return size
    return None


def _check_rate(recording: Recording, time: Column) -> None:
    """Refuses a time in an unknown unit that is not clearly in seconds."""
    rates = {unit: recording.rate / UNITS["time"][unit] for unit in ("s", "ms", "us", "ns")}
    plausible = {unit: rate for unit, rate in rates.items() if RATES[0] <= rate <= RATES[1]}
    sure = recording.duration <= SURE_DURATION or len(plausible) == 1
    if time.stated or ("s" in plausible and rates["s"] > 0.99 * SURE_RATE and sure):
        return
    readings = " or ".join(
        f"{rate:.6g} Hz with --columns {shlex.quote(f'time={time.name}:{unit}')}"
        for unit, rate in ({"s": rates["s"]} | plausible).items()
    )
    raise ValueError(f"{recording.name}: column '{time.name}' does not say its unit: {readings}; say which")
