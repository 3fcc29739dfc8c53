"""A small drawing of what follows what: contact states in a row, as inline SVG."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np

from skill.states.state_summary import StateSummary

SPACING = 116.0  # between states, in units of the drawing
MIN_RADIUS, MAX_RADIUS = 13.0, 30.0
RISE, MAX_RISE = 38.0, 230.0  # height of an arc for each state that it spans, and of the largest arc
MARGIN, TEXT = 18.0, 16.0
MIN_DRAWN, MIN_LABELLED = 0.05, 0.1  # smallest shares of arcs that are drawn and labelled


def state_flow(states: Sequence[StateSummary], colours: Sequence[str], inks: Sequence[str]) -> str:
    """Draws each state as a disc, and an arc for each move: those forward above the discs, those back below.

    The area of a disc grows with the share of time, the width of an arc with the share of the visits that end so. The
    last line is the median duration of a visit.

    Args:
        states: the states.
        colours: (K,) of the discs.
        inks: (K,) of the numbers on them.

    Returns:
        An SVG element with a text alternative.
    """
    K = len(states)
    arcs = [
        (k, K if following is None else following, share)
        for k, state in enumerate(states)
        for following, share in state.following
        if share >= MIN_DRAWN
    ]
    rise = min(RISE, MAX_RISE / max((abs(end - start) for start, end, _ in arcs), default=1))
    above = MARGIN + TEXT + max([MAX_RADIUS, *(_height(arc, rise) for arc in arcs if arc[1] > arc[0])])
    below = MARGIN + 2 * TEXT + max([MAX_RADIUS, *(_height(arc, rise) for arc in arcs if arc[1] < arc[0])])
    radii = [MIN_RADIUS + (MAX_RADIUS - MIN_RADIUS) * float(np.sqrt(state.share)) for state in states]
    drawn = [_arc(arc, rise, [*radii, MIN_RADIUS], colours[arc[0]], above, _describe(arc, K)) for arc in arcs]
    parts = [*(arrow for arrow, _ in drawn), *(label for _, label in drawn)]
    for k, (state, radius) in enumerate(zip(states, radii, strict=True)):
        title = html.escape(f"state {k}: {state.name}; {100 * state.share:.0f} % of the time")
        x = f"{_x(k):.1f}"
        parts.append(
            f'<g fill="{inks[k]}"><title>{title}</title><circle cx="{x}" cy="{above:.1f}" r="{radius:.1f}"'
            f' fill="{colours[k]}"/><text x="{x}" y="{above + 5:.1f}" class="number">{k}</text></g>'
        )
        if state.visits:
            parts.append(f'<text x="{x}" y="{above + below - 6:.1f}">{state.duration.median:.2f} s</text>')
    parts.append(
        f'<rect x="{_x(K) - MIN_RADIUS:.1f}" y="{above - MIN_RADIUS:.1f}" width="{2 * MIN_RADIUS}"'
        f' height="{2 * MIN_RADIUS}" rx="3" class="end"/><text x="{_x(K):.1f}" y="{above + 4:.1f}">end</text>'
    )
    width, height = _x(K) + MAX_RADIUS + MARGIN, above + below
    label = html.escape("What follows what. " + " ".join(f"{_describe(arc, K)}." for arc in arcs))
    return (
        f'<svg viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}" role="img"'
        f' aria-label="{label}">{"".join(parts)}</svg>'
    )


def _x(place: int) -> float:
    return MARGIN + MAX_RADIUS + SPACING * place


def _height(arc: tuple[int, int, float], rise: float) -> float:
    return rise * abs(arc[1] - arc[0])


def _describe(arc: tuple[int, int, float], K: int) -> str:
    start, end, share = arc
    after = "the end of the recording" if end == K else f"state {end}"
    return f"After {100 * share:.0f} % of the visits to state {start} comes {after}"


def _arc(
    arc: tuple[int, int, float], rise: float, radii: Sequence[float], colour: str, middle: float, title: str
) -> tuple[str, str]:
    """An arrow from the edge of a disc to that of another, which bows by its height, and its label."""
    start, end, share = arc
    upward = -1.0 if end > start else 1.0
    height = _height(arc, rise)
    a, b = np.array([_x(start), middle]), np.array([_x(end), middle])
    control = np.array([0.5 * (a[0] + b[0]), middle + 2 * upward * height])
    leave, arrive = (control - a) / np.linalg.norm(control - a), (b - control) / np.linalg.norm(b - control)
    width = 1.0 + 5.0 * share
    head = 6.0 + 1.2 * width
    tip = b - (radii[end] + 2) * arrive
    foot = tip - head * arrive
    side = 0.45 * head * np.array([-arrive[1], arrive[0]])
    begin = a + radii[start] * leave
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (tip, foot + side, foot - side))
    arrow = (
        f'<path d="M{begin[0]:.1f} {begin[1]:.1f} Q{control[0]:.1f} {control[1]:.1f} {foot[0]:.1f} {foot[1]:.1f}"'
        f' fill="none" stroke="{colour}" stroke-width="{width:.1f}"/><polygon points="{points}" fill="{colour}"/>'
    )
    top = (begin + 2 * control + foot) / 4
    y = top[1] + upward * (0.5 * width + 4.0) + (0.0 if upward < 0 else 9.0)
    label = f'<text x="{top[0]:.1f}" y="{y:.1f}">{100 * share:.0f} %</text>' if share >= MIN_LABELLED else ""
    return f"<g><title>{html.escape(title)}</title>{arrow}</g>", label
