"""One self-contained HTML page about the results of sweeps: curves, tables, and the commands behind every number.

The layout is in scoreboard.html and scoreboard.css; scoreboard.js sorts the tables.
"""

from __future__ import annotations

import html
import math
import os
from pathlib import Path
from urllib.parse import quote

from experiments.scoreboard.columns import COLUMNS, Column
from experiments.scoreboard.paired_statistics import MIN_UNITS
from experiments.scoreboard.queries import commands_of, sweep_commands
from experiments.scoreboard.summary import Row, Scoreboard, Table
from experiments.sweep.trial_files import partition
from interfaces.reports.page_template import fill_page, svg_element
from interfaces.reports.scoreboard_curves import curve_figure, curves_of, limit_curves, styles_of

FORCES = ("contact", "load", "mean load", "above 20 N")
"""Columns that say little where the physics is not trusted."""

DIGEST = 12
"""Characters of a digest that are shown."""


def scoreboard_page(board: Scoreboard, out: Path) -> str:
    """Returns the page as HTML text, which needs no other file; links lead from ``out`` to the files of the trials."""
    styles = styles_of(sorted({row.summary.policy for table in board.tables for row in table.rows}))
    return fill_page(
        "scoreboard",
        assets=("page", "scoreboard"),
        title=html.escape(board_title(board)),
        about=html.escape(about(board)),
        warnings="".join(f'<p class="warning">{html.escape(text)}</p>' for text in warnings(board)),
        contents=_contents(board.tables),
        curves="".join(
            f'<section class="curve">{svg_element(curve_figure(curve, styles))}</section>'
            for curve in (*curves_of(board), *limit_curves(board))
        ),
        tables="\n".join(_table(number, table, board, out) for number, table in enumerate(board.tables)),
        reference=html.escape(board.reference),
        columns="".join(
            f"<dt>{html.escape(column.name)}</dt><dd>{html.escape(column.tip)}"
            f"{f' <code>{html.escape(column.pandas)}</code>' if column.pandas else ''}</dd>"
            for column in COLUMNS
        ),
        sweeps=_sweeps(board, out),
    )


def board_title(board: Scoreboard) -> str:
    """The heading: the titles of the sweeps."""
    titles = [sweep.title for sweep in board.sweeps]
    return f"Scoreboard: {'; '.join(titles)}" if titles else f"Scoreboard of {board.folder.resolve().name}"


def about(board: Scoreboard) -> str:
    """What the tables are about, in one line."""
    policies = {row.summary.policy for table in board.tables for row in table.rows}
    tables = f"{len(board.tables)} table{'' if len(board.tables) == 1 else 's'}"
    return (
        f"{board.trials:,} trials of {len(policies)} {'policy' if len(policies) == 1 else 'policies'} in {tables},"
        f" all made by the code {codes_text(board)}; compared with “{board.reference}”"
    )


def codes_text(board: Scoreboard) -> str:
    """The code that made the trials: of each engine, if they differ."""
    codes = {engine: digest[:DIGEST] for engine, digest in board.codes.items()}
    if len(set(codes.values())) == 1:
        return next(iter(codes.values()))
    return ", ".join(f"{digest} ({engine})" for engine, digest in codes.items())


def warnings(board: Scoreboard) -> list[str]:
    """What a reader must know before believing the tables."""
    found = []
    if board.left_out:
        other = ", ".join(f"{count:,} of {code[:DIGEST]}" for code, count in board.left_out.items())
        total = sum(board.left_out.values())
        found.append(
            f"{total:,} trial{' is' if total == 1 else 's are'} left out, because other code made"
            f" {'it' if total == 1 else 'them'}: {other}. The tables hold the newest code only, {codes_text(board)}."
        )
    if board.replaced:
        found.append(
            f"{board.replaced:,} trial{' is' if board.replaced == 1 else 's are'} left out, because the policy has been"
            " made anew since: its specification, its demonstrations, its own modules, or a version has changed."
        )
    untrusted = sum(row.summary.untrusted for table in board.tables for row in table.rows)
    if untrusted:
        found.append(
            f"{untrusted:,} of {board.trials:,} trials have physics that is not trusted: bodies overlap by more than a"
            " quarter of the clearance. Their forces say little about metal; the column “physics” counts them."
        )
    compared = [row.paired for table in board.tables for row in table.rows if row.paired is not None]
    few = sum(not pair.is_tested for pair in compared)
    if few:
        found.append(
            f"{few:,} of {len(compared):,} comparisons have fewer than {MIN_UNITS} sets of demonstrations (or trials,"
            f" if neither policy has sets). A flip of signs cannot reach 5 % then: {MIN_UNITS - 1} sets that agree have"
            f" p {2.0 ** (2 - MIN_UNITS):.2f}. So nothing is concluded about other sets; the differences of each are"
            " shown."
        )
    if not board.sweeps:
        found.append("No specification of a sweep is stored with these trials, so that their command is not known.")
    return found


