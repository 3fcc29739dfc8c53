"""Figure of practice: the cost of each round, and held-out trials before and after."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from skill.figures.paper_figures import FIRST, INK, SECOND, new_figure, tidy

QUANTITIES = (("time_s", "time (s)"), ("peak_lateral_n", "peak force across (N)"))
FAINT = "#B8C0C8"


def plot_practice(checks: pd.DataFrame, before: pd.DataFrame, after: pd.DataFrame) -> Figure:
    """Draws the cost of the check trials over the rounds, and the held-out trials before against after practice.

    Args:
        checks: one row for each check trial and round, with the columns round (0 is before practice), cost (s) and kept
            (whether the skill of that round was kept).
        before: one row for each held-out trial, with the columns inserted, time_s and peak_lateral_n.
        after: the same trials after practice, in the same order.
    """
    figure = new_figure(2.9)
    panels = figure.subplots(1, 1 + len(QUANTITIES))
    course = panels[0]
    by_round = checks.groupby("round")["cost"]
    rounds, means = by_round.mean().index.to_numpy(), by_round.mean().to_numpy()
    kept = checks.groupby("round")["kept"].first().to_numpy(dtype=bool)
    course.scatter(checks["round"], checks["cost"], s=10, color=FAINT)
    course.plot(rounds[kept], means[kept], color=FIRST, linewidth=1.3)
    course.scatter(rounds[kept], means[kept], s=34, color=FIRST, zorder=3)
    course.scatter(rounds[~kept], means[~kept], s=38, color=SECOND, marker="X", zorder=3)
    course.set_title("cost of the check trials (s)", loc="left", fontsize=9)
    course.set_xlabel("round of practice", fontsize=9)
    course.set_xticks(rounds)
    course.set_ylim(0.0, None)
    tidy(course)
    inserted = before["inserted"].to_numpy(dtype=bool) & after["inserted"].to_numpy(dtype=bool)
    for axes, (column, label) in zip(panels[1:], QUANTITIES, strict=True):
        x, y = before[column].to_numpy(dtype=float), after[column].to_numpy(dtype=float)
        maximum = 1.08 * max(x.max(), y.max(), 1e-9)
        axes.plot([0.0, maximum], [0.0, maximum], color=INK, linewidth=0.8)
        axes.scatter(x[inserted], y[inserted], s=16, color=FIRST, alpha=0.75)
        axes.scatter(x[~inserted], y[~inserted], s=26, color=SECOND, marker="X")
        axes.plot([np.median(x)], [np.median(y)], marker="+", color=INK, markersize=13, markeredgewidth=1.6)
        axes.set_title(label, loc="left", fontsize=9)
        axes.set_xlabel("before", fontsize=9)
        axes.set_ylabel("after", fontsize=9)
        axes.set_xlim(0.0, maximum)
        axes.set_ylim(0.0, maximum)
        axes.set_aspect("equal")
        tidy(axes)
    marks = [
        Line2D([], [], marker="o", color=FIRST, linestyle="", label="kept; inserted before and after"),
        Line2D([], [], marker="X", color=SECOND, linestyle="", label="discarded; not inserted"),
        Line2D([], [], marker="+", color=INK, linestyle="", markersize=9, label="medians; below the line is better"),
    ]
    figure.legend(handles=marks, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    return figure
