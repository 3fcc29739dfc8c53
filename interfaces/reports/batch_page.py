"""One self-contained HTML page about a batch of rig trials: summary, histograms, a table of trials, the scenario.

The layout is in batch.html and batch.css; batch.js sorts the table.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.scoreboard.paired_statistics import wilson
from experiments.trial_result import PHYSICS, TrialResult
from interfaces.reports.histogram import histogram
from interfaces.reports.page_template import definitions, fill_page, svg_element, tiles
from skill.states.state_style import state_colours

HISTOGRAMS = (  # title, unit, field of TrialResult
    ("time", "s", "time"),
    ("peak load", "N", "peak_load"),
    ("peak force of a single contact", "N", "peak_contact_force"),
    ("microsteps of both motors", "", "steps"),
)


@dataclass(frozen=True)
class Column:
    """A column of the table of trials.

    Attributes:
        name: heading.
        unit: printed below the heading.
        key: value by which the table is sorted.
        form: format string for the key; not used in the columns that `_row` draws itself.
        style: classes of its cells: "text" is aligned to the left, "wide" hidden on a narrow screen, "detail" shown
            only with all columns.
        tip: text that the page shows over the heading.
    """

    name: str
    unit: str
    key: Callable[[TrialResult], float | str]
    form: str = "{}"
    style: str = ""
    tip: str = ""


LOAD = "largest sqrt(|f|^2 + |m/r|^2) of the net force f and moment m about the tip; r is the peg radius"
CONTACT = "largest normal force of any single contact: mouth, tip or flat face"
FIRST_TOUCH = "integral of the net force over the first 50 ms of contact"
ACROSS = "largest net force across the peg; the two opposite forces of a wedge cancel in it"
TRUST = "trusted: the simulated bodies overlap by at most a quarter of the clearance"

COLUMNS = (
    Column("trial", "", lambda r: r.seed),
    Column("tilt", "deg", lambda r: float(np.linalg.norm(np.degrees(r.tilt))), style="wide"),
    Column("outcome", "", lambda r: r.reason, style="text outcome"),
    Column("time", "s", lambda r: r.time, "{:.2f}"),
    Column("depth", "mm", lambda r: 1e3 * r.depth, "{:.1f}", style="wide"),
    Column("peak load", "N", lambda r: r.peak_load, "{:.1f}", tip=LOAD),
    Column("states", "", lambda r: len(r.states), style="text"),
    Column("peak contact", "N", lambda r: r.peak_contact_force, "{:.1f}", style="wide", tip=CONTACT),
    Column("overlap", "um", lambda r: 1e6 * r.penetration, "{:.0f}", style="wide"),
    Column("physics", "", lambda r: PHYSICS[r.trusted], style="text wide", tip=TRUST),
    Column("steps", "", lambda r: r.steps, style="wide"),
    Column("back-offs", "", lambda r: r.back_offs, style="wide"),
    Column("unknown", "s", lambda r: r.unknown_time, "{:.2f}", style="wide"),
    Column("unsupported", "s", lambda r: r.unsupported_time, "{:.2f}", style="wide"),
    Column("above 20 N", "s", lambda r: r.time_above_20n, "{:.2f}", style="detail", tip="time with a load above 20 N"),
    Column("mean load", "N", lambda r: r.mean_load, "{:.1f}", style="detail", tip="while the load is 1 N or more"),
    Column("first touch", "N s", lambda r: r.first_touch, "{:.3f}", style="detail", tip=FIRST_TOUCH),
    Column("along", "N", lambda r: r.peak_axial_force, "{:.1f}", style="detail", tip="largest force along the peg"),
    Column("across", "N", lambda r: r.peak_lateral_force, "{:.1f}", style="detail", tip=ACROSS),
    Column("moment", "N m", lambda r: r.peak_moment, "{:.2f}", style="detail", tip="largest net moment about the tip"),
    Column("lost", "", lambda r: r.lost_steps, style="detail", tip="steps that the motors lost"),
)


def worst_trial(results: Sequence[TrialResult]) -> TrialResult:
    """Returns the shallowest trial that did not insert; if all inserted, the one with the largest load."""
    failed = [r for r in results if not r.inserted]
    return min(failed, key=lambda r: r.depth) if failed else max(results, key=lambda r: r.peak_load)


def batch_report(
    results: Sequence[TrialResult],
    *,
    title: str,
    state_names: Sequence[str],
    replays: Mapping[int, str],
    made_by: Mapping[str, str],
    scenario: str,
) -> str:
    """Returns the page as HTML text. It needs no other file, except the replays that it links.

    Args:
        results: results of the trials, at least one.
        title: heading of the page.
        state_names: names of the contact states.
        replays: addresses of the replays by number of the trial, relative to this page.
        made_by: what determined the results, by name: skill, seeds, versions.
        scenario: as YAML text.
    """
    worst = worst_trial(results)
    colours = state_colours(len(state_names))
    return fill_page(
        "batch",
        title=html.escape(title),
        about=_about(results),
        tiles=tiles(_summary(results)),
        histograms="".join(_histogram_panel(results, *quantity) for quantity in HISTOGRAMS),
        worst=_worst(worst, replays.get(worst.seed)),
        headings="".join(_heading(column) for column in COLUMNS),
        rows="\n".join(_row(r, colours, replays.get(r.seed)) for r in results),
        key="".join(
            f'<span><i style="background: {colour}"></i>{k} {html.escape(name)}</span>'
            for k, (name, colour) in enumerate(zip(state_names, colours, strict=True))
        ),
        made_by=definitions(made_by),
        scenario=html.escape(scenario),
    )


def _about(results: Sequence[TrialResult]) -> str:
    tilts = np.degrees(np.abs([r.tilt for r in results]))
    return (
        f"trials {results[0].seed} to {results[-1].seed}; starting tilts up to {tilts.max():.1f} degrees about each"
        " axis; times and forces of all trials, inserted or not"
    )


def _summary(results: Sequence[TrialResult]) -> list[tuple[str, str]]:
    """The summary: (value, note) for each tile."""
    n, inserted = len(results), sum(r.inserted for r in results)
    low, high = wilson(inserted, n)
    times = np.array([r.time for r in results])
    loads = np.array([r.peak_load for r in results])
    contact = np.median([r.peak_contact_force for r in results])
    above = sum(r.time_above_20n for r in results) / n
    distrusted = sum(not r.trusted for r in results)
    back_offs, lost_steps = sum(r.back_offs for r in results), sum(r.lost_steps for r in results)
    return [
        (f"{inserted} of {n}", f"inserted; 95 % Wilson interval {100 * low:.1f} to {100 * high:.1f} %"),
        (f"{np.median(times):.2f} s", f"median time; 90th percentile {np.quantile(times, 0.9):.2f} s"),
        (
            f"{np.median(loads):.1f} N",
            f"median peak load; 95th percentile {np.quantile(loads, 0.95):.1f} N, largest {loads.max():.1f} N",
        ),
        (f"{contact:.1f} N", f"median peak force of a single contact; load above 20 N for {above:.2f} s a trial"),
        (str(distrusted), "trials whose physics is not trusted: an overlap above a quarter of the clearance"),
        (
            str(back_offs),
            f"back-offs, in {sum(r.back_offs > 0 for r in results)} of the trials; {lost_steps} steps lost",
        ),
    ]


def _histogram_panel(results: Sequence[TrialResult], title: str, unit: str, field: str) -> str:
    values = np.array([getattr(r, field) for r in results], dtype=float)
    svg = svg_element(histogram(values, np.array([r.inserted for r in results]), unit=unit))
    return f'<div class="panel"><h3>{title}{f" ({unit})" if unit else ""}</h3>{svg}</div>'


def _worst(worst: TrialResult, replay: str | None) -> str:
    why = (
        "all trials inserted; this one has the largest load"
        if worst.inserted
        else "the shallowest trial that did not insert"
    )
    return (
        f"<b>Worst trial: {_link(f'trial {worst.seed}', replay)}</b> &ndash; {why}:"
        f" {html.escape(worst.reason)} after {worst.time:.2f} s at {1e3 * worst.depth:.1f} mm,"
        f" peak load {worst.peak_load:.1f} N,"
        f" peak force of a contact {worst.peak_contact_force:.1f} N"
    )


def _link(text: str, replay: str | None) -> str:
    return text if replay is None else f'<a href="{html.escape(replay)}">{text}</a>'


def _heading(column: Column) -> str:
    tip = f' title="{html.escape(column.tip)}"' if column.tip else ""
    return f'<th class="{column.style}"{tip}>{column.name}<small>{column.unit or "&nbsp;"}</small></th>'


def _row(r: TrialResult, colours: Sequence[str], replay: str | None) -> str:
    """The table row of a trial; ``replay`` is the address of its replay, if there is one."""
    visits = "".join(f'<i style="background: {colours[k]}" title="{k}"></i>' for k in r.states)
    drawn = {
        "trial": _link(str(r.seed), replay),
        "tilt": "{:+.1f} {:+.1f}".format(*np.degrees(r.tilt)),
        "states": f'<span class="visits">{visits}</span>',
    }
    cells = []
    for column in COLUMNS:
        key = column.key(r)
        shown = drawn.get(column.name) or html.escape(column.form.format(key))
        tip = f' title="{shown}"' if column.name == "outcome" else ""  # a long reason is cut
        cells.append(f'<td class="{column.style}" data-key="{html.escape(str(key))}"{tip}>{shown}</td>')
    return f'<tr class="{"" if r.inserted else "failed"}">{"".join(cells)}</tr>'
