"""The commands behind a scoreboard: what made the trials, and one line each that recomputes a row from the files."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

from experiments.scoreboard.columns import COLUMNS
from experiments.scoreboard.summary import Cell, Scoreboard
from experiments.sweeps.trial_files import TRIALS, partition

BOTH = (
    "a.trial = b.trial AND (a.demonstration_set = b.demonstration_set OR a.demonstration_set IS NULL"
    " OR b.demonstration_set IS NULL)"
)
"""Which trials of two policies are a pair; see `experiments.scoreboard.summary.compare`."""


def sweep_commands(board: Scoreboard) -> list[str]:
    """Returns the commands that make the trials of a folder of results, one for each stored sweep.

    No sweep goes on in a published copy: its trials are made in another folder.
    """
    folder = Path("out", "sweeps", board.folder.resolve().name) if board.published else board.folder
    out = shlex.quote(str(folder))
    return [f"haptic-skill sweep {shlex.quote(str(sweep.path))} --out {out}" for sweep in board.sweeps]


def row_sql(board: Scoreboard, policy: str, cell: Cell) -> str:
    """Returns the statement of DuckDB that recomputes a row: its plain aggregates, named as the columns."""
    chosen = ", ".join(f"{column.sql} AS {_name(column.name)}" for column in COLUMNS if column.sql)
    return f"SELECT count(*) AS trials, {chosen} FROM {_source(board, policy, cell)} WHERE {_conditions(board, cell)}"


def table_sql(board: Scoreboard, cell: Cell) -> str:
    """Returns the statement of DuckDB that recomputes all rows of a table; policies are named as their folders."""
    chosen = ", ".join(f"{column.sql} AS {_name(column.name)}" for column in COLUMNS if column.sql)
    pattern = str(board.folder / TRIALS / "*" / f"arm={cell.arm}" / f"engine={cell.engine}" / "*.parquet")
    return (
        f"SELECT policy, count(*) AS trials, {chosen} FROM read_parquet({_text(pattern)}, hive_partitioning=true)"
        f" WHERE {_conditions(board, cell)} GROUP BY policy ORDER BY policy"
    )


def paired_sql(board: Scoreboard, policy: str, cell: Cell) -> str:
    """Returns the statement of DuckDB that counts the pairs of a row and the reference, and their times."""
    chosen = (
        "count(*) AS pairs, count(*) FILTER (a.inserted AND NOT b.inserted) AS better,"
        " count(*) FILTER (b.inserted AND NOT a.inserted) AS worse,"
        " avg(if(a.inserted, a.time_s, a.time_limit_s) - if(b.inserted, b.time_s, b.time_limit_s)) AS slower"
    )
    sources = f"{_source(board, policy, cell)} a JOIN {_source(board, board.reference, cell)} b ON {BOTH}"
    return f"SELECT {chosen} FROM {sources} WHERE {_conditions(board, cell, 'a.')} AND {_conditions(board, cell, 'b.')}"


def row_pandas(board: Scoreboard, policy: str, cell: Cell) -> str:
    """Returns a line of Python that recomputes the same as `row_sql`, as a Series."""
    filters: list[tuple[str, str, Any]] = [("code", "==", board.code), ("factors", "==", cell.factors)]
    if board.skills:
        filters.append(("skill", "in", list(board.skills)))
    values = ", ".join(f"{column.name!r}: {column.pandas}" for column in COLUMNS if column.pandas)
    folder = str(partition(board.folder, policy, cell.arm, cell.engine))
    return (
        f"import pandas; d = pandas.read_parquet({folder!r}, filters={filters!r});"
        f" r = pandas.Series({{'trials': len(d), {values}}}); print(r)"
    )


def cell_commands(board: Scoreboard, policy: str, cell: Cell) -> list[tuple[str, str]]:
    """Returns what a reader needs to check a row: (what it is, command or statement).

    The trials do not tell which of several sweeps they belong to: there is one command for each.
    """
    made = zip((f"make the trials of {sweep.title}" for sweep in board.sweeps), sweep_commands(board), strict=True)
    found = [
        *made,
        ("recompute with DuckDB", row_sql(board, policy, cell)),
        ("recompute with Python", row_pandas(board, policy, cell)),
    ]
    if policy != board.reference:
        found.append((f"pairs with {board.reference}", paired_sql(board, policy, cell)))
    return found


def _source(board: Scoreboard, policy: str, cell: Cell) -> str:
    pattern = str(partition(board.folder, policy, cell.arm, cell.engine) / "*.parquet")
    return f"read_parquet({_text(pattern)}, hive_partitioning=false)"


def _conditions(board: Scoreboard, cell: Cell, prefix: str = "") -> str:
    skills = f" AND {prefix}skill IN ({', '.join(map(_text, board.skills))})" if board.skills else ""
    return f"{prefix}code = {_text(board.code)} AND {prefix}factors = {_text(cell.factors)}{skills}"


def _text(value: str) -> str:
    """A literal text of SQL."""
    return "'" + value.replace("'", "''") + "'"


def _name(value: str) -> str:
    """A name of SQL."""
    return json.dumps(value)
