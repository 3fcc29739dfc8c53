"""The published trials, and what the figures of the pages are computed with."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pandas as pd

from experiments.scoreboard.paired_statistics import wilson_over_sets
from experiments.scoreboard.result_store import Trials, read_trials
from experiments.scoreboard.summary import make_scoreboard

ROOT = Path(__file__).resolve().parents[2]
USUAL_FIRST = pd.CategoricalDtype(["usual", "hard"], ordered=True)
WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def published(name: str) -> pd.DataFrame:
    """Returns the rows of ``docs/NAME/trials`` with columns of their own.

    These are ``factor`` and ``value``, what the sweep varies (empty and NaN for nothing), and ``taken``, the time in
    which a failure counts as the time limit.
    """
    rows = pd.read_parquet(ROOT / "docs" / name / "trials")
    for column in ("policy", "trial_set", "engine"):
        rows[column] = rows[column].astype(str)
    rows["trial_set"] = rows["trial_set"].astype(USUAL_FIRST)
    varied = rows["factors"].map(lambda text: next(iter(json.loads(text).items()), ("", None)))
    rows["factor"], rows["value"] = varied.str[0], varied.str[1]
    rows["taken"] = rows["time_s"].where(rows["inserted"], rows["time_limit_s"])
    return rows


def inserted(rows: pd.DataFrame, *by: str) -> pd.Series:
    """Returns the number of insertions for each value of some columns, sorted; by default for each set of trials."""
    return rows.groupby(list(by or ["trial_set"])).inserted.sum()


def summary(rows: pd.DataFrame) -> pd.Series:
    """Returns insertions, their 95 % interval over sets and the worst set in per cent, and the median of ``taken``."""
    sets = rows.groupby("demonstration_set").inserted.agg(["sum", "count"])
    low, high = wilson_over_sets(sets["sum"], sets["count"])
    shares = {"low": 100 * low, "high": 100 * high, "worst": 100 * (sets["sum"] / sets["count"]).min()}
    return pd.Series({"inserted": rows.inserted.sum(), **shares, "taken": rows.taken.median()})


def above_limit(rows: pd.DataFrame) -> int:
    """Returns in how many trials the measured load is above the limit of the force guard, 40 N."""
    return int((rows.peak_measured_load_n > 40).sum())


def both(rows: pd.DataFrame, other: pd.DataFrame) -> tuple[int, int, int]:
    """Returns the number of pairs of trials, and how many are inserted in the first and in the second one only."""
    names = ["trial_set", "demonstration_set", "trial"]
    pairs = rows[[*names, "inserted"]].merge(other[[*names, "inserted"]], on=names)
    first, second = pairs["inserted_x"], pairs["inserted_y"]
    return len(pairs), int((first & ~second).sum()), int((second & ~first).sum())


def word(number: int) -> str:
    """Returns a number up to twelve as a word."""
    return WORDS[number]


def against(name: str, reference: str, policy: str, engine: str = "") -> pd.DataFrame:
    """Returns a policy in ``haptic-skill scoreboard docs/NAME --against REFERENCE``, a row for each table."""
    rows = _compared(name, reference)
    return rows[(rows.policy == policy) & rows.engine.str.contains(engine)]


@cache
def _compared(name: str, reference: str) -> pd.DataFrame:
    shown = ("better", "worse", "p", "slower", "p_time", "gains", "delays")
    rows = [
        {"policy": row.summary.policy, "trial_set": table.cell.trial_set, "engine": table.cell.engine}
        | dict(zip(("factor", "value"), next(iter(table.cell.values.items()), ("", None)), strict=True))
        | {column: getattr(row.paired, column) for column in shown}
        for table in make_scoreboard(_trials(name), reference).tables
        for row in table.rows
        if row.paired
    ]
    return pd.DataFrame(rows).astype({"trial_set": USUAL_FIRST})


@cache
def _trials(name: str) -> Trials:
    return read_trials(ROOT / "docs" / name)
