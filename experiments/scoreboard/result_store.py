"""Reads the trials of a sweep: a folder of Parquet files, one row a trial, in a folder for each policy, arm and engine.

    RESULTS/trials/policy=<name, percent-encoded>/arm=<default|stress>/engine=<drake|mujoco>/<block>.parquet
    RESULTS/sweeps/<name>.yaml

The files are read one after the other and in batches, and only the columns that a scoreboard needs: about 200 bytes a
trial stay in memory.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import unquote

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from pandas.api.types import union_categoricals

from models.document import read_document, read_text
from skill.data.tables import TEMPORARY_MARK, named_parquet_errors

PARTITIONS = ("policy", "arm", "engine")
"""Columns that the names of the folders hold, from the outermost on."""

TEXTS = ("factors", "outcome", "fault", "code", "skill")
"""Columns with few different texts."""

FLAGS = ("inserted", "trusted")
"""Columns with true, false, or nothing."""

NUMBERS = (
    *("trial", "demonstration_set", "demonstrations", "train_s", "states", "query_ms"),
    *("time_s", "time_limit_s", "peak_contact_n", "peak_load_n", "mean_load_n", "seconds_above_20n"),
    *("wedged_s", "lost_steps", "back_offs", "field_score", "cpu_s"),
)
"""Columns with numbers or nothing."""

REQUIRED_NUMBERS = ("trial", "time_s", "time_limit_s")

COLUMNS = ("key", "began", *TEXTS, *FLAGS, *NUMBERS)

MADE_FOR = (*PARTITIONS, "factors", "demonstration_set")
"""What a policy is made for: among the trials that agree in these columns, those of the newest policy count."""

PUBLISHED = "trials.parquet"
"""The name of the files of a published copy, one for each policy, arm and engine."""

BATCH = 4096
"""Rows that are read at once."""


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
    """Which trials of a folder of results count: those of the newest code, and of them those of the newest policies.

    The policy of a name is made anew where its specification, demonstrations or modules, or a version have changed.

    Attributes:
        folder: the folder of results.
        code: digest of the code that made them.
        left_out: number of trials of other code, by its digest.
        replaced: number of trials of that code whose policy has been made anew since.
        skills: digests of the policies in the table, if there are others; else empty.
        published: whether the folder is a published copy, in which no sweep goes on.
        sweeps: the stored specifications.
    """

    folder: Path
    code: str
    left_out: dict[str, int]
    replaced: int
    skills: tuple[str, ...]
    published: bool
    sweeps: list[Sweep]


@dataclass(frozen=True)
class Trials(Origin):
    """The trials that count in a folder of results.

    Attributes:
        table: one row a trial: `PARTITIONS` and `TEXTS` as categories, `NUMBERS` and `FLAGS` as floats with NaN for
            nothing (true is 1), but ``inserted`` as bool.
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
    made: list[pd.DataFrame] = []
    for number, path in enumerate(paths):
        part, began = _read_file(path, folder / "trials")
        part["file"] = number
        parts.append(part)
        made.append(began)
        advance(path.name)
    policies = pd.concat(made, ignore_index=True).sort_values(["began", "code", "skill"])
    if policies.empty:
        raise ValueError(f"{folder}: no trials yet; expected at least one row in the files of {folder / 'trials'}")
    table = _joined(parts)
    _check_keys(table, paths)
    code = str(policies["code"].iloc[-1])
    counts = table["code"].value_counts()
    left_out = {str(digest): int(count) for digest, count in counts.items() if digest != code}
    of_code = table[table["code"] == code]
    newest = policies[policies["code"] == code].drop_duplicates([*MADE_FOR], keep="last")
    skills = tuple(sorted(newest["skill"].unique()))
    kept = of_code[of_code["skill"].isin(skills)]
    _check_scenarios(kept, paths)
    kept = kept.drop(columns=["key", "file"]).reset_index(drop=True)
    for name in (*PARTITIONS, *TEXTS):
        kept[name] = kept[name].cat.remove_unused_categories()
    replaced = len(of_code) - len(kept)
    return Trials(
        folder=folder,
        code=code,
        left_out=left_out,
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
    root = folder / "trials"
    if not folder.exists():
        raise ValueError(f"{folder}: no such folder; expected one that `haptic-skill sweep` wrote")
    if not folder.is_dir():
        raise ValueError(f"{folder}: is a file; expected a folder that `haptic-skill sweep` wrote")
    if not root.is_dir():
        raise ValueError(f"{folder}: no folder 'trials' in it; expected a folder that `haptic-skill sweep` wrote")
    paths = sorted(path for path in root.rglob("*.parquet") if TEMPORARY_MARK not in path.name)
    if not paths:
        raise ValueError(f"{folder}: no trials yet; expected files such as {'/'.join(_pattern())}")
    for path in paths:
        partition_of(path, root)
    return paths


def partition_of(path: Path, root: Path) -> dict[str, str]:
    """Returns policy, arm and engine of a file from the names of its folders.

    Raises:
        ValueError: if the folders have other names.
    """
    parts = path.relative_to(root).parts[:-1]
    pairs = [part.partition("=") for part in parts]
    if tuple(name for name, _, _ in pairs) != PARTITIONS or not all(value for _, _, value in pairs):
        raise ValueError(f"{path}: not a file of trials; expected {root}/{'/'.join(_pattern())}")
    return {name: unquote(value) for name, _, value in pairs}


def read_sweeps(folder: Path) -> list[Sweep]:
    """Returns the stored specifications, sorted by name.

    Raises:
        ValueError: if one is no specification. The message names it.
    """
    sweeps = []
    for path in sorted((folder / "sweeps").glob("*.yaml")):
        specification = read_document(read_text(path, str(path)), str(path))
        title = specification.get("title", path.stem) if isinstance(specification, dict) else None
        if not isinstance(title, str):
            raise ValueError(f"{path}: not a specification of a sweep; expected keys with values, and a text as title")
        sweeps.append(Sweep(path, title.strip()))
    return sweeps


def _pattern() -> list[str]:
    return [*(f"{name}=..." for name in PARTITIONS), "*.parquet"]


def _read_file(path: Path, root: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Returns the rows of a file, and when the newest trial of each of its policies began: `MADE_FOR`, code, skill."""
    with named_parquet_errors(path, "file of trials"):
        file = pq.ParquetFile(path)
    _check_schema(file.schema_arrow, path)
    with file, named_parquet_errors(path, "file of trials"):
        batches = [_rows(batch) for batch in file.iter_batches(BATCH, columns=list(COLUMNS))]
    rows = pd.concat(batches, ignore_index=True) if batches else _rows(file.schema_arrow.empty_table())
    for name in ("key", "began", "inserted", *TEXTS, *REQUIRED_NUMBERS):
        if rows[name].isna().any():
            raise ValueError(f"{path}: column '{name}' is empty in row {int(rows[name].isna().argmax())}")
    partition = partition_of(path, root)
    groups = rows.groupby(["factors", "demonstration_set", "code", "skill"], dropna=False)
    policies = groups["began"].max().reset_index().assign(**partition)
    policies["began"] = [_time(text, path) for text in policies["began"]]
    rows["inserted"] = rows["inserted"].astype(bool)
    for name, value in partition.items():
        rows[name] = pd.Categorical([value] * len(rows), categories=[value])
    for name in TEXTS:
        rows[name] = rows[name].astype("category")
    return rows.drop(columns="began"), policies


def _check_schema(schema: pa.Schema, path: Path) -> None:
    """Checks that a file has the columns that are read, with their types; a column without values may have no type."""
    missing = [name for name in COLUMNS if name not in schema.names]
    if missing:
        raise ValueError(f"{path}: lacks the columns {missing}; expected a file of `haptic-skill sweep`")
    types = pa.types
    for name in COLUMNS:
        found = schema.field(name).type
        if name in FLAGS:
            expected, fits = "true or false", types.is_boolean(found)
        elif name in NUMBERS:
            expected, fits = "numbers", types.is_integer(found) or types.is_floating(found)
        else:
            expected, fits = "texts", types.is_string(found) or types.is_large_string(found)
        if not (fits or types.is_null(found)):
            raise ValueError(f"{path}: column '{name}' has type {found}, expected {expected}")


def _rows(batch: pa.RecordBatch | pa.Table) -> pd.DataFrame:
    """The rows of a batch: numbers and flags as floats, and of each key a hash of 64 bits."""
    found = {}
    for name in COLUMNS:
        values = batch.column(name)
        if name in (*NUMBERS, *FLAGS):
            found[name] = values.cast(pa.float64()).to_numpy(zero_copy_only=False)
        else:
            found[name] = values.to_pandas()
    rows = pd.DataFrame(found)
    if not rows["key"].isna().any():
        rows["key"] = pd.util.hash_array(rows["key"].to_numpy(dtype=object))
    return rows


def _time(text: str, path: Path) -> datetime:
    """The time of a text, in UTC if it does not say."""
    try:
        time = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{path}: 'began' is {text!r}, expected a time such as 2026-01-31T12:00:00+00:00") from None
    return time if time.tzinfo else time.replace(tzinfo=UTC)


def _joined(parts: list[pd.DataFrame]) -> pd.DataFrame:
    """All rows; the categories of a column are those of all parts."""
    texts = (*PARTITIONS, *TEXTS)
    table = pd.concat([part.drop(columns=list(texts)) for part in parts], ignore_index=True)
    for name in texts:
        table[name] = union_categoricals([part[name] for part in parts])
    return table


def _check_keys(table: pd.DataFrame, paths: list[Path]) -> None:
    """Checks that no trial is stored twice."""
    place, trial = _found_twice(table, ["key"], paths)
    if place:
        raise ValueError(f"{place}: trial {trial} with the same key; expected each trial once")


def _check_scenarios(table: pd.DataFrame, paths: list[Path]) -> None:
    """Checks that no policy has performed a trial in two scenarios, whose rows would count as one cell."""
    place, trial = _found_twice(table, [*MADE_FOR, "skill", "trial"], paths)
    if place:
        reason = "the scenario, which has changed under its name, or the versions of the packages differ"
        raise ValueError(f"{place}: trial {trial} of one policy and cell; {reason}: move the older file away")


def _found_twice(table: pd.DataFrame, columns: list[str], paths: list[Path]) -> tuple[str, str]:
    """Returns the files and the number of the first trial that agrees with another in some columns, else nothing."""
    groups = table[table.duplicated(columns, keep=False)]
    if groups.empty:
        return "", ""
    second = groups[groups.duplicated(columns)].iloc[0]
    same = [groups[name].eq(second[name]) | (groups[name].isna() & pd.isna(second[name])) for name in columns]
    first = groups[pd.concat(same, axis=1).all(axis=1)].iloc[0]
    where = paths[int(first["file"])], paths[int(second["file"])]
    place = f"{where[0]} and {where[1]}" if where[0] != where[1] else f"{where[0]}, twice"
    return place, f"{second['trial']:.0f}"
