"""Series over coloured runs of labels, as HTML and SVG that a page stretches to its width.

Both fill an element from the first to the last time. `bands` are for the background and for strips below a series.
"""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skill.arrays import Array
from skill.states.state_style import GAP

TICKS = 1e4
"""Units of the horizontal axis of a drawing in a second."""


def bands(
    time: Array,
    labels: NDArray[np.integer],
    colours: Sequence[str],
    titles: Sequence[str],
    texts: Sequence[str] | None = None,
) -> str:
    """Returns an element for each run of equal labels; a gap without samples divides it.

    Args:
        time: (n,) of the samples, s, from 0 on.
        labels: (n,) index into the other arguments.
        colours: the colour of each label.
        titles: what each label is, as text.
        texts: what stands in its runs; None for nothing.
    """
    gap, period = _gaps(time)
    starts = np.flatnonzero(np.concatenate([[True], gap | (np.diff(labels) != 0)]))
    last = starts[1:] - 1
    ends = np.append(np.where(gap[last], time[last] + period, time[last + 1]), time[-1])
    elements = []
    for first, end, label in zip(starts.tolist(), ends.tolist(), labels[starts].tolist(), strict=True):
        left, width = (100 * length / time[-1] for length in (time[first], end - time[first]))
        elements.append(
            f'<i data-first="{first}" title="{html.escape(titles[label])}" style="left: {left:.3f}%;'
            f' width: {width:.3f}%; --colour: {colours[label]}">{html.escape(texts[label]) if texts else ""}</i>'
        )
    return "".join(elements)


def curve(time: Array, values: ArrayLike) -> str:
    """Returns the path of a series as SVG, which gaps divide: the time in `TICKS`, and values that grow upwards.

    Args:
        time: (n,) of the samples, s, from 0 on.
        values: (n,), rounded to whole numbers.
    """
    x, y = np.rint(TICKS * time).astype(int), np.rint(values).astype(int)
    commands = np.where(np.concatenate([[True], _gaps(time)[0]]), "M", "L")
    return "".join(f"{c}{a} {-b}" for c, a, b in zip(commands.tolist(), x.tolist(), y.tolist(), strict=True))


def drawing(end: float, low: float, high: float, content: str, attributes: str = "") -> str:
    """Returns an SVG element of some curves.

    Args:
        end: the last time, s.
        low: smallest value, in the unit of the curves.
        high: largest value.
        content: elements of SVG.
        attributes: further attributes of the element.
    """
    return (
        f'<svg viewBox="0 {-high:g} {TICKS * end:.0f} {high - low:g}" preserveAspectRatio="none" {attributes}>'
        f"{content}</svg>"
    )


def _gaps(time: Array) -> tuple[NDArray[np.bool_], float]:
    """Which intervals between samples are gaps, and the median interval, s."""
    intervals = np.diff(time)
    period = float(np.median(intervals))
    return intervals > GAP * period, period
