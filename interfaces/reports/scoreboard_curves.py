"""Curves over a factor of a sweep: one line per policy, as inline SVG that also reads in black and white."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from experiments.scoreboard.columns import shown
from experiments.scoreboard.summary import Cell, Scoreboard, Summary, Table, numeric_factors
from interfaces.reports.round_step import round_step

MIN_VALUES = 3
"""Smallest number of values of a factor that makes a curve."""

LOGARITHMIC = 25.0
"""Ratio of the largest to the smallest value from which the axis of a factor is logarithmic."""

WIDTH, HEIGHT = 380, 236  # in units of the drawing
LEFT, RIGHT, TOP, BOTTOM = 40, 14, 30, 40  # margins, in units of the drawing
CHARACTER, GAP = 6.5, 8.0  # width of a character of a label, least gap between two; in units of the drawing
DODGE = 2.5  # sideways distance of the intervals of neighbouring policies, in units of the drawing
COLOURS = 6  # of the style sheet

DASHES = ("", "7 3", "2 3", "9 3 2 3", "14 4")
MARKERS = (  # outlines around the origin
    "M-3.5,0a3.5,3.5 0 1,0 7,0a3.5,3.5 0 1,0 -7,0Z",
    "M-3.2,-3.2H3.2V3.2H-3.2Z",
    "M0,-4.2L4,3H-4Z",
    "M0,-4.4L4.4,0L0,4.4L-4.4,0Z",
    "M0,4.2L4,-3H-4Z",
    "M-1.4,-4H1.4V-1.4H4V1.4H1.4V4H-1.4V1.4H-4V-1.4H-1.4Z",
    "M0,-4.4L4.2,-1.4L2.6,3.6H-2.6L-4.2,-1.4Z",
)


@dataclass(frozen=True)
class Curve:
    """What changes with one factor while all else stays the same.

    Attributes:
        factor: its name.
        title: the conditions that stay the same.
        values: of the factor, increasing.
        summaries: of each policy, one for each value; None where there is none.
    """

    factor: str
    title: str
    values: list[float]
    summaries: dict[str, list[Summary | None]]


@dataclass(frozen=True)
class Quantity:
    """A panel of a curve.

    Attributes:
        title: with the unit.
        value: what is drawn; NaN leaves a gap.
        interval: drawn as a bar.
        top: end of the axis; None for the largest value.
        digits: of the tooltip.
    """

    title: str
    value: Callable[[Summary], float]
    interval: Callable[[Summary], tuple[float, float]] | None
    top: float | None
    digits: int


QUANTITIES = (
    Quantity(
        "inserted (%), bars: 95 % Wilson interval",
        lambda s: 100 * s.share,
        lambda s: (100 * s.interval[0], 100 * s.interval[1]),
        100.0,
        0,
    ),
    Quantity("median time of the insertions (s)", lambda s: s.time, None, None, 2),
    Quantity("median peak load (N)", lambda s: s.load, None, None, 1),
)


def curves_of(board: Scoreboard) -> list[Curve]:
    """Returns the curves over every numeric factor with `MIN_VALUES` values or more."""
    found = []
    for factor in numeric_factors(board.tables):
        groups: dict[tuple[str, str, str], list[Table]] = {}
        for table in board.tables:
            others = {name: value for name, value in table.cell.values.items() if name != factor}
            if factor in table.cell.values:
                key = (table.cell.arm, table.cell.engine, json.dumps(others, sort_keys=True))
                groups.setdefault(key, []).append(table)
        for key, tables in groups.items():
            if len(tables) >= MIN_VALUES:
                found.append(_curve(factor, Cell(*key).title, tables))
    return found


def _curve(factor: str, title: str, tables: Sequence[Table]) -> Curve:
    ordered = sorted(tables, key=lambda table: float(table.cell.values[factor]))
    rows = [{row.summary.policy: row.summary for row in table.rows} for table in ordered]
    policies = sorted({policy for found in rows for policy in found})
    return Curve(
        factor,
        title,
        [float(table.cell.values[factor]) for table in ordered],
        {policy: [found.get(policy) for found in rows] for policy in policies},
    )


def draw_curve(curve: Curve, styles: dict[str, int]) -> str:
    """Returns the panels of a curve and their key as HTML.

    Args:
        curve: what to draw.
        styles: number of the style of each policy; the same on the whole page.
    """
    panels = "".join(f'<div class="panel">{_panel(curve, quantity, styles)}</div>' for quantity in QUANTITIES)
    key = "".join(f"<span>{_sample(styles[policy])} {html.escape(policy)}</span>" for policy in curve.summaries)
    return f'<div class="curve"><div class="panels">{panels}</div><p class="key">{key}</p></div>'


def _panel(curve: Curve, quantity: Quantity, styles: dict[str, int]) -> str:
    """One quantity over the factor."""
    points = {policy: _points(curve, quantity, policy) for policy in curve.summaries}
    largest = max([1e-9, *(quantity.value(s) for found in points.values() for _, s in found)])
    step = round_step(quantity.top or largest, 5)
    top = quantity.top or step * math.ceil(largest / step - 1e-9)
    x = _axis(curve.values)

    def y(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - value / top)

    lines = [
        f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(k * step):.1f}" y2="{y(k * step):.1f}"/>'
        f'<text x="{LEFT - 6}" y="{y(k * step) + 4:.1f}" text-anchor="end">{k * step:g}</text>'
        for k in range(round(top / step) + 1)
    ]
    for number, (policy, found) in enumerate(points.items()):
        shift = DODGE * (number - 0.5 * (len(points) - 1)) if quantity.interval else 0.0
        places = [x(value) + shift for value, _ in found]
        style = styles[policy]
        joined = [k > 0 and _are_neighbours(curve, found[k - 1][0], value) for k, (value, _) in enumerate(found)]
        path = "".join(
            f"{'L' if join else 'M'}{px:.1f},{y(quantity.value(s)):.1f}"
            for join, px, (_, s) in zip(joined, places, found, strict=True)
        )
        dashes = DASHES[style % len(DASHES)]
        line = f'<path class="line" d="{path}" stroke-dasharray="{dashes}"/>' if found else ""
        marks = [_mark(curve.factor, quantity, px, *point, y, style) for px, point in zip(places, found, strict=True)]
        lines.append(f'<g class="series-{style % COLOURS}">{line}{"".join(marks)}</g>')
    label = f"{quantity.title} over {curve.factor}; {curve.title}"
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{html.escape(label)}">'
        f'<text class="title" x="2" y="14">{html.escape(quantity.title)}</text>{"".join(lines)}'
        f"{_ticks(curve.values, x, y(0.0))}"
        f'<text x="{0.5 * (LEFT + WIDTH - RIGHT)}" y="{HEIGHT - 6}" text-anchor="middle">'
        f"{html.escape(curve.factor)}</text></svg>"
    )


def _points(curve: Curve, quantity: Quantity, policy: str) -> list[tuple[float, Summary]]:
    """The values of the factor at which a policy has the quantity, with its summaries."""
    pairs = zip(curve.values, curve.summaries[policy], strict=True)
    return [(value, s) for value, s in pairs if s is not None and not math.isnan(quantity.value(s))]


def _are_neighbours(curve: Curve, first: float, second: float) -> bool:
    """Whether no value of the factor lies between two."""
    return curve.values.index(second) - curve.values.index(first) == 1


def _mark(
    factor: str,
    quantity: Quantity,
    px: float,
    value: float,
    summary: Summary,
    y: Callable[[float], float],
    style: int,
) -> str:
    """The marker of a point, with its interval and a tooltip."""
    bar = ""
    if quantity.interval is not None:
        low, high = quantity.interval(summary)
        bar = f'<line x1="{px:.1f}" x2="{px:.1f}" y1="{y(low):.1f}" y2="{y(high):.1f}"/>'
    number = quantity.value(summary)
    told = f"{summary.policy}, {factor} {value:g}: {shown(number, quantity.digits)} ({summary.trials} trials)"
    place = f"translate({px:.1f},{y(number):.1f})"
    outline = MARKERS[style % len(MARKERS)]
    return f'{bar}<path class="marker" d="{outline}" transform="{place}"><title>{html.escape(told)}</title></path>'


def _sample(style: int) -> str:
    """The line and the marker of a policy, for the key."""
    return (
        f'<svg class="sample series-{style % COLOURS}" viewBox="-22 -7 44 14" aria-hidden="true">'
        f'<path class="line" d="M-22,0H22" stroke-dasharray="{DASHES[style % len(DASHES)]}"/>'
        f'<path class="marker" d="{MARKERS[style % len(MARKERS)]}"/></svg>'
    )


def _axis(values: Sequence[float]) -> Callable[[float], float]:
    """The place of a value of the factor; logarithmic for positive values that differ much."""
    logarithmic = values[0] > 0.0 and values[-1] >= LOGARITHMIC * values[0]
    scale: Callable[[float], float] = math.log if logarithmic else float
    low, high = scale(values[0]), scale(values[-1])
    inner = WIDTH - LEFT - RIGHT - 24  # points keep off the ends
    return lambda value: LEFT + 12 + inner * (scale(value) - low) / (high - low)


def _ticks(values: Sequence[float], x: Callable[[float], float], bottom: float) -> str:
    """The values of the factor below the axis, as far as there is room for them."""
    parts, end = [], -math.inf
    for value in values:
        px = x(value)
        parts.append(f'<line class="axis" x1="{px:.1f}" x2="{px:.1f}" y1="{bottom:.1f}" y2="{bottom + 4:.1f}"/>')
        label = f"{value:g}"
        half = 0.5 * CHARACTER * len(label)
        if px - half >= end + GAP:
            parts.append(f'<text x="{px:.1f}" y="{bottom + 16:.1f}" text-anchor="middle">{label}</text>')
            end = px + half
    return "".join(parts)
