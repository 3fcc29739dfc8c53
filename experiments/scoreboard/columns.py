"""The columns of a scoreboard: what they show, and the expressions that recompute them from the stored trials."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from experiments.scoreboard.summary import Row, Summary


@dataclass(frozen=True)
class Column:
    """A column of a table of policies.

    Attributes:
        name: heading.
        unit: printed below the heading.
        tip: what the number is.
        key: the number; NaN for nothing.
        text: how it is shown.
        note: small text below it; empty for none.
        sql: expression of DuckDB over the trials of a row; empty if the number is no plain aggregate.
        pandas: the same for a DataFrame ``d`` of the trials.
        low_is_good: order of the first click on the heading.
    """

    name: str
    unit: str
    tip: str
    key: Callable[[Row], float]
    text: Callable[[Row], str]
    sql: str = ""
    pandas: str = ""
    note: Callable[[Row], str] = lambda _: ""
    low_is_good: bool = True


def shown(value: float, digits: int) -> str:
    """A number with a fixed number of digits; "–" for NaN."""
    return "–" if math.isnan(value) else f"{0.0 if abs(value) < 0.5 * 10**-digits else value:.{digits}f}"


def share(interval: tuple[float, float]) -> str:
    """An interval of a share as text."""
    return f"{100 * interval[0]:.0f}–{100 * interval[1]:.0f} %"


def p_text(p: float) -> str:
    """A p-value as text."""
    return "p < 0.001" if p < 0.001 else f"p {p:.3f}" if p < 0.1 else f"p {p:.2f}"


def _number(
    name: str, unit: str, tip: str, value: Callable[[Summary], float], digits: int, sql: str, pandas: str
) -> Column:
    """A column with a plain number of the summary."""
    return Column(
        name, unit, tip, lambda r: value(r.summary), lambda r: shown(value(r.summary), digits), sql=sql, pandas=pandas
    )


def _against(row: Row) -> str:
    pair = row.paired
    return "–" if pair is None else f"+{pair.better} −{pair.worse}"


COLUMNS = (
    Column(
        "inserted",
        "95 %",
        "trials that inserted, of all; below: Wilson's 95 % interval of the share",
        lambda r: r.summary.share,
        lambda r: f"{r.summary.inserted} of {r.summary.trials}",
        sql="count(*) FILTER (inserted)",
        pandas="d.inserted.sum()",
        note=lambda r: share(r.summary.interval),
        low_is_good=False,
    ),
    Column(
        "over sets",
        "95 %",
        "sets of demonstrations; below: 95 % interval of the share by a bootstrap over the sets",
        lambda r: float(r.summary.sets),
        lambda r: str(r.summary.sets) if r.summary.sets else "–",
        sql="count(DISTINCT demonstration_set)",
        pandas="d.demonstration_set.nunique()",
        note=lambda r: "" if r.summary.over_sets is None else share(r.summary.over_sets),
        low_is_good=False,
    ),
    Column(
        "against",
        "+ / − pairs",
        "paired with the reference: + only this policy inserted, − only the reference did; below: exact McNemar test,"
        " Holm-corrected over the rows of the table",
        lambda r: math.nan if r.paired is None else float(r.paired.better - r.paired.worse),
        _against,
        note=lambda r: "" if r.paired is None else p_text(r.paired.p),
        low_is_good=False,
    ),
    _number(
        "time",
        "s",
        "median duration of the insertions",
        lambda s: s.time,
        2,
        "median(time_s) FILTER (inserted)",
        "d.time_s[d.inserted].median()",
    ),
    Column(
        "slower by",
        "s",
        "mean paired difference in time from the reference, where a failure counts as the whole time limit; below:"
        " sign-flip test, Holm-corrected over the rows of the table",
        lambda r: math.nan if r.paired is None else r.paired.slower,
        lambda r: "–" if r.paired is None else f"{r.paired.slower:+.2f}".replace("-", "−"),
        note=lambda r: "" if r.paired is None else p_text(r.paired.p_time),
    ),
    _number(
        "score",
        "of 100",
        "mean score by the rule of the public AI for Industry Challenge: insertion, duration, smoothness, way, force",
        lambda s: s.score,
        1,
        "avg(field_score)",
        "d.field_score.mean()",
    ),
    _number(
        "contact",
        "N",
        "median of the largest force of a single contact",
        lambda s: s.contact,
        1,
        "median(peak_contact_n)",
        "d.peak_contact_n.median()",
    ),
    _number(
        "load",
        "N",
        "median of the largest load √(|f|² + |m/r|²) of the net force f and moment m about the tip",
        lambda s: s.load,
        1,
        "median(peak_load_n)",
        "d.peak_load_n.median()",
    ),
    _number(
        "mean load",
        "N",
        "median of the mean load over the time in contact",
        lambda s: s.mean_load,
        1,
        "median(mean_load_n)",
        "d.mean_load_n.median()",
    ),
    _number(
        "above 20 N",
        "s a trial",
        "mean time with a load above 20 N",
        lambda s: s.above_20n,
        2,
        "avg(seconds_above_20n)",
        "d.seconds_above_20n.mean()",
    ),
    _number(
        "jams",
        "trials",
        "trials that ended jammed",
        lambda s: s.jams,
        0,
        "count(*) FILTER (outcome = 'jammed')",
        "(d.outcome == 'jammed').sum()",
    ),
    _number(
        "wedges",
        "trials",
        "trials in which friction alone could hold the peg between two contacts for 0.1 s or longer",
        lambda s: s.wedges,
        0,
        "count(*) FILTER (wedged_s > 0)",
        "(d.wedged_s > 0).sum()",
    ),
    Column(
        "faults",
        "trials",
        "trials that ended with a fault that the rig detected",
        lambda r: float(sum(r.summary.faults.values())),
        lambda r: str(sum(r.summary.faults.values())),
        sql="count(*) FILTER (fault <> '')",
        pandas="(d.fault != '').sum()",
        note=lambda r: ", ".join(f"{count} {name.split(':')[0]}" for name, count in r.summary.faults.items()),
    ),
    _number(
        "lost steps",
        "in all",
        "microsteps that the steppers lost, in all trials",
        lambda s: s.lost_steps,
        0,
        "sum(lost_steps)",
        "d.lost_steps.sum()",
    ),
    _number(
        "back-offs",
        "in all",
        "how often the controller backed the peg off",
        lambda s: s.back_offs,
        0,
        "sum(back_offs)",
        "d.back_offs.sum()",
    ),
    Column(
        "physics",
        "trials",
        "trials whose bodies overlap by more than a quarter of the clearance: their forces say little about metal",
        lambda r: float(r.summary.untrusted),
        lambda r: f"{r.summary.untrusted} of {r.summary.trials}" if r.summary.untrusted else "0",
        sql="count(*) FILTER (NOT trusted)",
        pandas="(d.trusted == False).sum()",
        note=lambda r: "not trusted" if r.summary.untrusted else "",
    ),
    _number(
        "shown",
        "demos",
        "mean number of demonstrations that were used",
        lambda s: s.demonstrations,
        0,
        "avg(demonstrations)",
        "d.demonstrations.mean()",
    ),
    _number(
        "training",
        "CPU s",
        "mean CPU time of the training, tuning included",
        lambda s: s.train,
        1,
        "avg(train_s)",
        "d.train_s.mean()",
    ),
    _number("query", "ms", "mean time of a decision", lambda s: s.query, 2, "avg(query_ms)", "d.query_ms.mean()"),
    _number("trial", "CPU s", "mean CPU time of a trial", lambda s: s.cpu, 1, "avg(cpu_s)", "d.cpu_s.mean()"),
)
