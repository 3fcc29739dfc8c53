"""One self-contained HTML page about the rig trials of one policy: their numbers, and what determined them.

The layout is in trials.html; style and script are those of the scoreboard, which compares several policies.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from experiments.scoreboard.paired_statistics import wilson
from experiments.trial.trial_result import TrialResult
from interfaces.reports.page_template import definitions, fill_page

COLUMNS = {  # key of a record -> (heading, unit, digits)
    "time_s": ("time", "s", 2),
    "depth_mm": ("depth", "mm", 1),
    "peak_load_n": ("peak load", "N", 1),
    "peak_contact_n": ("peak contact", "N", 1),
    "steps": ("steps", "", 0),
    "back_offs": ("back-offs", "", 0),
    "penetration_um": ("overlap", "um", 0),
    "unknown_s": ("unknown", "s", 2),
    "unsupported_s": ("unsupported", "s", 2),
    "seconds_above_20n": ("above 20 N", "s", 2),
    "mean_load_n": ("mean load", "N", 1),
    "first_touch_ns": ("first touch", "N s", 3),
    "peak_axial_n": ("along", "N", 1),
    "peak_lateral_n": ("across", "N", 1),
    "peak_moment_nm": ("moment", "N m", 2),
    "lost_steps": ("lost steps", "", 0),
}
MEDIANS = ("time_s", "peak_load_n", "peak_contact_n", "penetration_um")


def trials_page(
    results: Sequence[TrialResult],
    *,
    title: str,
    replays: Mapping[int, str],
    made_by: Mapping[str, str],
    scenario: str,
) -> str:
    """Returns the page as HTML text. It needs no other file, except the replays that it links.

    The trials that did not insert come first, the shallowest before the others; then the insertions by their load.

    Args:
        results: results of the trials, at least one.
        title: heading of the page.
        replays: addresses of the replays by number of the trial, relative to this page.
        made_by: what determined the results, by name: skill, seeds, versions.
        scenario: as YAML text.
    """
    ordered = sorted(results, key=lambda r: (r.inserted, -r.peak_load if r.inserted else r.depth))
    records = pd.DataFrame([r.record() for r in ordered])
    shown = pd.DataFrame(
        {
            _heading("trial"): [_link(str(r.seed), replays.get(r.seed)) for r in ordered],
            _heading("tilt", "deg"): ["{:+.1f} {:+.1f}".format(*np.degrees(r.tilt)) for r in ordered],
            _heading("outcome"): [html.escape(r.reason) for r in ordered],
            **{_heading(name, unit): _texts(records[key], digits) for key, (name, unit, digits) in COLUMNS.items()},
            _heading("physics"): records["physics"],
            _heading("states"): [" ".join(map(str, r.states)) for r in ordered],
        }
    )
    return fill_page(
        "trials",
        assets=("page", "scoreboard"),
        title=html.escape(title),
        about=_about(results, records),
        table=shown.to_html(index=False, escape=False, border=0),
        made_by=definitions(made_by),
        scenario=html.escape(scenario),
    )


def _about(results: Sequence[TrialResult], records: pd.DataFrame) -> str:
    n, inserted = len(results), sum(r.inserted for r in results)
    low, high = wilson(inserted, n)
    typical = []
    for key in MEDIANS:
        name, unit, digits = COLUMNS[key]
        typical.append(f"{name} {records[key].median():.{digits}f} {unit}")
    distrusted = sum(not r.trusted for r in results)
    return (
        f"{inserted} of {n} inserted (95 % Wilson interval {100 * low:.1f} to {100 * high:.1f} %); medians of all"
        f" trials: {', '.join(typical)}; {distrusted} trials whose physics is not trusted, because bodies overlap by"
        " more than a quarter of the clearance"
    )


def _heading(name: str, unit: str = "") -> str:
    return f'<button type="button">{name}<small>{unit or "&nbsp;"}</small></button>'


def _texts(values: pd.Series[float], digits: int) -> list[str]:
    """The numbers of a column; "–" for one that was not measured."""
    return ["–" if np.isnan(value) else f"{value:.{digits}f}" for value in values]


def _link(text: str, replay: str | None) -> str:
    return text if replay is None else f'<a href="{html.escape(replay)}">{text}</a>'
