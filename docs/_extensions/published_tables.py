"""The directive ``{published_trials} NAME``: tables of the trials in ``docs/NAME``, made when the site is built.

The page shows a few columns. A page of `haptic-skill scoreboard` with all of them, the curves and the command behind
each number stands beside it, in ``tables/NAME.html``.
"""

from __future__ import annotations

import shutil
from itertools import groupby
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from experiments.scoreboard.columns import COLUMNS
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import Cell, Row, Scoreboard, make_scoreboard
from interfaces.reports.scoreboard_page import about, scoreboard_page, warnings

SHOWN = {"inserted", "sets", "against", "time", "contact", "load", "jams", "physics"}
HEADINGS = {column.name: f"{column.name}, {column.unit}" for column in COLUMNS if column.name in SHOWN}
HEADINGS["physics"] = "physics not trusted"


class PublishedTrials(SphinxDirective):
    """Shows the tables of a folder of trials."""

    required_arguments = 1
    option_spec = {"against": lambda text: text}

    def run(self) -> list[nodes.Node]:
        """Returns the tables; the whole page is written when the build ends."""
        name = self.arguments[0]
        folder = Path(self.env.srcdir) / name
        board = make_scoreboard(read_trials(folder), self.options.get("against"))
        self.env.note_dependency(str(folder))
        target = Path(self.env.app.outdir) / "tables" / f"{name}.html"
        shutil.copytree(folder, target.parents[1] / name, dirs_exist_ok=True)  # what the page links
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(scoreboard_page(board, target), encoding="utf-8")
        return self.parse_text_to_nodes(tables(board, name))


def tables(board: Scoreboard, name: str) -> str:
    """Returns Markdown: the trials, the commands that perform them, and a table for each set of trials and engine."""
    sweeps = [f"docs/{name}/sweeps/{sweep.path.name}" for sweep in board.sweeps]
    commands = "\n".join(f"    haptic-skill sweep {sweep} --out out/sweeps/{name}" for sweep in sweeps)
    notes = "\n\n".join(f"**{text}**" for text in warnings(board))
    page = f'<a href="tables/{name}.html">All columns, curves, and the command behind each number</a>.'
    parts = [f"{about(board)}. {page}", notes, commands]
    for conditions, found in groupby(board.tables, lambda table: (table.cell.trial_set, table.cell.engine)):
        rows = [row_text(table.cell, row) for table in found for row in table.rows]
        heads = ["conditions", "policy", *HEADINGS.values()]
        varied = any(row[0] for row in rows)
        lines = [heads, ["---"] * len(heads), *rows]
        text = "\n".join(f"| {' | '.join(line if varied else line[1:])} |" for line in lines)
        parts.append(f"**{conditions[0].capitalize()} trials, {conditions[1]}**\n\n{text}")
    parts.append("\n".join(f"- *{column.name}*: {column.tip}." for column in COLUMNS if column.name in SHOWN))
    return "\n\n".join(part for part in parts if part)


def row_text(cell: Cell, row: Row) -> list[str]:
    """Returns the cells of a policy: conditions, name, and the columns that are shown."""
    conditions = ", ".join(cell.title.split(", ")[2:])
    found = [conditions, row.summary.policy]
    for column in COLUMNS:
        if column.name in SHOWN:
            note = "" if column.name == "physics" else row.note(column)
            parts = [row.text(column), f"({note})" if note else ""]
            found.append(" ".join(part.replace(" ", "\N{NO-BREAK SPACE}") for part in parts).strip(" "))
    return [text.replace("|", "\\|").replace("<", "&lt;") for text in found]


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("published_trials", PublishedTrials)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
