"""The commands behind a scoreboard: what made the trials, and one line each that recomputes a row from the files."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from experiments.scoreboard.columns import COLUMNS
from experiments.scoreboard.summary import Conditions, Scoreboard
from experiments.sweep.trial_files import partition


def sweep_commands(board: Scoreboard) -> list[str]:
    """Returns the commands that make the trials of a folder of results, one for each stored sweep.

    No sweep goes on in a published copy: its trials are made in another folder.
    """
    folder = Path("out", "sweeps", board.folder.resolve().name) if board.published else board.folder
    out = shlex.quote(str(folder))
    return [f"haptic-skill sweep {shlex.quote(str(sweep.path))} --out {out}" for sweep in board.sweeps]


def row_command(board: Scoreboard, policy: str, conditions: Conditions) -> str:
    """Returns a line of Python that recomputes a row: its plain aggregates, named as the columns, as a Series."""
    values = ", ".join(f"{column.name!r}: {column.pandas}" for column in COLUMNS if column.pandas)
    rows = _read(board, policy, conditions)
    return f"import pandas; d = {rows}; r = pandas.Series({{'trials': len(d), {values}}}); print(r)"


def paired_command(board: Scoreboard, policy: str, conditions: Conditions) -> str:
    """Returns a line of Python that counts the pairs of a row and the reference, and compares their times.

    See `experiments.scoreboard.summary.compare`.
    """
    mine, others = (_read(board, name, conditions) for name in (policy, board.reference))
    return (
        f"import pandas; d = {mine}.merge({others}, on='trial');"
        " a, b = d.demonstration_set_x, d.demonstration_set_y; d = d[(a == b) | a.isna() | b.isna()];"
        " u = d.demonstration_set_x.fillna(d.demonstration_set_y).fillna(-1 - d.trial);"
        " a, b = d.inserted_x, d.inserted_y;"
        " r = pandas.Series({'pairs': len(d), 'better': (a & ~b).sum(), 'worse': (b & ~a).sum(), 'slower':"
        " (d.time_s_x.where(a, d.time_limit_s_x) - d.time_s_y.where(b, d.time_limit_s_y)).groupby(u).mean().mean()});"
        " print(r)"
    )


def _read(board: Scoreboard, policy: str, conditions: Conditions) -> str:
    """The expression of the trials of a policy under some conditions."""
    filters: list[tuple[str, str, Any]] = [
        ("code", "==", board.codes[conditions.engine]),
        ("factors", "==", conditions.factors),
    ]
    if board.skills:
        filters.append(("skill", "in", list(board.skills)))
    folder = partition(board.folder, policy, conditions.trial_set, conditions.engine)
    return f"pandas.read_parquet({str(folder)!r}, filters={filters!r})"


def commands_of(board: Scoreboard, policy: str, conditions: Conditions) -> list[tuple[str, str]]:
    """Returns what a reader needs to check a row: (what it is, command or statement).

    The trials do not tell which of several sweeps they belong to: there is one command for each.
    """
    made = zip((f"make the trials of {sweep.title}" for sweep in board.sweeps), sweep_commands(board), strict=True)
    found = [*made, ("recompute with Python", row_command(board, policy, conditions))]
    if policy != board.reference:
        found.append((f"pairs with {board.reference}", paired_command(board, policy, conditions)))
    return found
