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


RIM_PIECES, OUTER_PIECES, INNER_PIECES, WALLS, SIDES = range(5)
"""The outlines of a mate: the three curves, and the pieces of the hole and of the peg that the other can touch."""

RADIUS, CLEARANCE, DEPTH, INSIDE = 6, 7, 8, 9
"""Columns of a mate, after the centres of its tip in P and of its mouth in H (3 each): the outer radius of the peg, the
distance of the outlines of peg and hole, the depth of the floor below the mouth, and the smallest distances of the
three curves from their axis, m."""

BOX = 8
"""The first of the four columns of a piece that follow those of `models.section`: its smallest x and y, and its largest
x and y, m."""


class ContactLaw(NamedTuple):
    """The law of a contact; see `systems.plant.exact_contact`.

    Attributes:
        friction: coefficient mu.
        stiffness: k, N/m.
        dissipation: d, s/m.
    """

    friction: float
    stiffness: float
    dissipation: float


class Bodies(NamedTuple):
    """Peg and hole in few arrays, so that a compiled function takes them at once (m).

    The outlines are in the order of `RIM_PIECES`, ..., `SIDES`; each is that of the first mate, of the second, and so
    on. Outline g of mate i begins at entry g k + i of ``outlines``, and ends where the next one begins.

    Attributes:
        mates: (k, 12), see `RADIUS`.
        pieces: (n, 12), of all outlines.
        samples: (5, m), of the pieces of the curves: place, which is an angle (rad) on an arc, or the distance along a
            segment; two coordinates; and their derivatives by the place.
        ends: (e, 4), points at which segments of the curves end, twice, as a box.
        outlines: (5 k + 1,), numbers of pieces.
        first: number of the first sample of each piece of a curve, and m.
        corners: (3 k + 1,), number of the first of the ends of each curve, and e.
        most: largest number of samples of a piece.
        chamfer: width and height of the chamfer.
        law: of the contact.
    """

    mates: Array
    pieces: Array
    samples: Array
    ends: Array
    outlines: Numbers
    first: Numbers
    corners: Numbers
    most: int
    chamfer: float
    law: ContactLaw

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """Returns the bodies of a `models.scenario.Scenario`."""
        contact = scenario.contact
        law = ContactLaw(contact.friction, contact.stiffness, contact.dissipation)
        return cls.of_mates(scenario.geometry.assembly.mates)._replace(law=law)

    @classmethod
    def of_mates(cls, mates: Sequence[Mate]) -> Self:
        """Returns the bodies of mates, without a law of their contact."""
        curves = [
            *(mate.peg for mate in mates),
            *(mate.hole.offset(mate.chamfer) for mate in mates),
            *(mate.hole for mate in mates),
        ]
        touched = [
            *(surface_pieces(mate.hole, inside=True) for mate in mates),
            *(surface_pieces(mate.peg, inside=False) for mate in mates),
        ]
        outlines = [*map(curve_pieces, curves), *touched]
        samples = [samples_of(piece, len(outline)) for outline in outlines[: len(curves)] for piece in outline]
        ends = [ends_of(outline) for outline in outlines[: len(curves)]]
        inside = np.reshape([section.inner_radius for section in curves], (3, -1))
        sizes = [(mate.peg.outer_radius, mate.hole.inner_radius - mate.peg.inner_radius, mate.depth) for mate in mates]
        pieces = np.concatenate(outlines)
        return cls(
            mates=np.array(
                [
                    [*mate.tip, *mate.mouth, *size, *radii]
                    for mate, size, radii in zip(mates, sizes, inside.T, strict=True)
                ]
            ),
            pieces=np.hstack([pieces, boxes_of(pieces)]),
            samples=np.ascontiguousarray(np.vstack(samples).T),
            ends=np.concatenate([np.hstack([points, points]) for points in ends]),
            outlines=_starts(outlines),
            first=_starts(samples),
            corners=_starts(ends),
            most=max(map(len, samples)),
            chamfer=mates[0].chamfer,
            law=ContactLaw(0.0, 0.0, 0.0),
        )


def samples_of(piece: Array, pieces: int) -> Array:
    """Returns the samples (n, 5) of a piece, see `Bodies`, of an outline with so many pieces."""
    arcs = max(MIN_INTERVALS, math.ceil(SAMPLES * abs(piece[SPAN]) / (2.0 * math.pi) - 1e-9))
    count = arcs if piece[KIND] != 0.0 else 1  # along a segment a gap is convex, so that its ends suffice
    low = min(piece[START], piece[START] + piece[SPAN]) if piece[KIND] != 0.0 else 0.0
    spacing = (abs(piece[SPAN]) if piece[KIND] != 0.0 else piece[SIZE]) / count
    place = low + spacing * np.arange(count + 1)
    if piece[KIND] == 0.0:
        one = np.ones(count + 1)
        x, y = piece[X] + place * piece[C], piece[Y] + place * piece[S]
        return np.column_stack([place, x, y, piece[C] * one, piece[S] * one])
    cosine, sine = piece[SIZE] * np.cos(place), piece[SIZE] * np.sin(place)
    rows = np.column_stack([place, piece[X] + cosine, piece[Y] + sine, -sine, cosine])
    if pieces == 1:
        rows[-1, 1:] = rows[0, 1:]
    return rows


def ends_of(outline: Array) -> Array:
    """Returns the points (n, 2) at which the segments of an outline end, each once, m."""
    straight = [piece for piece in outline if piece[KIND] == 0.0]
    ends = np.array([point for piece in straight for point in point_on(piece, np.array([0.0, 1.0]))]).reshape(-1, 2)
    return ends[[k for k, point in enumerate(ends) if not (np.abs(ends[:k] - point).max(axis=1) < 1e-9).any()]]


def boxes_of(pieces: Array) -> Array:
    """Returns the smallest x and y and the largest x and y of pieces, (n, 4), m."""
    points = [point_on(piece, np.linspace(0.0, 1.0, 513)) for piece in pieces]
    return np.array([[*p.min(axis=0), *p.max(axis=0)] for p in points])


def _starts(parts: Sequence[Array]) -> Numbers:
    """Returns the number of the first row of each part, (k + 1,), when all are joined, and the number of all rows."""
    return np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
