"""A histogram as inline SVG, small and sharp."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT = 260, 132  # in units of the drawing
LEFT, RIGHT, TOP, BOTTOM = 26, 8, 14, 22
GOOD, BAD, INK, FAINT = "#0072b2", "#c1121f", "#1d2329", "#56616b"
MAX_BINS = 24


def nice_step(span: float, maximum: int) -> float:
    """The least of 1, 2, 5 times a power of ten by which ``most`` steps cover ``span``; nothing is covered as 1 is."""
    wanted = (span or 1.0) / maximum
    decade = 10.0 ** np.floor(np.log10(wanted))
    return float(next(m * decade for m in (1, 2, 5, 10) if m * decade >= wanted * (1 - 1e-9)))


def bin_edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round edges from zero to beyond the largest value, about the square root of their number of bins filled."""
    top = float(values.max())
    step = nice_step(top, int(np.clip(2 * np.sqrt(len(values)), 8, MAX_BINS)))
    return step * np.arange(np.floor(top / step) + 2)


def histogram(values: NDArray[np.float64], good: NDArray[np.bool_], *, unit: str) -> str:
    """Counts of non-negative values, those not good stacked in another colour; a line at the median.

    Args:
        values: (n,).
        good: (n,).
        unit: behind the median's number.
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
    middle = float(np.median(values))
    right = x(middle) > 0.7 * WIDTH
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" font-size="10" font-family="inherit">'
        f"{''.join(bars)}"
        f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(0):.1f}" y2="{y(0):.1f}" stroke="{FAINT}"/>'
        f"{_ticks([(x(v), v) for v in _round_values(edges[-1], 6)], y(0) + 13)}"
        f'<text x="{LEFT - 5}" y="{y(maximum) + 8:.1f}" text-anchor="end" fill="{FAINT}">{maximum}</text>'
        f'<text x="{LEFT - 5}" y="{y(0):.1f}" text-anchor="end" fill="{FAINT}">0</text>'
        f'<line x1="{x(middle):.1f}" x2="{x(middle):.1f}" y1="{TOP - 4}" y2="{y(0):.1f}" stroke="{INK}"'
        ' stroke-width="1.5"/>'
        f'<text x="{x(middle) + (-4 if right else 4):.1f}" y="{TOP - 4}" text-anchor="{"end" if right else "start"}"'
        f' fill="{INK}">{f"{middle:.3g} {unit}".strip()}</text>'
        "</svg>"
    )


def _round_values(top: float, maximum: int) -> NDArray[np.float64]:
    step = nice_step(top, maximum)
    return step * np.arange(np.floor(top / step * (1 + 1e-9)) + 1)


def _ticks(places: Sequence[tuple[float, float]], height: float) -> str:
    return "".join(
        f'<text x="{at:.1f}" y="{height:.1f}" text-anchor="middle" fill="{FAINT}">{value:g}</text>'
        for at, value in places
    )
