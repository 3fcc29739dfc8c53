"""The tables of a scoreboard for the terminal, with the columns that matter most."""

from __future__ import annotations

from rich.table import Table as RichTable
from rich.text import Text

from experiments.scoreboard.columns import COLUMNS
from experiments.scoreboard.summary import Scoreboard, Table
from interfaces.reports.result_tables import plain_table


def terminal_table(table: Table, board: Scoreboard) -> RichTable:
    """One row per policy; below a number what stands below it on the page."""
    columns = [column for column in COLUMNS if column.is_main]
    found = plain_table(table.cell.title)
    found.add_column("policy", overflow="fold")
    for column in columns:
        found.add_column(f"{column.name}\n({column.unit})", justify="right")
    for row in table.rows:
        name = f"{row.summary.policy} (reference)" if row.summary.policy == board.reference else row.summary.policy
        cells = [f"{row.text(column)}\n{row.note(column)}".strip() for column in columns]
        found.add_row(Text(name), *(Text(cell, justify="right") for cell in cells))
    return found
