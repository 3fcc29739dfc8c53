"""Reads the trials of a sweep, with the columns that a scoreboard needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from experiments.sweep.trial_files import PARTITIONS, PUBLISHED, SCHEMA, SWEEPS, TRIALS
from models.document import read_document, read_text
from skill.data.files import TEMPORARY_MARK
from skill.data.tables import named_parquet_errors

TEXTS = ("factors", "outcome", "fault", "code", "skill")
"""Columns with few different texts."""

NUMBERS = (
    *("trusted", "trial", "demonstration_set", "demonstrations", "train_s", "query_ms"),
    *("time_s", "time_limit_s", "peak_contact_n", "peak_load_n", "mean_load_n", "seconds_above_20n"),
    *("wedged_s", "lost_steps", "back_offs", "field_score", "cpu_s"),
)
"""Columns with numbers, or true and false, or nothing; ``inserted`` has no gaps."""

REQUIRED = ("key", "began", *TEXTS, "trial", "time_s", "time_limit_s")
"""Columns with a value in every row, as ``inserted`` has."""

STORED = pa.schema(
    [
        pa.field(field.name, pa.float64() if field.name in NUMBERS else field.type, field.name not in REQUIRED)
        for field in SCHEMA
        if field.name in (*REQUIRED, *NUMBERS, "inserted")
    ]
)
"""The columns that are read."""

MADE_FOR = [*PARTITIONS, "factors", "demonstration_set"]
"""What a policy is made for: among the trials that agree in these columns, those of the newest policy count."""

RIVALS = [*MADE_FOR, "skill", "trial"]
"""Among the trials that count, no two agree in these columns."""


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
class Trials:
    """The trials of a folder of results that count: in each engine those of the newest code and the newest policies.

    The policy of a name is made anew where its specification, demonstrations or modules, or a version have changed.

    Attributes:
        folder: the folder of results.
        codes: digest of the code that made them, by the engine.
        left_out: number of trials of other code, by its digest.
        replaced: number of trials of those codes whose policy has been made anew since.
        skills: digests of the policies in the table, if there are others; else empty.
        published: whether the folder is a published copy, in which no sweep goes on.
        sweeps: the stored specifications.
        table: one row a trial: `PARTITIONS` and `TEXTS` as categories, ``inserted`` as bool, `NUMBERS` as floats, with
            1 for true and NaN for nothing.
    """

    folder: Path
    codes: dict[str, str]
    left_out: dict[str, int]
    replaced: int
    skills: tuple[str, ...]
    published: bool
    sweeps: list[Sweep]
    table: pd.DataFrame


def read_trials(folder: Path, advance: Callable[[str], None] = lambda _: None) -> Trials:
    """Reads the trials of a folder of results; a row that several files hold counts once.

    Args:
        folder: that `haptic-skill sweep` wrote.
        advance: called after each file.

    Raises:
        ValueError: if the folder is missing, holds no trials or other things, or a file is damaged. The message names
            the folder or the file.
    """
    paths = trial_files(folder)
    parts: list[pd.DataFrame] = []
    for number, path in enumerate(paths):
        parts.append(_read_file(path, folder / TRIALS).assign(file=number))
        advance(path.name)
    table = pd.concat(parts, ignore_index=True).drop_duplicates("key")
    if table.empty:
        raise ValueError(f"{folder}: no trials yet; expected at least one row in the files of {folder / TRIALS}")
    table = table.sort_values(["began", "code", "skill"], kind="stable")
    newest = table.drop_duplicates("engine", keep="last").set_index("engine")["code"].sort_index()
    is_newest = table["code"] == table["engine"].map(newest)
    of_code = table[is_newest]
    skills = tuple(sorted(of_code.drop_duplicates(MADE_FOR, keep="last")["skill"].unique()))
    kept = of_code[of_code["skill"].isin(skills)].sort_index()
    _refuse_rivals(kept, paths)
    kept = kept.drop(columns=["key", "began", "file"]).reset_index(drop=True)
    replaced = len(of_code) - len(kept)
    return Trials(
        folder=folder,
        codes={str(engine): str(digest) for engine, digest in newest.items()},
        left_out={str(digest): count for digest, count in table["code"][~is_newest].value_counts().items()},
        replaced=replaced,
        skills=skills if replaced else (),
        published=any(path.name == PUBLISHED for path in paths),
        sweeps=read_sweeps(folder),
        table=kept.astype(dict.fromkeys((*PARTITIONS, *TEXTS), "category")),
    )


def trial_files(folder: Path) -> list[Path]:
    """Returns the files of the trials, sorted.

    Raises:
        ValueError: if there are none, or the folder is not one of results.
    """
    root = folder / TRIALS
    if not root.is_dir():
        raise ValueError(f"{folder}: no folder '{TRIALS}' in it; expected a folder that `haptic-skill sweep` wrote")
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
        specification = read_document(read_text(path, str(path)), str(path))
        title = specification.get("title", path.stem) if isinstance(specification, dict) else None
        if not isinstance(title, str):
            raise ValueError(f"{path}: not a specification of a sweep; expected keys with values, and a text as title")
        sweeps.append(Sweep(path, title.strip()))
    return sweeps


def _pattern(root: Path) -> str:
    return "/".join([str(root), *(f"{name}=..." for name in PARTITIONS), "*.parquet"])


def _read_file(path: Path, root: Path) -> pd.DataFrame:
    """Returns the rows of a file, with a column for each of `PARTITIONS`."""
    pairs = [part.partition("=") for part in path.relative_to(root).parts[:-1]]
    if tuple(name for name, _, _ in pairs) != PARTITIONS:
        raise ValueError(f"{path}: not a file of trials; expected {_pattern(root)}")
    with named_parquet_errors(path, "file of trials"):
        rows: pd.DataFrame = pq.ParquetFile(path).read(columns=STORED.names).cast(STORED).to_pandas()
        began = pd.to_datetime(rows["began"], utc=True, format="ISO8601")
    return rows.assign(began=began, **{name: unquote(value) for name, _, value in pairs})


def _refuse_rivals(table: pd.DataFrame, paths: list[Path]) -> None:
    """Refuses two rows for one trial of a policy under the same conditions; names the first of them and their files."""
    for _, same in table[table.duplicated(RIVALS, keep=False)].groupby(RIVALS, dropna=False, sort=False):
        first, last = (paths[same["file"].iloc[k]] for k in (0, -1))
        raise ValueError(
            f"{first} and {last}: trial {same['trial'].iloc[0]:.0f} of one policy under the same conditions; the"
            " scenario has changed under its name, or the versions of the packages differ: move the older file away"
        )
