"""The state graph as a figure: states along time, moves forward above them and back below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from sklearn.utils.validation import check_is_fitted

from skill.states.state_graph import StateGraph

MIN_SHOWN = 0.02  # moves of less probability would only clutter the figure
MIN_LABELLED = 0.1


def draw_state_graph(
    graph: StateGraph,
    axes: Axes,
    names: Sequence[str] | None = None,
    colours: Sequence[Any] | None = None,
) -> None:
    """Draws the states as discs, ordered by when they occur, and the outcomes as squares at the right.

    A disc's area grows with the share of time spent in the state; beneath it stand the mean dwell time and
    the probability of success. An arrow's width is the probability of the move from where it starts.

    Args:
        graph: fitted.
        axes: to draw on.
        names: (K,), of the states; their numbers if None.
        colours: (K,), of the states, anything matplotlib takes; matplotlib's cycle if None.

    Raises:
        ValueError: if there are not as many names or colours as states.
    """
    check_is_fitted(graph)
    K, A = graph.exits_.shape
    names = [str(k) for k in range(K)] if names is None else list(names)
    colours = [f"C{k % 10}" for k in range(K)] if colours is None else list(colours)
    for what, given in (("names", names), ("colours", colours)):
        if len(given) != K:
            raise ValueError(f"{len(given)} {what} for {K} states; expected one for each state")
    seen = [int(k) for k in np.argsort(graph.phase_) if graph.visits_[k] > 0]
    place = {state: float(i) for i, state in enumerate(seen)}
    ends = [a for a in range(A) if graph.exits_[:, a].any()]
    ends.sort(key=lambda a: str(graph.outcomes_[a]) != graph.success)
    points = {state: (x, 0.0) for state, x in place.items()}
    below = 0
    for a in ends:  # success above the line of states, failures below
        wanted = str(graph.outcomes_[a]) == graph.success
        below += not wanted
        points[K + a] = (len(seen) + 0.4, 0.6 if wanted else -0.6 * below)

    shares = graph.visits_ * np.nan_to_num(graph.dwell_mean_s_)
    shares = shares / shares.sum()
    for start in seen:
        for end, probability in enumerate(graph.moves_[start]):
            if probability >= MIN_SHOWN and end in points:
                _draw_move(axes, points[start], points[end], float(probability), colours[start])
    for state in seen:
        axes.scatter(*points[state], s=250 + 2500 * shares[state], color=colours[state], edgecolor="black", zorder=3)
        axes.annotate(names[state], points[state], ha="center", va="center", zorder=4)
        axes.annotate(
            f"{graph.dwell_mean_s_[state]:.2f} s\nP = {graph.reach_[state]:.2f}",
            points[state],
            xytext=(0, -38),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize="small",
            zorder=4,
        )
    for a in ends:
        name = str(graph.outcomes_[a])
        colour = "tab:green" if name == graph.success else "tab:red"
        axes.scatter(*points[K + a], s=300, marker="s", color=colour, edgecolor="black", zorder=3)
        axes.annotate(
            f"{name} ({int(graph.exits_[:, a].sum())})",
            points[K + a],
            xytext=(14, 0),
            textcoords="offset points",
            va="center",
        )
    span = 0.28 * len(seen) + 0.4
    axes.set(xlim=(-0.7, len(seen) + 2.2), ylim=(-max(span, 0.6 * below + 0.5), span), aspect="equal")
    axes.set_axis_off()


def _draw_move(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    probability: float,
    colour: Any,
) -> None:
    # A positive bow is to the arrow's left: forward moves pass above the states between, moves back below,
    # and so do moves to failures, which lie below.
    bow = -0.4 if end[1] < 0 else 0.4
    axes.add_patch(
        FancyArrowPatch(
            start,
            end,
            connectionstyle=f"arc3,rad={-bow}",
            arrowstyle="-|>",
            mutation_scale=12,
            linewidth=0.5 + 4.0 * probability,
            shrinkA=14,
            shrinkB=14,
            color=colour,
            alpha=0.6,
            zorder=1,
        )
    )
    if probability < MIN_LABELLED:
        return
    (x0, y0), (x1, y1) = start, end
    middle = (0.5 * (x0 + x1) - 0.5 * bow * (y1 - y0), 0.5 * (y0 + y1) + 0.5 * bow * (x1 - x0))
    axes.annotate(f"{probability:.2f}", middle, ha="center", va="center", fontsize="x-small", zorder=2)
