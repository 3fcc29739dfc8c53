"""Reads the trials of a sweep, with the columns that a scoreboard needs: about 200 bytes a trial stay in memory."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from pandas.api.types import union_categoricals

from experiments.sweep.trial_files import PARTITIONS, PUBLISHED, SCHEMA, SWEEPS, TRIALS
from models.document import read_document, read_text
from skill.data.files import TEMPORARY_MARK
from skill.data.tables import named_parquet_errors

TEXTS = ("factors", "outcome", "fault", "code", "skill")
"""Columns with few different texts."""

NUMBERS = (
    *("inserted", "trusted", "trial", "demonstration_set", "demonstrations", "train_s", "query_ms"),
    *("time_s", "time_limit_s", "peak_contact_n", "peak_load_n", "mean_load_n", "seconds_above_20n"),
    *("wedged_s", "lost_steps", "back_offs", "field_score", "cpu_s"),
)
"""Columns with numbers, or true and false, or nothing."""

COLUMNS = ("key", "began", *TEXTS, *NUMBERS)

REQUIRED = ("key", "began", *TEXTS, "inserted", "trial", "time_s", "time_limit_s")
"""Columns with a value in every row."""

MADE_FOR = [*PARTITIONS, "factors", "demonstration_set"]
"""What a policy is made for: among the trials that agree in these columns, those of the newest policy count."""


@dataclass(frozen=True)
class Sweep:
    """A specification that is stored with the results.

    Attributes:
        path: of the file.
        title: of the sweep; the name of the file if it has none.
    """

    path: Path
    title: str


@dataclass(frozen=True)
class Origin:
    """Which trials of a folder of results count: in each engine those of the newest code and the newest policies.

    The policy of a name is made anew where its specification, demonstrations or modules, or a version have changed.

    Attributes:
        folder: the folder of results.
        codes: digest of the code that made them, by the engine.
        left_out: number of trials of other code, by its digest.
        replaced: number of trials of those codes whose policy has been made anew since.
        skills: digests of the policies in the table, if there are others; else empty.
        published: whether the folder is a published copy, in which no sweep goes on.
        sweeps: the stored specifications.
    """

    folder: Path
    codes: dict[str, str]
    left_out: dict[str, int]
    replaced: int
    skills: tuple[str, ...]
    published: bool
    sweeps: list[Sweep]


@dataclass(frozen=True)
class Trials(Origin):
    """The trials that count in a folder of results.

    Attributes:
        table: one row a trial: `PARTITIONS` and `TEXTS` as categories, `NUMBERS` as floats with NaN for nothing (true
            is 1), but ``inserted`` as bool.
    """

    table: pd.DataFrame


def read_trials(folder: Path, advance: Callable[[str], None] = lambda _: None) -> Trials:
    """Reads the trials of a folder of results.

    Args:
        folder: that `haptic-skill sweep` wrote.
        advance: called after each file.

    Raises:
        ValueError: if the folder is missing, holds no trials or other things, or a file is damaged or a trial is
            stored twice. The message names the folder or the file.
    """
    paths = trial_files(folder)
    parts: list[pd.DataFrame] = []
    for number, path in enumerate(paths):
        parts.append(_read_file(path, folder / TRIALS).assign(file=number))
        advance(path.name)
    table = _joined(parts).sort_values(["began", "code", "skill"], kind="stable")
    if table.empty:
        raise ValueError(f"{folder}: no trials yet; expected at least one row in the files of {folder / TRIALS}")
    _refuse_twice(table, ["key"], paths, "with the same key; expected each trial once")
    newest = table.drop_duplicates("engine", keep="last")
    codes = dict(sorted(zip(newest["engine"].astype(str), newest["code"].astype(str), strict=True)))
    is_newest = table["code"].astype(str) == table["engine"].astype(str).map(codes)
    of_code, others = table[is_newest], table["code"][~is_newest].astype(str).value_counts()
    skills = tuple(sorted(of_code.drop_duplicates(MADE_FOR, keep="last")["skill"].unique()))
    kept = of_code[of_code["skill"].isin(skills)].sort_index()
    reason = "the scenario, which has changed under its name, or the versions of the packages differ"
    _refuse_twice(
        kept, [*MADE_FOR, "skill", "trial"], paths, f"of one policy and cell; {reason}: move the older file away"
    )
    kept = kept.drop(columns=["key", "began", "file"]).reset_index(drop=True)
    for name in (*PARTITIONS, *TEXTS):
        kept[name] = kept[name].cat.remove_unused_categories()
    replaced = len(of_code) - len(kept)
    return Trials(
        folder=folder,
        codes=codes,
        left_out={str(digest): int(count) for digest, count in others.items()},
        replaced=replaced,
        skills=skills if replaced else (),
        published=any(path.name == PUBLISHED for path in paths),
        sweeps=read_sweeps(folder),
        table=kept,
    )


def trial_files(folder: Path) -> list[Path]:
    """Returns the files of the trials, sorted.

    Raises:
        ValueError: if there are none, or the folder is not one of results.
    """
    root = folder / TRIALS
    expected = "expected a folder that `haptic-skill sweep` wrote"
    if not folder.exists():
        raise ValueError(f"{folder}: no such folder; {expected}")
    if not folder.is_dir():
        raise ValueError(f"{folder}: is a file; {expected}")
    if not root.is_dir():
        raise ValueError(f"{folder}: no folder '{TRIALS}' in it; {expected}")
    paths = sorted(path for path in root.rglob("*.parquet") if TEMPORARY_MARK not in path.name)
    if not paths:
        raise ValueError(f"{folder}: no trials yet; expected files such as {_pattern(root)}")
    return paths


def read_sweeps(folder: Path) -> list[Sweep]:
    """Returns the stored specifications, sorted by name.

    Raises:
        ValueError: if one is no specification. The message names it.
    """
    sweeps = []
    for path in sorted((folder / SWEEPS).glob("*.yaml")):
        if not path.is_file():
            raise ValueError(f"{path}: no regular file, expected the specification of a sweep; move it away")
        specification = read_document(read_text(path, str(path)), str(path))
        title = specification.get("title", path.stem) if isinstance(specification, dict) else None
        if not isinstance(title, str):
            raise ValueError(f"{path}: not a specification of a sweep; expected keys with values, and a text as title")
        sweeps.append(Sweep(path, title.strip()))
    return sweeps


def _pattern(root: Path) -> str:
    return "/".join([str(root), *(f"{name}=..." for name in PARTITIONS), "*.parquet"])


def _read_file(path: Path, root: Path) -> pd.DataFrame:
    """Returns the rows of a file: `PARTITIONS` and `TEXTS` as categories, of each key a hash of 64 bits."""
    pairs = [part.partition("=") for part in path.relative_to(root).parts[:-1]]
    if tuple(name for name, _, _ in pairs) != PARTITIONS:
        raise ValueError(f"{path}: not a file of trials; expected {_pattern(root)}")
    with named_parquet_errors(path, "file of trials"):
        table = pq.ParquetFile(path).read(columns=list(COLUMNS))
    _check_columns(table, path)
    rows = pd.DataFrame({name: table[name].cast(pa.float64()).to_numpy() for name in NUMBERS})
    _check_numbers(rows, path)
    rows["inserted"] = rows["inserted"].astype(bool)
    rows["key"] = pd.util.hash_array(table["key"].to_numpy().astype(object))
    try:
        rows["began"] = pd.to_datetime(table["began"].to_pandas(), utc=True, format="ISO8601")
    except ValueError:
        raise ValueError(f"{path}: 'began' is no time; expected one such as 2026-01-31T12:00:00+00:00") from None
    for name in TEXTS:
        rows[name] = table[name].to_pandas().astype("category")
    for name, _, value in pairs:
        rows[name] = pd.Categorical([unquote(value)] * len(rows), categories=[unquote(value)])
    return rows


def _check_columns(table: pa.Table, path: Path) -> None:
    """Checks that a file has the columns that are read, with their types; a column without values may have no type."""
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise ValueError(f"{path}: lacks the columns {missing}; expected a file of `haptic-skill sweep`")
    for name in COLUMNS:
        found, expected = table.schema.field(name).type, SCHEMA.field(name).type
        if found != expected and not pa.types.is_null(found):
            raise ValueError(f"{path}: column '{name}' has type {found}, expected {expected}")
        if name in REQUIRED and table[name].null_count:
            raise ValueError(f"{path}: column '{name}' is empty in {table[name].null_count} rows, expected a value")


def _check_numbers(rows: pd.DataFrame, path: Path) -> None:
    """Checks that all numbers are finite and, but for scores, not negative; one that is not required may be missing."""
    for name in NUMBERS:
        values = rows[name]
        least = -math.inf if name == "field_score" else 0.0
        wrong = ~(np.isfinite(values) & (values >= least)) & (values.notna() | (name in REQUIRED))
        if wrong.any():
            row = int(wrong.to_numpy().argmax())
            raise ValueError(
                f"{path}: '{name}' in row {row} is {values[row]:g}, expected a finite number from {least:g} on"
            )


def _joined(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """All rows; the categories of a column are those of all parts."""
    texts = (*PARTITIONS, *TEXTS)
    table = pd.concat([part.drop(columns=list(texts)) for part in parts], ignore_index=True)
    for name in texts:
        table[name] = union_categoricals([part[name] for part in parts], sort_categories=True)
    return table


def _refuse_twice(table: pd.DataFrame, columns: list[str], paths: list[Path], reason: str) -> None:
    """Refuses a table in which two trials agree in some columns; names the first of them and their files."""
    groups = table[table.duplicated(columns, keep=False)].sort_index()
    for _, same in groups.groupby(columns, dropna=False, observed=True):
        places = sorted({int(number) for number in same["file"]})
        where = f"{paths[places[0]]} and {paths[places[-1]]}" if len(places) > 1 else f"{paths[places[0]]}, twice"
        raise ValueError(f"{where}: trial {same['trial'].iloc[0]:.0f} {reason}")
