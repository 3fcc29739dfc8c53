"""Report of a practice: tables for the terminal, the JSON record, and the table of check costs for the figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from rich.table import Table

from interfaces.reports.result_tables import plain_table

if TYPE_CHECKING:
    from experiments.practice_results import Round
    from experiments.scoreboard.paired_statistics import PairedChange
    from experiments.trial.trial_result import TrialResult

MEASURES = {
    "time_s": ("time", "time (s)"),
    "peak_lateral_n": ("peak_lateral_force", "peak lateral force (N)"),
    "peak_axial_n": ("peak_axial_force", "peak axial force (N)"),
}
"""Measures that are compared: key in the JSON file -> (attribute of a result, title)."""

WORTHWHILE = 0.20
"""A change of a median of at least this fraction is named in the caption if its interval excludes zero."""


def round_table(rounds: Sequence[Round]) -> Table:
    """One row per round: its practice trials, and the result of its check. Round 0 is the check of the first skill."""
    columns = ("round", "practised", "inserted", "check cost (s)", "inserted", "")
    table = plain_table("practice", numbers=columns)
    for number, r in enumerate(rounds):
        table.add_row(
            str(number),
            *([str(len(r.practised)), str(sum(p.inserted for p in r.practised))] if number else ["", ""]),
            f"{np.mean(r.check.costs):.2f}",
            f"{sum(c.inserted for c in r.check.results)} of {len(r.check.results)}",
            "first skill" if not number else "[green]kept[/]" if r.kept else "[red]discarded[/]",
        )
    table.caption = "check cost: mean over the check trials of the time plus a penalty for lateral force, s"
    return table


def change_table(
    changes: Mapping[str, PairedChange], before: Sequence[TrialResult], after: Sequence[TrialResult]
) -> Table:
    """Medians of the same trials before and after practice, over all trials, inserted or not.

    Args:
        changes: change of each of the `MEASURES`.
        before: results with the first skill.
        after: results with the practised skill, on the same trials.
    """
    columns = ("before", "after", "change", "95 % interval", "p (Wilcoxon)")
    table = plain_table(f"{len(before)} held-out trials, median", text="", numbers=columns)
    fell, rose = [], []
    for name, change in changes.items():
        title = MEASURES[name][1]
        table.add_row(
            title,
            *(f"{change.before:.2f}", f"{change.after:.2f}", f"{100 * change.change:+.0f} %"),
            f"{100 * change.lower:+.0f} to {100 * change.upper:+.0f} %",
            f"{change.p_value:.2g}",
        )
        if change.change <= -WORTHWHILE and change.upper < 0:
            fell.append(title.split(" (")[0])
        if change.change >= WORTHWHILE and change.lower > 0:
            rose.append(title.split(" (")[0])
    table.add_row("inserted", str(sum(r.inserted for r in before)), str(sum(r.inserted for r in after)), "", "", "")
    share = f"{100 * WORTHWHILE:.0f} %"
    table.caption = f"fell by at least {share}: {', '.join(fell) or 'nothing'}" + (
        f"; rose by at least {share}: {', '.join(rose)}" if rose else ""
    )
    return table


def check_costs(rounds: Sequence[Round]) -> pd.DataFrame:
    """One row per check trial, with the columns "round", "kept" and "cost" (s)."""
    return pd.DataFrame(
        [{"round": k, "kept": r.kept, "cost": cost} for k, r in enumerate(rounds) for cost in r.check.costs]
    )


def practice_record(
    rounds: Sequence[Round],
    before: Sequence[TrialResult],
    after: Sequence[TrialResult],
    changes: Mapping[str, PairedChange],
) -> dict[str, Any]:
    """Every trial of a practice and of the comparison on held-out trials, as JSON values."""
    return {
        "rounds": [
            {
                "kept": r.kept,
                "practised": [p.record() for p in r.practised],
                "checks": [
                    {"cost_s": round(c, 3), **p.record()} for p, c in zip(r.check.results, r.check.costs, strict=True)
                ],
            }
            for r in rounds
        ],
        "held_out": {
            "changes": {name: asdict(change) for name, change in changes.items()},
            "trials": [
                {"seed": b.seed, "before": b.record(), "after": a.record()} for b, a in zip(before, after, strict=True)
            ],
        },
    }
