"""Figures of the published trials, made when the site is built, so that no page states one by hand.

The role ``{inserted}`NAME: QUERY` `` is the number of trials of ``docs/NAME`` that are inserted, such as "397 of 400".
The query is that of `pandas.DataFrame.query`. The directive ``{insertions} NAME`` is a table of such numbers, and the
directive ``{published_trials} NAME`` all of a folder, with the page of `haptic-skill scoreboard` beside it.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
from docutils import nodes
from docutils.parsers.rst.directives import unchanged
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective, SphinxRole

from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from interfaces.reports.scoreboard_page import scoreboard_page

CONDITIONS = ["engine", "trial_set", "factor", "value", "policy"]


def published(folder: Path) -> pd.DataFrame:
    """Returns the published rows of a folder, with the columns ``factor`` and ``value``, what the sweep varies."""
    rows = pd.read_parquet(folder / "trials").astype({"policy": str, "engine": str})
    rows["trial_set"] = pd.Categorical(rows["trial_set"], ["usual", "hard"], ordered=True)
    varied = rows["factors"].astype(str).map(lambda text: next(iter(json.loads(text).items()), ("", None)))
    rows["factor"], rows["value"] = varied.str[0], varied.str[1]
    return rows.sort_values(CONDITIONS)


def inserted(rows: pd.DataFrame) -> str:
    """Returns how many trials are inserted, of how many."""
    return f"{rows.inserted.sum():,} of {len(rows):,}"


def insertions(rows: pd.DataFrame, down: list[str], across: list[str]) -> pd.DataFrame:
    """Returns the numbers of insertions for the values of some columns, down and across the table."""
    counts = rows.groupby([*down, *across], observed=True)[["inserted"]].apply(inserted)
    table = counts.unstack(across).fillna("") if across else counts.to_frame("inserted")
    table.columns = [", ".join(map(str, name if isinstance(name, tuple) else (name,))) for name in table.columns]
    return table.reset_index()


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Returns a row for each policy in each engine, set of trials and value of the factor; medians of all trials."""
    groups = rows.groupby(CONDITIONS, sort=False, observed=True, dropna=False)
    numbers = groups.agg(
        time=("time_s", "median"),
        load=("peak_load_n", "median"),
        trusted=("trusted", "mean"),
        sets=("demonstration_set", "nunique"),
    )
    numbers["trusted"] *= 100
    table = numbers.round(2).rename(columns={"time": "time, s", "load": "largest load, N", "trusted": "trusted, %"})
    table.insert(0, "inserted", groups[["inserted"]].apply(inserted))
    return table.reset_index().fillna("")


def markdown(table: pd.DataFrame) -> str:
    """Returns a table as Markdown."""
    lines = [table.columns, ["---"] * table.shape[1], *table.itertuples(index=False)]
    return "\n".join(f"| {' | '.join(str(cell).replace('|', '/') for cell in line)} |" for line in lines)


class Inserted(SphinxRole):
    """Says how many of some trials are inserted."""

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Returns the text."""
        name, _, query = self.text.partition(": ")
        return [nodes.Text(inserted(published(Path(self.env.srcdir) / name).query(query)))], []


class Insertions(SphinxDirective):
    """Shows how many of some trials are inserted, for the values of columns."""

    required_arguments = 1
    option_spec = {"where": unchanged, "rows": unchanged, "columns": unchanged}

    def run(self) -> list[nodes.Node]:
        """Returns the table."""
        rows = published(Path(self.env.srcdir) / self.arguments[0])
        if "where" in self.options:
            rows = rows.query(self.options["where"])
        table = insertions(rows, self.options["rows"].split(), self.options.get("columns", "").split())
        return self.parse_text_to_nodes(markdown(table))


class PublishedTrials(SphinxDirective):
    """Shows the tables of a folder of trials, and writes the page of its scoreboard."""

    required_arguments = 1
    option_spec = {"against": unchanged}

    def run(self) -> list[nodes.Node]:
        """Returns the tables and the commands that perform the trials."""
        name = self.arguments[0]
        folder, site = Path(self.env.srcdir) / name, Path(self.env.app.outdir)
        self.env.note_dependency(str(folder))
        page = site / "tables" / f"{name}.html"
        page.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(folder, site / name, dirs_exist_ok=True)  # what the page links
        page.write_text(scoreboard_page(make_scoreboard(read_trials(folder), self.options.get("against")), page))
        link = f'<a href="tables/{name}.html">All columns, intervals, comparisons and curves</a>.'
        sweeps = sorted((folder / "sweeps").glob("*.yaml"))
        commands = [f"    haptic-skill sweep docs/{name}/sweeps/{path.name} --out out/sweeps/{name}" for path in sweeps]
        return self.parse_text_to_nodes("\n\n".join([link, "\n".join(commands), markdown(summary(published(folder)))]))


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the role and the directives."""
    app.add_role("inserted", Inserted())
    app.add_directive("insertions", Insertions)
    app.add_directive("published_trials", PublishedTrials)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
