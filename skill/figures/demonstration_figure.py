"""Figure of a set of demonstrations: outcomes, peak forces and times, by habit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome

GOOD, BAD = "#3b7a57", "#b5483a"
COLOURS = {
    Outcome.INSERTED: GOOD,
    Outcome.INSERTED_ROUGHLY: "#e0a030",
    Outcome.JAMMED: BAD,
    Outcome.GIVEN_UP: "#6b6ba8",
    Outcome.TIME_OVER: "#8a8a8a",
    Outcome.STOPPED: "#bdbdbd",
    Outcome.DIVERGED: "#000000",
    Outcome.FAULT: "#8c2d5e",
    Outcome.FAILED: "#5c4033",
    Outcome.OTHER: "#d9d2c5",
}
"""The colour of each outcome, in the order of the bars."""


def summarise(demonstrations: Sequence[Demonstration]) -> pd.DataFrame:
    """Returns a table with one row for each demonstration.

    Its columns are habit, person, good, outcome (`Outcome`), peak_force (N) and time (s).
    """
    rows = []
    for demonstration in demonstrations:
        force = np.linalg.norm(demonstration.samples[["fx", "fy", "fz"]].to_numpy(), axis=1)
        rows.append(
            {
                "habit": demonstration.metadata.get("habit", "unknown"),
                "person": demonstration.metadata.get("operator", 0),
                "good": demonstration.good,
                "outcome": demonstration.outcome,
                "peak_force": float(force.max()),
                "time": demonstration.duration,
            }
        )
    return pd.DataFrame(rows)


def plot_set(demonstrations: Sequence[Demonstration], *, rough_force: float) -> Figure:
    """Draws the outcomes of each habit, and the distributions of peak force and time.

    Args:
        demonstrations: at least one.
        rough_force: force above which an insertion counts as rough, N; drawn as a line.
    """
    table = summarise(demonstrations)
    habits = sorted(table.habit.unique(), key=lambda h: (not table.good[table.habit == h].any(), h))
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    outcomes, forces, times = figure.subplots(1, 3, width_ratios=[1.1, 1.0, 1.0])

    counts = table.groupby(["habit", "outcome"]).size().unstack(fill_value=0).reindex(habits)
    left = np.zeros(len(habits))
    for outcome, colour in COLOURS.items():
        if outcome in counts.columns:
            values = counts[outcome].to_numpy(dtype=float)
            outcomes.barh(habits, values, left=left, color=colour, label=str(outcome))
            left += values
    outcomes.invert_yaxis()
    outcomes.set_xlabel("demonstrations")
    outcomes.legend(fontsize=7, frameon=False, loc="lower right")

    rng = np.random.default_rng(0)
    for axes, column, label in ((forces, "peak_force", "peak contact force (N)"), (times, "time", "time (s)")):
        for k, habit in enumerate(habits):
            rows = table[table.habit == habit]
            spread = k + rng.uniform(-0.15, 0.15, len(rows))
            axes.scatter(rows[column], spread, s=16, c=[GOOD if g else BAD for g in rows.good])
            axes.plot([rows[column].median()] * 2, [k - 0.3, k + 0.3], color="0.2", lw=1.5)
        axes.set_yticks(range(len(habits)), habits)
        axes.invert_yaxis()
        axes.set_xlabel(label)
        axes.set_xlim(left=0.0)
    forces.axvline(rough_force, color="0.5", ls="--", lw=1.0)
    people = table.person.nunique()
    figure.suptitle(
        f"{len(table)} demonstrations by {people} people. Green: good; red: bad; bar: median;"
        " dashed: force above which an insertion counts as rough",
        fontsize=9,
    )
    return figure
