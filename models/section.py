"""The cross-section of a peg or of a hole: an outline of line segments and arcs.

Coordinates of a shape are in units of its size, the ``peg_radius`` of a scenario: for the named shapes the radius of
the largest circle inside. An outline runs counter-clockwise, with the material of the peg on its left. A hole has the
outline of its peg, offset outwards by the clearance: segments move, arcs keep their centres, and the segments that meet
in a sharp corner still do (a mitre).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from models import Array

KIND, X, Y, C, S, SIZE, START, SPAN = range(8)
"""Columns of a piece. A segment has the kind 0, its first point (X, Y), its direction (C, S) and its length. An arc has
the kind 1 where the material of the peg is inside it and -1 where it is outside, its centre, the direction to its
middle, its radius, and the angle (rad) at which it starts and by which it turns. A sharp corner is an arc of radius
0."""

ROUND, SQUARE, HEXAGON, RECTANGLE, D, KEY = NAMES = ("round", "square", "hexagon", "rectangle", "d", "key")
"""Shapes that a scenario can name."""

CORNER = 0.05
"""Radius of the corners of the named shapes, in units of their size."""

FILLET = 0.15
"""Radius of the concave arcs of the named shapes; that of the hole is smaller by the clearance and the chamfer."""

FLAT = 0.6
"""Distance of the flat side of `D` from the axis, in units of the radius."""

POLYGONS: dict[str, list[list[float]]] = {
    SQUARE: [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]],
    RECTANGLE: [[1.5, -1.0], [1.5, 1.0], [-1.5, 1.0], [-1.5, -1.0]],
    HEXAGON: [[2.0 / math.sqrt(3.0) * f(k * math.pi / 3.0) for f in (math.cos, math.sin)] for k in range(6)],
}
"""Corners (x, y) of the named polygons, each with the radius `CORNER`."""

KEY_WIDTH, KEY_HEIGHT = 0.25, 1.25
"""Half of the width of the key of `KEY`, and the distance of its outer side from the axis, in units of the radius."""

MAX_CORNERS = 32
"""Largest number of corners of a polygon."""

ROUNDING = 1e-6
"""Length that counts as none in the corners of a polygon, in units of its size: they are read from texts."""

SYMMETRY_ERROR = 1e-5
"""Largest distance of an outline from its image, in units of its size, that counts as none."""

MAX_ORDER = 64
"""Largest order of a group of rotations that is looked for; only a circle has a larger one."""


@dataclass(frozen=True, eq=False)
class Section:
    """A cross-section.

    Attributes:
        pieces: of the outline, (n, 8), see `KIND`; in units of m, or of the size of the shape.
    """

    pieces: Array

    @cached_property
    def area(self) -> float:
        """Area, by Green's theorem."""
        return sum(_area(piece) for piece in self.pieces)

    @cached_property
    def order(self) -> int:
        """Number of rotations about the axis that map the section onto itself; 0 if all do."""
        if len(self.pieces) == 1:
            return 0
        corners = _corners(self.pieces)
        turns = range(min(len(corners), MAX_ORDER), 0, -1)
        return next(order for order in turns if _maps(corners, corners * np.exp(2j * np.pi / order)))

    @cached_property
    def mirror(self) -> float | None:
        """Angle from x of a line through the axis in which the section is its own mirror image, rad, or None."""
        if len(self.pieces) == 1:
            return 0.0
        corners = _corners(self.pieces)
        middles = np.unique(np.round(np.angle(np.outer(corners, corners)).ravel() / 2.0, 12))
        lines = [0.0, *(float(angle) for angle in middles)]
        return next((t for t in lines if _maps(corners, np.exp(2j * t) * corners.conj())), None)

    @cached_property
    def outer_radius(self) -> float:
        """Radius of the smallest circle about the axis that holds the section."""
        return max(_farthest(piece) for piece in self.pieces)

    @cached_property
    def inner_radius(self) -> float:
        """Radius of the largest circle about the axis inside the section."""
        return min(_nearest(piece) for piece in self.pieces)

    def reach(self, x: float, y: float) -> float:
        """Returns how far the section extends along a direction, given as a unit vector."""
        ends = np.concatenate([point_on(piece, np.array([0.0, 1.0])) for piece in self.pieces]) @ [x, y]
        arcs = [p[X] * x + p[Y] * y + p[SIZE] for p in self.pieces if p[KIND] == 1.0 and _faces(p, x, y)]
        return float(max([*ends, *arcs]))

    def scaled(self, factor: float) -> Self:
        """Returns the section with all lengths multiplied by a factor."""
        pieces = self.pieces.copy()
        pieces[:, [X, Y, SIZE]] *= factor
        return type(self)(pieces)

    def offset(self, distance: float) -> Self:
        """Returns the section whose outline lies outside of this one by a distance.

        Raises:
            ValueError: if a concave arc has a smaller radius, or a segment would vanish.
        """
        pieces = self.pieces.copy()
        for k, piece in enumerate(self.pieces):
            if piece[KIND] == 0.0:
                before, after = (_mitre(self.pieces[(k + step) % len(pieces)]) for step in (-1, 1))
                pieces[k, X] += distance * (piece[S] - before * piece[C])
                pieces[k, Y] -= distance * (piece[C] + before * piece[S])
                pieces[k, SIZE] += distance * (before + after)
            elif piece[SIZE] > 0.0:
                pieces[k, SIZE] += distance * piece[KIND]
            else:
                reach = distance / math.cos(0.5 * piece[SPAN])
                pieces[k, X] += piece[KIND] * reach * piece[C]
                pieces[k, Y] += piece[KIND] * reach * piece[S]
            if pieces[k, SIZE] < 0.0:
                what = "a side" if piece[KIND] == 0.0 else "a concave arc of the radius"
                raise ValueError(f"{what} {piece[SIZE]:.4g} is too small for an offset of {distance:.4g}")
        return type(self)(pieces)

    def polyline(self, facets: int) -> Array:
        """Returns points (n, 2) of the outline; its arcs turn by at most a full turn over ``facets`` between them."""
        points: list[Array] = []
        for piece in self.pieces:
            count = max(1, math.ceil(facets * abs(piece[SPAN]) / (2.0 * math.pi) - 1e-9))
            if piece[KIND] == 0.0 or piece[SIZE] > 0.0:
                points.append(point_on(piece, np.arange(count), count))
        return np.concatenate(points)


