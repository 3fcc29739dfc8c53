"""A small histogram as inline SVG."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from interfaces.reports.round_step import round_step
from skill.arrays import Array

WIDTH, HEIGHT = 260, 132  # in units of the drawing
LEFT, RIGHT, TOP, BOTTOM = 26, 8, 14, 22  # margins, in units of the drawing
GOOD, BAD, INK, FAINT = "#0072b2", "#c1121f", "#1d2329", "#56616b"
MAX_BINS = 24
MAX_TICKS = 6


def bin_edges(values: Array) -> Array:
    """Returns round bin edges from 0 to above the largest value.

    Args:
        values: (n,), non-negative; the number of bins grows with the square root of n.
    """
    top = float(values.max())
    step = round_step(top, int(np.clip(2 * np.sqrt(len(values)), 8, MAX_BINS)))
    return step * np.arange(np.floor(top / step) + 2)


def histogram(values: Array, good: NDArray[np.bool_], *, unit: str) -> str:
    """Draws the counts per bin and a line at the median; values that are not good are stacked in another colour.

    Args:
        values: (n,), non-negative.
        good: (n,).
        unit: printed after the median.

    Returns:
        An SVG element.
    """
    edges = bin_edges(values)
    counts = [np.histogram(values[mask], edges)[0] for mask in (good, ~good)]
    maximum = int(np.sum(counts, axis=0).max())

    def x(value: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * value / float(edges[-1])

    def y(count: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - count / maximum)

    bars, base = [], np.zeros(len(edges) - 1)
    for count, colour in zip(counts, (GOOD, BAD), strict=True):
        for k in np.flatnonzero(count):
            low, high = base[k], base[k] + count[k]
            bars.append(
                f'<rect x="{x(edges[k]) + 0.5:.1f}" y="{y(high):.1f}" width="{x(edges[k + 1]) - x(edges[k]) - 1:.1f}"'
                f' height="{y(low) - y(high):.1f}" fill="{colour}"/>'
            )
        base = base + count
    median = float(np.median(values))
    label_on_left = x(median) > 0.7 * WIDTH  # keeps the label inside the drawing
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" overflow="visible" font-size="10" font-family="inherit">'
        f"{''.join(bars)}"
        f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(0):.1f}" y2="{y(0):.1f}" stroke="{FAINT}"/>'
        f"{_tick_labels([(x(v), v) for v in _tick_values(edges[-1])], y(0) + 13)}"
        f'<text x="{LEFT - 5}" y="{y(maximum) + 8:.1f}" text-anchor="end" fill="{FAINT}">{maximum}</text>'
        f'<text x="{LEFT - 5}" y="{y(0):.1f}" text-anchor="end" fill="{FAINT}">0</text>'
        f'<line x1="{x(median):.1f}" x2="{x(median):.1f}" y1="{TOP - 4}" y2="{y(0):.1f}" stroke="{INK}"'
        ' stroke-width="1.5"/>'
        f'<text x="{x(median) + (-4 if label_on_left else 4):.1f}" y="{TOP - 4}"'
        f' text-anchor="{"end" if label_on_left else "start"}"'
        f' fill="{INK}">{f"{median:.3g} {unit}".strip()}</text>'
        "</svg>"
    )


def _tick_values(top: float) -> Array:
    step = round_step(top, MAX_TICKS)
    return step * np.arange(np.floor(top / step * (1 + 1e-9)) + 1)


def _tick_labels(ticks: Sequence[tuple[float, float]], y: float) -> str:
    return "".join(
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle" fill="{FAINT}">{value:g}</text>' for x, value in ticks
    )
