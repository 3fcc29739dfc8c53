"""Figures of the comparisons on the rig: shares of insertions with Wilson intervals, times and forces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from skill.figures.paper_figures import save_figure
from skill.states.state_style import PALETTE

BLUE, ORANGE, GREY = PALETTE[0], PALETTE[1], "0.55"
PANELS = ("inserted, 95 % interval", "time [s], median", "peak load [N]")

Row = dict[str, Any]
"""A result of `benchmarks.rig.comparison.summary`."""


def draw_groups(groups: Sequence[tuple[str, Sequence[tuple[str, Row]]]], path: Path) -> None:
    """Draws one row per policy, in groups.

    Args:
        groups: for each group its title, and for each policy its label and its summary.
        path: of the file.
    """
    count = sum(len(rows) for _, rows in groups)
    figure = Figure(figsize=(8.6, 0.9 + 0.27 * (count + 1.4 * len(groups))), layout="constrained")
    axes: Sequence[Axes] = figure.subplots(1, 3, sharey=True, width_ratios=[1.2, 1, 1])
    ticks, names, place = [], [], 0.0
    for title, rows in groups:
        axes[0].text(0.0, place, title, weight="bold", va="center", transform=axes[0].get_yaxis_transform())
        for label, row in rows:
            place += 1.0
            ticks.append(place)
            names.append(label)
            _draw_row(axes, row, place)
        place += 1.4
    axes[0].set_yticks(ticks, names)
    axes[0].set_ylim(place - 0.7, -0.7)
    axes[0].set_xlim(-0.02, 1.02)
    for axis, name in zip(axes, PANELS, strict=True):
        axis.set_xlabel(name)
        axis.grid(axis="x", alpha=0.3)
        axis.tick_params(axis="y", length=0)
        axis.spines[["top", "right", "left"]].set_visible(False)
    for axis in axes[1:]:
        axis.set_xlim(0.0, 1.06 * axis.dataLim.x1 if np.isfinite(axis.dataLim.x1) else 1.0)
    axes[2].set_xlabel(f"{PANELS[2]}\nmedian and 95th percentile")
    save_figure(figure, path)


def _draw_row(axes: Sequence[Axes], row: Row, place: float) -> None:
    if row["trials"]:
        share, (low, high) = row["inserted"] / row["trials"], row["interval"]
        axes[0].plot([low, high], [place, place], color=GREY, lw=2)
        axes[0].plot(share, place, "o", color=BLUE, ms=6)
    if row["median_time_s"] is not None:
        axes[1].plot(row["median_time_s"], place, "o", color=BLUE, ms=6)
    if row["median_load_n"] is not None:
        axes[2].plot([row["median_load_n"], row["p95_load_n"]], [place, place], color=GREY, lw=2)
        axes[2].plot(row["median_load_n"], place, "o", color=BLUE, ms=6)
        axes[2].plot(row["p95_load_n"], place, "|", color=ORANGE, ms=9, mew=2)
