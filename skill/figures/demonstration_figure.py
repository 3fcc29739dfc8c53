"""How a set of demonstrations went: outcomes, peak forces and times, by habit and by person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from skill.data.demonstration import Demonstration

GOOD, BAD = "#3b7a57", "#b5483a"
OUTCOMES = {
    **{"inserted": GOOD, "inserted roughly": "#e0a030", "jammed": BAD, "given up": "#6b6ba8"},
    **{"time over": "#8a8a8a", "stopped": "#bdbdbd", "diverged": "#000000"},
}


def summarise(demonstrations: Sequence[Demonstration]) -> pd.DataFrame:
    """One row a demonstration: habit, person, good, outcome, peak_force (N), time (s), starting tilt (rad)."""
    rows = []
    for shown in demonstrations:
        force = np.linalg.norm(shown.samples[["fx", "fy", "fz"]].to_numpy(), axis=1)
        rows.append(
            {
                "habit": shown.metadata.get("habit", "unknown"),
                "person": shown.metadata.get("operator", 0),
                "good": shown.good,
                "outcome": shown.outcome.value,
                "peak_force": float(force.max()),
                "time": shown.duration,
                "tilt": float(shown.samples["angle"].iloc[0]),
            }
        )
    return pd.DataFrame(rows)


def plot_set(demonstrations: Sequence[Demonstration], *, rough_force: float) -> Figure:
    """Outcomes by habit, and the distributions of peak force and time; ``rough_force`` (N) is drawn as a line."""
    table = summarise(demonstrations)
    habits = sorted(table.habit.unique(), key=lambda h: (not table.good[table.habit == h].any(), h))
    figure = Figure(figsize=(11.0, 3.6), layout="constrained")
    outcomes, forces, times = figure.subplots(1, 3, width_ratios=[1.1, 1.0, 1.0])

    counts = table.groupby(["habit", "outcome"]).size().unstack(fill_value=0).reindex(habits)
    left = np.zeros(len(habits))
    for outcome in sorted(counts.columns, key=list(OUTCOMES).index):
        values = counts[outcome].to_numpy(dtype=float)
        outcomes.barh(habits, values, left=left, color=OUTCOMES[outcome], label=outcome)
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
        f"{len(table)} demonstrations by {people} people: green good, red bad, bar the median,"
        f" dashed the force above which an insertion counts as rough",
        fontsize=9,
    )
    return figure
