"""A small histogram for a page."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from skill.arrays import Array

SIZE = (2.6, 1.35)  # in units of inches, at the size of the text
GOOD, BAD, INK, FAINT = "#0072b2", "#c1121f", "#1d2329", "#56616b"
MAX_BINS = 24
MAX_TICKS = 6


def bin_edges(values: Array) -> Array:
    """Returns round bin edges from 0 to the largest value or above.

    Args:
        values: (n,), non-negative; the number of bins grows with the square root of n.
    """
    bins = int(np.clip(2 * np.sqrt(len(values)), 8, MAX_BINS))
    return np.asarray(MaxNLocator(bins, steps=[1, 2, 5, 10]).tick_values(0.0, float(values.max()) or 1.0))


def histogram(values: Array, good: NDArray[np.bool_], *, unit: str) -> Figure:
    """Draws the counts per bin and a line at the median; values that are not good are stacked in another colour.

    Args:
        values: (n,), non-negative.
        good: (n,).
        unit: printed after the median.
    """
    edges, median = bin_edges(values), float(np.median(values))
    figure = Figure(figsize=SIZE, layout="constrained")
    axes = figure.subplots()
    counts, _, _ = axes.hist(
        [values[good], values[~good]], edges.tolist(), stacked=True, color=[GOOD, BAD], rwidth=0.96
    )
    maximum = int(np.max(counts))
    axes.axvline(median, color=INK, linewidth=1.2)
    on_left = median > 0.6 * edges[-1]  # keeps the label inside the drawing
    axes.annotate(
        f"{median:.3g} {unit}".strip(),
        (median, 1.0),
        (-4 if on_left else 4, 2),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="right" if on_left else "left",
        fontsize=8,
        color=INK,
    )
    axes.set_xlim(0.0, edges[-1])
    axes.set_yticks([0, maximum])
    axes.xaxis.set_major_locator(MaxNLocator(MAX_TICKS, steps=[1, 2, 5, 10]))
    axes.tick_params(colors=FAINT, labelsize=8, length=2)
    axes.spines[["top", "right", "left"]].set_visible(False)
    return figure
