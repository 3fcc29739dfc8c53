"""Figure of a state graph: the states in the order of time, moves forward above them and moves back below."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import FancyArrowPatch
from sklearn.utils.validation import check_is_fitted

from skill.states.state_graph import StateGraph

MIN_SHOWN = 0.02  # minimum probability of a move that is drawn
MIN_LABELLED = 0.1  # minimum probability of a move that is labelled


def draw_state_graph(graph: StateGraph, axes: Axes, names: Sequence[str]) -> None:
    """Draws the states as discs, in the order of their mean phase, and the outcomes as squares at the right.

    The area of a disc grows with the share of time spent in the state. The label below it gives the mean dwell time and
    the probability of success. The width of an arrow is the probability of the move from its start.

    Args:
        graph: fitted state graph.
        axes: axes to draw on.
        names: names (K,) of the states.

    Raises:
        ValueError: if the number of names is not K.
    """
    check_is_fitted(graph)
    K, A = graph.exits_.shape
    if len(names) != K:
        raise ValueError(f"{len(names)} names for {K} states; expected one for each state")
    colours = [f"C{k % 10}" for k in range(K)]
    states = [int(k) for k in np.argsort(graph.phase_) if graph.visits_[k] > 0]
    ends = sorted((a for a in range(A) if graph.exits_[:, a].any()), key=lambda a: not _is_success(graph, a))
    points = {state: (float(i), 0.0) for i, state in enumerate(states)}
    failures = 0
    for a in ends:  # success above the line of states, failures below
        failures += not _is_success(graph, a)
        points[K + a] = (len(states) + 0.4, 0.6 if _is_success(graph, a) else -0.6 * failures)

    for start in states:
        for end, probability in enumerate(graph.moves_[start]):
            if probability >= MIN_SHOWN and end in points:
                _draw_move(axes, points[start], points[end], float(probability), colours[start])
    shares = graph.visits_ * np.nan_to_num(graph.dwell_mean_s_)
    shares = shares / shares.sum()
    for state in states:
        label = f"{graph.dwell_mean_s_[state]:.2f} s\nP = {graph.reach_[state]:.2f}"
        _draw_state(axes, points[state], float(shares[state]), colours[state], names[state], label)
    for a in ends:
        label = f"{graph.outcomes_[a]} ({int(graph.exits_[:, a].sum())})"
        _draw_outcome(axes, points[K + a], "tab:green" if _is_success(graph, a) else "tab:red", label)
    span = 0.28 * len(states) + 0.4
    axes.set(xlim=(-0.7, len(states) + 2.2), ylim=(-max(span, 0.6 * failures + 0.5), span), aspect="equal")
    axes.set_axis_off()


def _is_success(graph: StateGraph, outcome: int) -> bool:
    return str(graph.outcomes_[outcome]) == graph.success


def _draw_state(axes: Axes, point: tuple[float, float], share: float, colour: str, name: str, label: str) -> None:
    """Draws one state as a disc whose area grows with its share of the time."""
    axes.scatter(*point, s=250 + 2500 * share, color=colour, edgecolor="black", zorder=3)
    axes.annotate(name, point, ha="center", va="center", zorder=4)
    axes.annotate(
        label,
        point,
        xytext=(0, -38),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize="small",
        zorder=4,
    )


def _draw_outcome(axes: Axes, point: tuple[float, float], colour: str, label: str) -> None:
    axes.scatter(*point, s=300, marker="s", color=colour, edgecolor="black", zorder=3)
    axes.annotate(label, point, xytext=(14, 0), textcoords="offset points", va="center")


def _draw_move(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], probability: float, colour: str
) -> None:
    """Draws one move as an arrow whose width is its probability."""
    # A positive bow bends to the left of the arrow. Moves forward thus pass above the states between, and moves back
    # below. Moves to failures, which lie below, also pass below.
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
