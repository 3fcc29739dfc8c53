"""From a polygon whose corners lie on an outline to the arcs and segments of that outline."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models import Array

Points = NDArray[np.complex128]
"""Points x + i y, m."""

DOUBLE, STRAIGHT = 1e-8, 5e-9
"""Largest distance of two corners that are one, and of a corner from the line between its neighbours, m."""

MAX_TURN = math.radians(31.0)
"""Largest angle between two sides of a polygon that stands for an arc."""

MIN_POINTS = 4
"""Minimum number of corners on one arc; fewer lie on many circles."""

UNEQUAL = 3.0
"""Largest over smallest side of a polygon that stands for one arc."""

ON_CIRCLE = 2e-8
"""Largest distance of a corner from its arc, m; single precision has 2e-9."""

TOUCHING = 3e-7
"""Largest distance of an arc from a line or an arc that it touches, m."""

LARGEST_ARC = math.radians(60.0)
"""Largest angle of an arc that rounds one corner; a larger arc is that of several."""


@dataclass(frozen=True)
class Arc:
    """A part of a circle.

    Attributes:
        centre: x + i y, m.
        radius: m.
        first: one of its ends, x + i y.
        last: the other end.
        span: signed angle by which it turns, rad, about.
    """

    centre: complex
    radius: float
    first: complex
    last: complex
    span: float

    def direction(self, point: complex) -> complex:
        """Returns the direction in which the arc passes a point, a unit number."""
        return self.tangent_at((point - self.centre) * 1j * math.copysign(1.0, self.span)).direction

    def tangent_at(self, direction: complex) -> Line:
        """Returns its tangent in a direction."""
        unit = direction / abs(direction)
        return Line(self.centre - 1j * math.copysign(1.0, self.span) * self.radius * unit, unit)


@dataclass(frozen=True)
class Line:
    """A line.

    Attributes:
        point: on it, x + i y, m.
        direction: unit number.
    """

    point: complex
    direction: complex

    def distance(self, point: complex) -> float:
        """Signed distance of a point, positive on the left, m."""
        return ((point - self.point) * self.direction.conjugate()).imag

    def crossing(self, other: Line) -> complex:
        """Returns where two lines meet."""
        sine = (self.direction.conjugate() * other.direction).imag
        return other.point - other.direction * self.distance(other.point) / sine


def _without_straight_corners(z: Points) -> Points:
    """Returns a closed polygon without corners that are double, or on the line between their neighbours."""
    z = z[np.abs(z - np.roll(z, 1)) > DOUBLE]
    while len(z) > 3:
        before, after = np.roll(z, 1), np.roll(z, -1)
        along = (after - before) / np.abs(after - before)
        off = np.abs(((z - before) * along.conj()).imag)
        straight = off < STRAIGHT
        straight &= ~np.roll(straight, 1)  # one of two neighbours at a time
        if not straight.any():
            break
        z = z[~straight]
    return z


def rounded_polygon(points: Array) -> list[tuple[complex, float]]:
    """Returns the corners (x + i y, radius) of the polygon with arcs that a dense polygon (n, 2) stands for, m.

    Corners of the dense polygon on a common circle become an arc, and all other sides stay. An arc that is larger than
    `LARGEST_ARC` rounds several corners, without straight sides between them. The corners are where consecutive lines
    meet: the sides, and tangents of the arcs.
    """
    z = _without_straight_corners(points[:, 0] + 1j * points[:, 1])
    runs = _runs(z)
    if runs and len(runs[0]) > len(z):
        centre, radius = _circle(z)
        around = np.exp(1j * np.pi * (2.0 * np.arange(6) + 1.0) / 6.0)
        return [(complex(centre + radius / math.cos(np.pi / 6.0) * w), radius) for w in around]
    pieces = _pieces(z, runs)
    lines: list[tuple[Line, float]] = []  # each with the radius of the corner after it
    for k, piece in enumerate(pieces):
        before, after = pieces[k - 1], pieces[(k + 1) % len(pieces)]
        if isinstance(piece, Line):
            lines.append((piece, _radius_after(piece, after)))
            continue
        start, end = _common_tangent(before, piece), _common_tangent(piece, after)
        first = start or piece.tangent_at(piece.direction(piece.first))
        last = end or piece.tangent_at(piece.direction(piece.last))
        turn = float(np.angle(last.direction / first.direction))
        span = turn + 2.0 * math.pi * round((piece.span - turn) / (2.0 * math.pi))
        count = max(1, math.ceil(abs(span) / LARGEST_ARC - 1e-6))
        if not (start and isinstance(before, Line)):
            lines.append((first, piece.radius))
        for j in range(1, count):
            lines.append((piece.tangent_at(first.direction * np.exp(1j * span * j / count)), piece.radius))
        if not end:
            lines.append((last, 0.0))
    return [(complex(line.crossing(lines[(k + 1) % len(lines)][0])), radius) for k, (line, radius) in enumerate(lines)]


def _radius_after(line: Line, after: Line | Arc) -> float:
    """Returns the radius of the corner between a side and what follows: that of an arc that it touches, or 0."""
    return after.radius if isinstance(after, Arc) and _common_tangent(line, after) else 0.0


def _common_tangent(first: Line | Arc, second: Line | Arc) -> Line | None:
    """Returns the line in which two consecutive pieces pass smoothly into each other, or None."""
    if isinstance(first, Arc) and isinstance(second, Arc):
        across = second.centre - first.centre
        opposite = first.span * second.span < 0.0
        apart = first.radius + second.radius if opposite else abs(first.radius - second.radius)
        if abs(abs(across) - apart) > TOUCHING:
            return None
        towards = across if opposite or first.radius > second.radius else -across
        return first.tangent_at(towards * 1j * math.copysign(1.0, first.span))
    line, arc = (first, second) if isinstance(first, Line) else (second, first)
    assert isinstance(line, Line)
    assert isinstance(arc, Arc)
    touches = abs(line.distance(arc.centre) - math.copysign(arc.radius, arc.span)) < TOUCHING
    return line if touches else None


def _pieces(z: Points, runs: list[list[int]]) -> list[Line | Arc]:
    """Returns the sides and arcs of a polygon in order, from the numbers of the points on each arc."""
    starts = {run[0]: run for run in runs}
    pieces: list[Line | Arc] = []
    at = first = runs[0][0] if runs else 0
    while not pieces or at != first:
        if at in starts:
            run = starts[at]
            centre, radius = _circle(z[run])
            span = float(np.angle((z[run][1:] - centre) / (z[run][:-1] - centre)).sum())
            pieces.append(Arc(centre, radius, complex(z[at]), complex(z[run[-1]]), span))
            at = run[-1]
        else:
            side = z[(at + 1) % len(z)] - z[at]
            pieces.append(Line(complex(z[at]), complex(side / abs(side))))
            at = (at + 1) % len(z)
    # A short side between two arcs that touch stands for the place at which they do.
    return [
        piece
        for k, piece in enumerate(pieces)
        if not (
            isinstance(piece, Line)
            and isinstance(before := pieces[k - 1], Arc)
            and isinstance(after := pieces[(k + 1) % len(pieces)], Arc)
            and before.span * after.span < 0.0
            and _common_tangent(before, after)
        )
    ]


def _runs(z: Points) -> list[list[int]]:
    """Returns the numbers of the points on each arc, in order; all of them and the first again for a circle."""
    n = len(z)
    sides = np.roll(z, -1) - z
    lengths = np.abs(sides)
    turns = np.angle(sides / np.roll(sides, 1))  # at each point

    def is_arc(run: list[int]) -> bool:
        inner, along = turns[run[1:-1]], lengths[run[:-1]]
        if np.abs(inner).max() > MAX_TURN or inner.min() * inner.max() <= 0.0 or along.max() > UNEQUAL * along.min():
            return False
        centre, radius = _circle(z[run])
        return bool(np.abs(np.abs(z[run] - centre) - radius).max() < ON_CIRCLE)

    def grown(run: list[int]) -> list[int]:
        """Adds points at both ends of an arc, as long as it is one."""
        for step in (1, -1):
            while len(run) <= n:
                longer = [*run, (run[-1] + 1) % n] if step == 1 else [(run[0] - 1) % n, *run]
                if not is_arc(longer):
                    break
                run = longer
        return run

    if n < MIN_POINTS:
        return []
    found: list[list[int]] = []
    at = 0
    while at < n:
        run = [(at + k) % n for k in range(MIN_POINTS)]
        if is_arc(run):
            found.append(grown(run))
            if len(found[-1]) > n:
                return [found[-1]]
            at = max(at + 1, found[-1][-1] if found[-1][-1] > at else n)
        else:
            at += 1
    # An arc can begin or end with a side that belongs to the next one; the longer one has it.
    free, kept = np.ones(n, dtype=bool), []
    for run in sorted(found, key=len, reverse=True):
        core = grown(run[2:-2] if len(run) >= MIN_POINTS + 4 else run)
        own = [side for side in core[:-1] if free[side]]
        if len(own) + 1 >= MIN_POINTS and own == [(own[0] + k) % n for k in range(len(own))]:
            free[own] = False
            kept.append([*own, (own[-1] + 1) % n])
    return sorted(kept, key=lambda run: run[0])


def _circle(z: Points) -> tuple[complex, float]:
    """Returns centre and radius of the circle through points, by least squares of its equation."""
    shift = z.mean()
    w = z - shift
    scale = np.abs(w).max()
    w = w / scale
    rows = np.column_stack([w.real, w.imag, np.ones(len(w))])
    a, b, c = np.linalg.lstsq(rows, np.abs(w) ** 2, rcond=None)[0]
    centre = complex(0.5 * a, 0.5 * b)
    return shift + scale * centre, float(scale * math.sqrt(max(0.0, c + abs(centre) ** 2)))