def address(path: Path, out: Path) -> str:
    """The address of a file, relative to the page."""
    return quote(Path(os.path.relpath(path.resolve(), out.parent.resolve())).as_posix())


def link(board: Scoreboard, row: Row, out: Path) -> str:
    """The address of the folder of a row's trials, relative to the page."""
    conditions = row.summary.conditions
    return address(partition(board.folder, row.summary.policy, conditions.trial_set, conditions.engine), out) + "/"


def _contents(tables: list[Table]) -> str:
    """Links to the tables, if there are several."""
    if len(tables) < 2:
        return ""
    links = "".join(f'<a href="#table-{k}">{html.escape(table.conditions.title)}</a>' for k, table in enumerate(tables))
    return f'<nav aria-label="tables">{links}</nav>'


def _table(number: int, table: Table, board: Scoreboard, out: Path) -> str:
    """A table, and below it the commands behind each of its rows."""
    return (
        f'<section id="table-{number}"><h2>{html.escape(table.conditions.title)}</h2>'
        '<div class="scroll" tabindex="0"><table><thead><tr><th scope="col" class="text"><button type="button">policy'
        f"<small>&nbsp;</small></button></th>{''.join(_heading(column) for column in COLUMNS)}</tr></thead><tbody>\n"
        + "\n".join(_row(row, board, out) for row in table.rows)
        + "\n</tbody></table></div>\n<details><summary>commands behind each row</summary>\n"
        + "\n".join(_commands(row, board) for row in table.rows)
        + "\n</details></section>"
    )


def _heading(column: Column) -> str:
    first = "ascending" if column.low_is_good else "descending"
    style = "" if column.is_main else "more"
    return (
        f'<th scope="col" class="{style}" title="{html.escape(column.tip)}"><button type="button" data-first="{first}">'
        f"{html.escape(column.name)}<small>{html.escape(column.unit)}</small></button></th>"
    )


def _row(row: Row, board: Scoreboard, out: Path) -> str:
    """The table row of a policy; its name links the trials."""
    policy = row.summary.policy
    role = "<small>reference</small>" if policy == board.reference else ""
    name = f'<a href="{link(board, row, out)}">{html.escape(policy)}</a>{role}'
    return f'<tr><th scope="row" class="text">{name}</th>{"".join(_cell(column, row) for column in COLUMNS)}</tr>'


def _cell(column: Column, row: Row) -> str:
    key, note = row.key(column), row.note(column)
    doubtful = column.name in FORCES and row.summary.untrusted > 0
    classes = {"more": not column.is_main, "doubtful": doubtful, "words": column.name == "faults"}
    return (
        f'<td class="{" ".join(name for name, applies in classes.items() if applies)}"'
        f' data-key="{"" if math.isnan(key) else f"{key:.9g}"}">{html.escape(row.text(column))}'
        f"{f'<small>{html.escape(note)}</small>' if note else ''}</td>"
    )


def _commands(row: Row, board: Scoreboard) -> str:
    """The commands behind a row, folded."""
    policy, conditions = row.summary.policy, row.summary.conditions
    commands = "".join(
        f"<dt>{html.escape(name)}</dt><dd><pre>{html.escape(command)}</pre></dd>"
        for name, command in commands_of(board, policy, conditions)
    )
    return f'<details class="row"><summary>{html.escape(policy)}</summary><dl>{commands}</dl></details>'


def _sweeps(board: Scoreboard, out: Path) -> str:
    """The stored specifications with the commands that make their trials."""
    if not board.sweeps:
        return "<p>none stored</p>"
    items = "".join(
        f'<dt><a href="{address(sweep.path, out)}">{html.escape(sweep.title)}</a></dt>'
        f"<dd><pre>{html.escape(command)}</pre></dd>"
        for sweep, command in zip(board.sweeps, sweep_commands(board), strict=True)
    )
    return f"<dl>{items}</dl>"
