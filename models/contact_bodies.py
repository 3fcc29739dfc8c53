"""What an exact peg and hole are: the pieces of their outlines, the curves along which they touch, and its names."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from models import Array
from models.labelled_enum import LabelledEnum
from models.section import KIND, SIZE, SPAN, START, C, S, Section, X, Y, point_on

Numbers = NDArray[np.int64]

BEYOND = 2e-5
"""Distance by which a side reaches beyond a sharp corner in which the other body lies, m; overlaps are smaller."""

SAMPLES = 48
"""Number of samples on a full circle; between two of them the slope of the gap changes its sign once."""

MIN_INTERVALS = 4
"""Least number of intervals between samples on an arc of a curve."""

FACE, CHAMFER, WALL, FLOOR, OUTER, INNER = range(6)
"""Numbers of what touches: the rim of the tip and a surface of the hole, or an edge of its chamfer and the peg."""


class ContactLabel(LabelledEnum):
    """Contact state determined from geometry alone; ``label`` is its display name.

    A tip on the floor is seated, whatever else touches. A tip that has not passed the chamfer is on the chamfer or on
    the face, whichever has the deeper overlap. Inside the bore, the inner edge of the chamfer is the mouth. Contact at
    both mouth and tip is two-point contact if they are on opposite sides of the bore, and line contact otherwise.
    """

    FREE = 0, "free"
    FACE = 1, "on the face"
    CHAMFER = 2, "on the chamfer"
    MOUTH = 3, "one point at the mouth"
    TIP = 4, "one point at the tip"
    TWO_POINT = 5, "two-point contact"
    LINE = 6, "line contact"
    SEATED = 7, "seated"


@dataclass(frozen=True)
class Mate:
    """A section of the peg, and one of the hole into which it goes or through which it passes.

    Attributes:
        peg: section of the peg, m.
        hole: that of the hole, which holds it, m.
        depth: of the floor below this mouth, m.
        chamfer: width and height of the 45 degree chamfer, m; 0 for a sharp edge.
        tip: (3,), centre of the section's tip in P, m.
        mouth: (3,), centre of the mouth in H, m.
        top: height in P at which a wider section of the same axis begins, or the peg ends, m.
        bottom: height in H at which a narrower hole of the same axis begins, or the floor, m.
    """

    peg: Section
    hole: Section
    depth: float
    chamfer: float
    tip: Array
    mouth: Array
    top: float
    bottom: float


def curve_pieces(section: Section) -> Array:
    """Returns the pieces of an outline that have a length, (n, 8)."""
    return section.pieces[section.pieces[:, SIZE] > 0.0]


def surface_pieces(section: Section, *, inside: bool) -> Array:
    """Returns the pieces that another body can touch, (n, 8).

    A sharp corner in which the other body lies is none; the segments beside it reach a little further.

    Args:
        section: Of peg or hole.
        inside: Whether the other body is inside the outline.
    """
    pieces = section.pieces.copy()
    hollow = (pieces[:, SIZE] == 0.0) & (pieces[:, KIND] == (1.0 if inside else -1.0))
    for k, piece in enumerate(pieces):
        before, after = BEYOND * hollow[k - 1], BEYOND * hollow[(k + 1) % len(pieces)]
        if piece[KIND] == 0.0:
            piece[X], piece[Y] = piece[X] - before * piece[C], piece[Y] - before * piece[S]
            piece[SIZE] += before + after
    return np.asarray(pieces[~hollow])


class Curve(NamedTuple):
    """Outlines along which contacts are sought, one of each mate, at samples of their pieces.

    Attributes:
        pieces: (n, 8) of `models.section`, m.
        mates: (k + 1,), number of the first piece of each outline, and n.
        places: samples, (m,): angle (rad) on an arc, or distance along a segment (m).
        x: first coordinate of the samples, m.
        y: second coordinate, m.
        t_x: first component of the derivative of the coordinates by the place.
        t_y: second component.
        first: (n + 1,), number of the first sample of each piece, and m.
        boxes: (n, 4), smallest and largest coordinates of the pieces, m.
        ends: (e, 4), likewise of the points at which segments end.
        mate_ends: (k + 1,), number of the first of these points of each outline, and e.
        inner: (k,), smallest distance of each outline from its axis, m.
    """

    pieces: Array
    mates: Numbers
    places: Array
    x: Array
    y: Array
    t_x: Array
    t_y: Array
    first: Numbers
    boxes: Array
    ends: Array
    mate_ends: Numbers
    inner: Array

    @classmethod
    def of(cls, sections: Sequence[Section]) -> Self:
        """Returns the outlines of sections."""
        curves = [cls._of_one(section) for section in sections]
        joined = {name: np.concatenate([getattr(curve, name) for curve in curves]) for name in cls._fields}
        return cls(**joined)._replace(
            mates=_starts([curve.pieces for curve in curves]),
            first=np.concatenate([[0], np.cumsum(np.concatenate([np.diff(curve.first) for curve in curves]))]),
            mate_ends=_starts([curve.ends for curve in curves]),
        )

    @classmethod
    def _of_one(cls, section: Section) -> Self:
        pieces, samples, first = curve_pieces(section), [], [0]
        for piece in pieces:
            arcs = max(MIN_INTERVALS, math.ceil(SAMPLES * abs(piece[SPAN]) / (2.0 * math.pi) - 1e-9))
            count = arcs if piece[KIND] != 0.0 else 1  # along a segment a gap is convex, so that its ends suffice
            low = min(piece[START], piece[START] + piece[SPAN]) if piece[KIND] != 0.0 else 0.0
            spacing = (abs(piece[SPAN]) if piece[KIND] != 0.0 else piece[SIZE]) / count
            place = low + spacing * np.arange(count + 1)
            if piece[KIND] == 0.0:
                one = np.ones(count + 1)
                x, y = piece[X] + place * piece[C], piece[Y] + place * piece[S]
                rows = np.column_stack([place, x, y, piece[C] * one, piece[S] * one])
            else:
                cosine, sine = piece[SIZE] * np.cos(place), piece[SIZE] * np.sin(place)
                rows = np.column_stack([place, piece[X] + cosine, piece[Y] + sine, -sine, cosine])
                if len(pieces) == 1:
                    rows[-1, 1:] = rows[0, 1:]
            samples.append(rows)
            first.append(first[-1] + len(rows))
        straight = [piece for piece in pieces if piece[KIND] == 0.0]
        ends = np.array([point for piece in straight for point in point_on(piece, np.array([0.0, 1.0]))]).reshape(-1, 2)
        new = [k for k, point in enumerate(ends) if not (np.abs(ends[:k] - point).max(axis=1) < 1e-9).any()]
        places, x, y, t_x, t_y = np.ascontiguousarray(np.vstack(samples).T)
        return cls(
            pieces=pieces,
            mates=np.array([0, len(pieces)]),
            places=places,
            x=x,
            y=y,
            t_x=t_x,
            t_y=t_y,
            first=np.array(first, dtype=np.int64),
            boxes=boxes_of(pieces),
            ends=np.hstack([ends[new], ends[new]]),
            mate_ends=np.array([0, len(new)]),
            inner=np.array([section.inner_radius]),
        )


def _starts(parts: Sequence[Array]) -> Numbers:
    """Returns the number of the first row of each part, (k + 1,), when all are joined, and the number of all rows."""
    return np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)


def boxes_of(pieces: Array) -> Array:
    """Returns the smallest x and y and the largest x and y of pieces, (n, 4), m."""
    points = [point_on(piece, np.linspace(0.0, 1.0, 513)) for piece in pieces]
    return np.array([[*p.min(axis=0), *p.max(axis=0)] for p in points])


class Bodies(NamedTuple):
    """Outlines of peg and hole (m) of each mate (`models.assembly`), and the law of their contact.

    Attributes:
        tips: (k, 3), centre of each mate's tip in P.
        mouths: (k, 3), centre of its mouth in H.
        rim: of the tips.
        outer: outer edges of the chamfers.
        inner: inner edges of the chamfers.
        walls: (n, 8), pieces of the holes that the peg can touch.
        sides: (m, 8), pieces of the peg that the holes can touch.
        mate_walls: (k + 1,), number of the first of the walls of each mate, and n.
        mate_sides: (k + 1,), likewise.
        wall_boxes: (n, 4), as those of `Curve`.
        side_boxes: (m, 4), likewise.
        r: (k,), outer radius of the peg.
        clearance: (k,), distance of the outlines of peg and hole.
        depth: (k,), of the floor below the mouth.
        chamfer: width and height of the chamfer.
        friction: coefficient mu.
        stiffness: k of a contact, N/m.
        dissipation: d, s/m.
    """

    tips: Array
    mouths: Array
    rim: Curve
    outer: Curve
    inner: Curve
    walls: Array
    sides: Array
    mate_walls: Numbers
    mate_sides: Numbers
    wall_boxes: Array
    side_boxes: Array
    r: Array
    clearance: Array
    depth: Array
    chamfer: float
    friction: float
    stiffness: float
    dissipation: float

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """Returns the bodies of a `models.scenario.Scenario`."""
        contact = scenario.contact
        return cls.of_mates(scenario.geometry.assembly.mates)._replace(
            friction=contact.friction, stiffness=contact.stiffness, dissipation=contact.dissipation
        )

    @classmethod
    def of_mates(cls, mates: Sequence[Mate]) -> Self:
        """Returns the bodies of mates, without a law of their contact."""
        holes, pegs = [mate.hole for mate in mates], [mate.peg for mate in mates]
        walls = [surface_pieces(hole, inside=True) for hole in holes]
        sides = [surface_pieces(peg, inside=False) for peg in pegs]
        return cls(
            tips=np.array([mate.tip for mate in mates]),
            mouths=np.array([mate.mouth for mate in mates]),
            rim=Curve.of(pegs),
            outer=Curve.of([mate.hole.offset(mate.chamfer) for mate in mates]),
            inner=Curve.of(holes),
            walls=np.concatenate(walls),
            sides=np.concatenate(sides),
            mate_walls=_starts(walls),
            mate_sides=_starts(sides),
            wall_boxes=boxes_of(np.concatenate(walls)),
            side_boxes=boxes_of(np.concatenate(sides)),
            r=np.array([peg.outer_radius for peg in pegs]),
            clearance=np.array([hole.inner_radius - peg.inner_radius for hole, peg in zip(holes, pegs, strict=True)]),
            depth=np.array([mate.depth for mate in mates]),
            chamfer=mates[0].chamfer,
            friction=0.0,
            stiffness=0.0,
            dissipation=0.0,
        )