def on_piece(piece: Array, share: Any, whole: float = 1.0) -> tuple[Any, Any]:
    """Returns the coordinates of points of a piece at parts of its length, of which ``whole`` is all."""
    if piece[KIND] == 0.0:
        along = share * piece[SIZE] / whole
        return piece[X] + along * piece[C], piece[Y] + along * piece[S]
    angle = piece[START] + share * piece[SPAN] / whole
    return piece[X] + piece[SIZE] * np.cos(angle), piece[Y] + piece[SIZE] * np.sin(angle)


def point_on(piece: Array, share: Array, whole: float = 1.0) -> Array:
    """Returns points (n, 2) of a piece; see `on_piece`."""
    return np.column_stack(on_piece(piece, share, whole))


def section_of(shape: str | Sequence[Sequence[float]]) -> Section:
    """Returns the section of a shape.

    Args:
        shape: one of `NAMES`, or the corners of a polygon, counter-clockwise, as rows (x, y, radius) or (x, y); in
            units of the size.

    Raises:
        ValueError: if the name is unknown, or the corners describe no outline around the axis.
    """
    if not isinstance(shape, str):
        return Section(_polygon(shape))
    if shape == ROUND:
        return Section(np.array([_arc(0.0, 0.0, 1.0, 0.0, 2.0 * math.pi)]))
    if shape in POLYGONS:
        return Section(_polygon(rounded_corners(shape)))
    if shape == D:
        return Section(_d())
    if shape == KEY:
        return Section(_key())
    raise ValueError(f"section {shape!r}, expected one of {list(NAMES)} or the corners of a polygon")


def rounded_corners(name: str, turn: float = 0.0) -> list[list[float]]:
    """Returns the corners (x, y, radius) of one of `POLYGONS`, turned about the axis by an angle, rad."""
    c, s = math.cos(turn), math.sin(turn)
    return [[c * x - s * y, s * x + c * y, CORNER] for x, y in POLYGONS[name]]


def _segment(x: float, y: float, end_x: float, end_y: float) -> list[float]:
    length = math.hypot(end_x - x, end_y - y)
    return [0.0, x, y, (end_x - x) / length, (end_y - y) / length, length, 0.0, 0.0]


def _arc(x: float, y: float, radius: float, start: float, span: float) -> list[float]:
    middle = start + 0.5 * span
    return [math.copysign(1.0, span), x, y, math.cos(middle), math.sin(middle), radius, start, span]


def _polygon(corners: Sequence[Sequence[float]]) -> Array:
    """Returns the pieces of a polygon: a segment for each side, and an arc for each corner."""
    if not 3 <= len(corners) <= MAX_CORNERS or any(len(corner) not in (2, 3) for corner in corners):
        raise ValueError(f"a polygon of {len(corners)} corners, expected 3 to {MAX_CORNERS} rows (x, y, radius)")
    p = np.array([complex(corner[0], corner[1]) for corner in corners])
    radii = np.array([corner[2] if len(corner) == 3 else 0.0 for corner in corners])
    if not (np.isfinite(p).all() and np.isfinite(radii).all() and (radii >= 0.0).all()):
        raise ValueError("the corners of a polygon are not finite, or a radius is negative")
    sides = np.roll(p, -1) - p
    if (np.abs(sides) < ROUNDING).any():
        raise ValueError("two corners of a polygon are at one place")
    turns = np.angle(sides / np.roll(sides, 1))  # at each corner
    seen = np.angle(np.roll(p, -1) / p)  # angles under which the sides are seen from the axis
    if (seen <= 0.0).any() or abs(seen.sum() - 2.0 * np.pi) > 1e-6 or (np.abs(turns) > 0.95 * np.pi).any():
        raise ValueError("a polygon is not counter-clockwise, has a spike, or a side that is not seen from the axis")
    cut = radii * np.abs(np.tan(0.5 * turns))  # that an arc takes from both of its sides
    long = np.abs(sides) - cut - np.roll(cut, -1)
    if (long < -ROUNDING).any():
        raise ValueError(f"the corners of side {int(long.argmin()) + 1} of a polygon have too large radii")
    along = sides / np.abs(sides)
    pieces = []
    for k, (corner, turn, radius) in enumerate(zip(p, turns, radii, strict=True)):
        inwards = along[k] * 1j * math.copysign(1.0, turn)
        centre = corner + cut[k] * along[k] + radius * inwards
        if turn != 0.0:
            pieces.append(_arc(centre.real, centre.imag, radius, float(np.angle(-inwards)) - turn, float(turn)))
        first, last = corner + cut[k] * along[k], p[(k + 1) % len(p)] - cut[(k + 1) % len(p)] * along[k]
        if abs(last - first) > ROUNDING:
            pieces.append(_segment(first.real, first.imag, last.real, last.imag))
    return np.array(pieces)


