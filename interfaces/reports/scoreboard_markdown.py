"""The tables of a scoreboard as Markdown."""

from __future__ import annotations

from pathlib import Path

from experiments.scoreboard.columns import COLUMNS
from experiments.scoreboard.queries import row_command, sweep_commands
from experiments.scoreboard.summary import Row, Scoreboard, Table
from interfaces.reports.scoreboard_page import about, address, board_title, link, warnings


def scoreboard_markdown(board: Scoreboard, out: Path) -> str:
    """Returns the text; its links lead from ``out`` to the folders of the trials."""
    parts = [
        f"# {_plain(board_title(board))}",
        f"{_plain(about(board))}.",
        *(f"**{_plain(text)}**" for text in warnings(board)),
        _sweeps(board, out),
        *(_table(table, board, out) for table in board.tables),
        "## Columns",
        "\n".join(f"- {column.name} ({column.unit}): {_plain(column.tip)}" for column in COLUMNS),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _sweeps(board: Scoreboard, out: Path) -> str:
    """The commands that make the trials."""
    if not board.sweeps:
        return ""
    specifications = [f"[{_plain(sweep.title)}]({address(sweep.path, out)})" for sweep in board.sweeps]
    commands = "\n".join(f"    {command}" for command in sweep_commands(board))
    return f"The trials are those of {', '.join(specifications)}:\n\n{commands}"


def _table(table: Table, board: Scoreboard, out: Path) -> str:
    """A section with a table, and the command that recomputes its first row."""
    heads = ["policy", *(f"{column.name}, {column.unit}" for column in COLUMNS)]
    lines = [
        f"| {' | '.join(_plain(head) for head in heads)} |",
        f"|---{'|---:' * len(COLUMNS)}|",
        *(_row(row, board, out) for row in table.rows),
    ]
    command = row_command(board, table.rows[0].summary.policy, table.cell)
    rows = "\n".join(lines)
    return f"## {_plain(table.cell.title)}\n\n{rows}\n\nRecompute the first row with Python:\n\n    {command}"


def _row(row: Row, board: Scoreboard, out: Path) -> str:
    cells = [f"[{_plain(row.summary.policy)}]({link(board, row, out)})"]
    for column in COLUMNS:
        note = row.note(column)
        cells.append(_plain(f"{row.text(column)} ({note})" if note else row.text(column)))
    return f"| {' | '.join(cells)} |"


def _plain(text: str) -> str:
    """Text that Markdown shows as it is, on one line."""
    escaped = "".join(f"\\{c}" if c in "\\`*_[]<>|#" else c for c in " ".join(text.split()))
    return escaped.replace("&", "&amp;")
