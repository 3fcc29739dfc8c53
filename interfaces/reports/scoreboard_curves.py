"""Curves over a factor of a sweep: one line per policy, which also differ in black and white."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from experiments.scoreboard.columns import LOAD_LIMITS
from experiments.scoreboard.summary import Conditions, Scoreboard, Summary, Table, factor_name, numeric_factors

MAX_TABLES = 12
"""Largest number of tables of which each has a curve over the limits of the load."""

MIN_VALUES = 3
"""Smallest number of values of a factor that makes a curve."""

LOGARITHMIC = 25.0
"""Ratio of the largest to the smallest value from which the axis of a factor is logarithmic."""

FIGURE_SIZE = (11.7, 3.3)  # in units of inches
LEAST_GAP = 0.09  # between the labels of two values, over the width of the axis
DODGE = 2.0  # sideways distance of the intervals of neighbouring policies, in units of points
INK, FAINT, LINE = "#1d2329", "#56616b", "#d3dae0"
COLOURS = ("#0072b2", "#c04a00", "#00795a", "#9b3a78", "#7a5c00", "#3a3f44")
DASHES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "P", "p")


@dataclass(frozen=True)
class Quantity:
    """A panel of a curve.

    Attributes:
        title: with the unit.
        value: what is drawn; NaN leaves a gap.
        has_interval: whether the interval of the share is drawn.
    """

    title: str
    value: Callable[[Summary], float]
    has_interval: bool = False


QUANTITIES = (
    Quantity("inserted (%), bars: 95 % interval", lambda s: 100 * s.share, has_interval=True),
    Quantity("median time of the insertions (s)", lambda s: s.numbers["time"]),
    Quantity("median peak load (N)", lambda s: s.numbers["load"]),
)


@dataclass(frozen=True)
class Curve:
    """What changes with one factor while all else stays the same.

    Attributes:
        factor: its name.
        title: the conditions that stay the same.
        values: of the factor, increasing.
        summaries: of each policy, one for each value; None where there is none.
        quantities: that are drawn.
    """

    factor: str
    title: str
    values: list[float]
    summaries: dict[str, list[Summary | None]]
    quantities: tuple[Quantity, ...] = QUANTITIES


def styles_of(policies: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Returns how the line of each policy is drawn, for Matplotlib; the first 28 differ without colour."""
    return {
        policy: {
            "color": COLOURS[k % len(COLOURS)],
            "linestyle": DASHES[k % len(DASHES)],
            "marker": MARKERS[k % len(MARKERS)],
        }
        for k, policy in enumerate(policies)
    }


def curves_of(board: Scoreboard) -> list[Curve]:
    """Returns the curves over every numeric factor with `MIN_VALUES` values or more."""
    found = []
    for factor in numeric_factors(board.tables):
        groups: dict[tuple[str, str, str], list[Table]] = {}
        for table in board.tables:
            others = {name: value for name, value in table.conditions.values.items() if name != factor}
            if factor in table.conditions.values:
                key = (table.conditions.trial_set, table.conditions.engine, json.dumps(others, sort_keys=True))
                groups.setdefault(key, []).append(table)
        for key, tables in groups.items():
            if len(tables) < MIN_VALUES:
                continue
            tables.sort(key=lambda table: float(table.conditions.values[factor]))
            rows = [{row.summary.policy: row.summary for row in table.rows} for table in tables]
            policies = sorted({policy for row in rows for policy in row})
            values = [float(table.conditions.values[factor]) for table in tables]
            summaries = {policy: [row.get(policy) for row in rows] for policy in policies}
            found.append(Curve(factor, Conditions(*key).title, values, summaries))
    return found


def limit_curves(board: Scoreboard) -> list[Curve]:
    """Returns the curve of each table over the limits of the load; none for more than `MAX_TABLES`."""
    tables = board.tables if len(board.tables) <= MAX_TABLES else []
    return [
        Curve(
            factor="limit of the load (N)",
            title=f"{table.conditions.title}: an insertion counts if the load stayed below the limit",
            values=[float(limit) for limit in LOAD_LIMITS],
            summaries={row.summary.policy: [row.summary.within(limit) for limit in LOAD_LIMITS] for row in table.rows},
            quantities=(Quantity("inserted (%)", lambda s: 100 * s.share),),
        )
        for table in tables
    ]


def curve_figure(curve: Curve, styles: dict[str, dict[str, Any]]) -> Figure:
    """Returns one figure with all panels side by side, a heading and a key."""
    figure = Figure(figsize=FIGURE_SIZE, layout="constrained")
    panels = figure.subplots(1, len(curve.quantities), squeeze=False)[0]
    for axes, quantity in zip(panels, curve.quantities, strict=True):
        _draw(axes, curve, quantity, styles)
    figure.suptitle(f"{factor_name(curve.factor)}; {curve.title}", color=INK, fontsize=11, parse_math=False)
    lines, labels = panels[-1].get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _draw(axes: Axes, curve: Curve, quantity: Quantity, styles: dict[str, dict[str, Any]]) -> None:
    """Draws one quantity over the factor."""
    for number, (policy, summaries) in enumerate(curve.summaries.items()):
        shift = DODGE * (number - 0.5 * (len(curve.summaries) - 1)) if quantity.has_interval else 0.0
        place = axes.transData + ScaledTranslation(shift / 72.0, 0.0, axes.figure.dpi_scale_trans)
        values = np.array([math.nan if s is None else quantity.value(s) for s in summaries])
        axes.plot(
            curve.values,
            values,
            **styles[policy],
            markerfacecolor="white",
            markersize=5,
            linewidth=1.4,
            label=policy,
            transform=place,
        )
        axes.update_datalim(np.column_stack([curve.values, np.nan_to_num(values)]))
        if quantity.has_interval:
            low, high = (
                [math.nan if s is None or s.interval is None else 100 * s.interval[end] for s in summaries]
                for end in (0, 1)
            )
            axes.vlines(curve.values, low, high, color=styles[policy]["color"], linewidth=1.0, transform=place)
    axes.autoscale_view()
    axes.set_title(quantity.title, loc="left", fontsize=9, color=INK)
    axes.set_xlabel(factor_name(curve.factor), fontsize=9, color=FAINT, parse_math=False)
    _set_scale(axes, curve.values)
    axes.set_ylim(0.0, 105.0 if quantity.has_interval else None)
    axes.tick_params(colors=FAINT, labelsize=8)
    axes.grid(axis="y", color=LINE)
    axes.spines[:].set_visible(False)


def _set_scale(axes: Axes, values: Sequence[float]) -> None:
    """Chooses the scale of the factor, and labels its values as far as there is room for them."""
    if values[0] > 0.0 and values[-1] >= LOGARITHMIC * values[0]:
        axes.set_xscale("log")
    places = axes.transScale.transform([(value, 1.0) for value in values])[:, 0]
    shares = (places - places[0]) / (places[-1] - places[0])
    labelled = [0]
    for k in range(1, len(values)):
        if shares[k] - shares[labelled[-1]] >= LEAST_GAP:
            labelled.append(k)
    axes.set_xticks([values[k] for k in labelled], [f"{values[k]:g}" for k in labelled])
    axes.minorticks_off()