def _d() -> Array:
    """Returns a circle with a flat side, which is at x = `FLAT`."""
    x = FLAT - CORNER
    y = math.sqrt((1.0 - CORNER) ** 2 - x**2)
    angle = math.atan2(y, x)
    return np.array(
        [
            _arc(0.0, 0.0, 1.0, angle, 2.0 * (math.pi - angle)),
            _arc(x, -y, CORNER, -angle, angle),
            _segment(FLAT, -y, FLAT, y),
            _arc(x, y, CORNER, 0.0, angle),
        ]
    )


def _key() -> Array:
    """Returns a circle with a key along x."""
    foot = KEY_WIDTH + FILLET
    x = math.sqrt((1.0 + FILLET) ** 2 - foot**2)
    angle = math.atan2(foot, x)
    outside, side = KEY_HEIGHT - CORNER, KEY_WIDTH - CORNER
    right = 0.5 * math.pi
    return np.array(
        [
            _arc(0.0, 0.0, 1.0, angle, 2.0 * (math.pi - angle)),
            _arc(x, -foot, FILLET, math.pi - angle, angle - right),
            _segment(x, -KEY_WIDTH, outside, -KEY_WIDTH),
            _arc(outside, -side, CORNER, -right, right),
            _segment(KEY_HEIGHT, -side, KEY_HEIGHT, side),
            _arc(outside, side, CORNER, 0.0, right),
            _segment(outside, KEY_WIDTH, x, KEY_WIDTH),
            _arc(x, foot, FILLET, -right, angle - right),
        ]
    )


def _mitre(piece: Array) -> float:
    """Tangent of half the turn of a sharp corner; 0 for other pieces."""
    return math.tan(0.5 * piece[SPAN]) if piece[KIND] != 0.0 and piece[SIZE] == 0.0 else 0.0


def _area(piece: Array) -> float:
    x, y, size, span = piece[X], piece[Y], piece[SIZE], piece[SPAN]
    if piece[KIND] == 0.0:
        return float(0.5 * size * (x * piece[S] - y * piece[C]))
    start, end = piece[START], piece[START] + span
    moved = x * (math.sin(end) - math.sin(start)) - y * (math.cos(end) - math.cos(start))
    return float(0.5 * size * (size * span + moved))


def _corners(pieces: Array) -> Array:
    """The ends and middles of the pieces as complex numbers."""
    points = np.concatenate([point_on(piece, np.array([0.0, 0.5])) for piece in pieces])
    return np.asarray(points[:, 0] + 1j * points[:, 1])


def _maps(points: Array, images: Array) -> bool:
    return bool(np.abs(points[:, None] - images).min(axis=0).max() < SYMMETRY_ERROR * np.abs(points).max())


def _farthest(piece: Array) -> float:
    """Largest distance of a piece from the axis."""
    ends = np.hypot(*point_on(piece, np.array([0.0, 1.0])).T).max()
    if piece[KIND] == 1.0 and _faces(piece, piece[X], piece[Y]):
        return math.hypot(piece[X], piece[Y]) + float(piece[SIZE])
    return float(ends)


def _nearest(piece: Array) -> float:
    """Smallest distance of a piece from the axis."""
    ends = float(np.hypot(*point_on(piece, np.array([0.0, 1.0])).T).min())
    if piece[KIND] == 0.0:
        foot = -(piece[X] * piece[C] + piece[Y] * piece[S])
        return abs(float(piece[X] * piece[S] - piece[Y] * piece[C])) if 0.0 <= foot <= piece[SIZE] else ends
    if _faces(piece, -piece[X], -piece[Y]):
        return abs(math.hypot(piece[X], piece[Y]) - float(piece[SIZE]))
    return ends


def _faces(arc: Array, x: float, y: float) -> bool:
    """Whether an arc has a point in the direction (x, y) from its centre; every arc has one in the direction 0."""
    return bool(x * arc[C] + y * arc[S] >= math.hypot(x, y) * math.cos(0.5 * arc[SPAN]) - 1e-12)
