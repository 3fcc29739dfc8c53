"""Where a rigid peg and a rigid hole touch or nearly do, compiled.

The contacts are the local minima of the gap on the three curves of `models.exact_geometry`, and the ends of straight
pieces, on which a side lies flat.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from compiled import compiled
from models import Array
from models.exact_geometry import (
    FACE,
    FAR,
    FLOOR,
    INNER,
    OUTER,
    TINY,
    WALL,
    Mate,
    curve_pieces,
    edge_gap,
    is_nearest,
    planar_gap,
    rim_gap,
    surface_pieces,
)
from models.section import KIND, SIZE, SPAN, START, C, S, Section, X, Y, point_on

Numbers = NDArray[np.int64]

MAX_CONTACTS = 32

REACH = 2e-5
"""Largest gap of a contact that is given to the solver, m; in a step of 0.25 ms bodies close it at 80 mm/s."""

SAMPLES = 48
"""Number of samples on a full circle; between two of them the slope of the gap changes its sign once."""

MIN_INTERVALS = 4
"""Least number of intervals between samples on an arc of a curve."""

DIP = REACH
"""By how much a gap is lower between two samples than at the nearer one, at most, m."""

MAX_SEARCH = 60
FLAT, NARROW, SHALLOW = 1e-10, 2e-3, 1e-14
"""The search for a minimum ends after so many gaps, where the slope (m/rad) is zero, or, between angles (rad) that are
near to each other, at the lower bound (m) that their tangents give."""

SAME_PLACE, SAME_NORMAL = 1e-4, 0.999
"""Distance (m) and cosine of the normals up to which two minima on a curve are one contact."""

CROSSING = 1e-4
"""Largest distance between the minima on the rim and on an edge where these cross, m."""

RIM = FACE
"""The rim as a curve; the curves have the number of the first surface that touches there."""

GAP, POINT, NORMAL, SURFACE, OUT, BESIDE, COLUMNS = 0, slice(1, 4), slice(4, 7), 7, slice(8, 10), 10, 11
"""Columns of a contact: gap (m), point on the hole and normal in H, surface, and the outward normal of its curve, in P
on the rim and in H on an edge, or zero at the end of a segment; 1 where an edge touches the side of the peg, and not
its tip; and their number."""

FREE, ON_FACE, ON_CHAMFER, AT_MOUTH, AT_TIP, TWO_POINT, LINE, SEATED = range(8)
"""Numbers of the members of `ContactLabel`."""


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


@compiled
def row_of(pieces: Array, k: int) -> tuple[float, float, float, float, float, float, float, float]:
    """Returns a piece as a tuple, whose values a loop need not read again."""
    p = pieces[k]
    return p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]


@compiled
def height_of(chamfer: float, circle: int) -> float:
    """Returns the height of an edge of the hole, m."""
    return 0.0 if circle == OUTER else -chamfer


@compiled
def on_curve(
    chamfer: float, circle: int, piece: Any, surface: Any, place: float, p: Array, u: Array, v: Array
) -> tuple[Any, ...]:
    """Returns a gap on a piece of a curve to a piece of the other body.

    Returns:
        The gap (m), its slope over the place (m/rad, or m/m), point on the hole (3), normal (3) and surface; all in H.
        Then the outward normal of the curve (2), whether an edge is beside the peg, and the coordinates of the point in
        the plane of the other outline.
    """
    if piece[KIND] == 0.0:
        c, s, r = piece[S], -piece[C], 0.0
        x_c, y_c, t_x, t_y = piece[X] + place * piece[C], piece[Y] + place * piece[S], piece[C], piece[S]
    else:
        c, s, r = math.cos(place), math.sin(place), piece[SIZE]
        x_c, y_c, t_x, t_y = piece[X], piece[Y], -s, c
    if circle == RIM:
        x = p[0] + r * (c * u[0] + s * v[0]) + (x_c * u[0] + y_c * v[0])
        y = p[1] + r * (c * u[1] + s * v[1]) + (x_c * u[1] + y_c * v[1])
        z = p[2] + r * (c * u[2] + s * v[2]) + (x_c * u[2] + y_c * v[2])
        outside, r_x, r_y, size = planar_gap(surface, x, y)
        gap, n_x, n_y, n_z, kind = rim_gap(chamfer, outside, r_x, r_y, size, z)
        along_u, along_v = n_x * u[0] + n_y * u[1] + n_z * u[2], n_x * v[0] + n_y * v[1] + n_z * v[2]
        slope = t_y * along_v + t_x * along_u
        at_x, at_y, beside = x, y, False
        x, y, z = x - gap * n_x, y - gap * n_y, z - gap * n_z
    else:
        x, y, z = x_c + r * c, y_c + r * s, height_of(chamfer, circle)
        d_x, d_y, d_z = x - p[0], y - p[1], z - p[2]
        gap, n_x, n_y, n_z, beside = edge_gap(surface, d_x, d_y, d_z, u[0], u[1], u[2], v[0], v[1], v[2])
        slope = -t_x * n_x - t_y * n_y
        at_x, at_y = d_x * u[0] + d_y * u[1] + d_z * u[2], d_x * v[0] + d_y * v[1] + d_z * v[2]
        kind = circle
    if r > 0.0:
        slope *= r
    sign = -1.0 if piece[KIND] < 0.0 else 1.0
    return gap, slope, x, y, z, n_x, n_y, n_z, kind, sign * c, sign * s, beside, at_x, at_y


@compiled
def sample_gaps(
    chamfer: float,
    circle: int,
    other: Any,
    x: Array,
    y: Array,
    t_x: Array,
    t_y: Array,
    p: Array,
    u: Array,
    v: Array,
    gaps: Array,
    slopes: Array,
) -> None:
    """Computes the gaps of some samples of a curve to a piece of the other body, and their slopes over the place."""
    p_x, p_y, p_z = p[0], p[1], p[2]
    u_x, u_y, u_z, v_x, v_y, v_z = u[0], u[1], u[2], v[0], v[1], v[2]
    if circle == RIM:
        for k in range(len(x)):
            q_x, q_y, q_z = p_x + x[k] * u_x + y[k] * v_x, p_y + x[k] * u_y + y[k] * v_y, p_z + x[k] * u_z + y[k] * v_z
            outside, r_x, r_y, size = planar_gap(other, q_x, q_y)
            gap, n_x, n_y, n_z, _ = rim_gap(chamfer, outside, r_x, r_y, size, q_z)
            gaps[k] = gap
            slopes[k] = t_y[k] * (n_x * v_x + n_y * v_y + n_z * v_z) + t_x[k] * (n_x * u_x + n_y * u_y + n_z * u_z)
    else:
        d_z = height_of(chamfer, circle) - p_z
        for k in range(len(x)):
            gap, n_x, n_y, _, _ = edge_gap(other, x[k] - p_x, y[k] - p_y, d_z, u_x, u_y, u_z, v_x, v_y, v_z)
            gaps[k], slopes[k] = gap, -t_x[k] * n_x - t_y[k] * n_y


@compiled
def lowest_place(
    chamfer: float,
    circle: int,
    piece: Any,
    surface: Any,
    low: float,
    high: float,
    g_low: float,
    g_high: float,
    falling: float,
    rising: float,
    p: Array,
    u: Array,
    v: Array,
) -> float:
    """Returns where the gap has a minimum between two places.

    It is sought where a line through the slopes is zero, as it is on a smooth stretch, and where the tangents meet, as
    at a corner of the hole, where the slope jumps.

    Args:
        chamfer: m.
        circle: on which the minimum is.
        piece: of the curve.
        surface: piece of the other body.
        low: place on the piece, rad or m.
        high: a further place.
        g_low: gap at the first place, m.
        g_high: gap at the second place, m.
        falling: slope at the first place, at most 0.
        rising: slope at the second place, above 0.
        p: see `find_contacts`.
        u: likewise.
        v: likewise.
    """
    place = low
    for k in range(MAX_SEARCH):
        share, width = falling / (falling - rising), high - low
        meet = (g_high - g_low - rising * width) / ((falling - rising) * width)
        if k % 3 > 0:
            share = meet if k % 3 == 1 and 0.0 < meet < 1.0 else 0.5
        place = low + share * width
        g, slope = on_curve(chamfer, circle, piece, surface, place, p, u, v)[:2]
        if abs(slope) < FLAT or (width < NARROW and 0.0 < meet < 1.0 and g - g_low - falling * meet * width < SHALLOW):
            break
        if slope > 0.0:
            high, g_high, rising = place, g, slope
        else:
            low, g_low, falling = place, g, slope
    return place


@compiled
def find_minima(bodies: Bodies, mate: int, p: Array, u: Array, v: Array, reach: float, found: Array) -> int:
    """Finds the minima of the gap that are below ``reach``, on the rim and on both edges, and the points on the floor.

    Args:
        bodies: see `find_contacts`.
        mate: number of the mate.
        p: see `find_contacts`.
        u: see `find_contacts`.
        v: likewise.
        reach: m.
        found: (MAX_CONTACTS, COLUMNS), receives the minima, their points from the centre of the mate's mouth.

    Returns:
        The number of minima.
    """
    p, count = tip_in_mouth(bodies, mate, p, u, v), 0
    r = bodies.r[mate]
    lowest = p[2] - r * math.hypot(u[2], v[2])
    if lowest > reach:
        return count
    chamfer, a_z = bodies.chamfer, u[0] * v[1] - u[1] * v[0]
    # By as much as the peg is off the axis, tilted and turned, it can touch a piece beside its own.
    turn = abs(u[1]) + abs(v[0]) + abs(u[2]) + abs(v[2]) + (1.0 - u[0]) + (1.0 - v[1])
    near = math.hypot(p[0], p[1]) + abs(p[2]) * (abs(u[2]) + abs(v[2])) + r * turn + chamfer + 5.0 * reach
    # By as much the outline of a tilted and turned peg, cut by a plane across the hole, can be outside of itself.
    swept = r * (abs(u[1]) + abs(v[0]) + (1.0 - u[0]) + (1.0 - v[1]) + (1.0 / a_z - 1.0))
    for circle in (RIM, OUTER, INNER):
        curve = bodies.rim if circle == RIM else bodies.outer if circle == OUTER else bodies.inner
        starts = bodies.mate_walls if circle == RIM else bodies.mate_sides
        others = (bodies.walls if circle == RIM else bodies.sides)[starts[mate] : starts[mate + 1]]
        boxes = (bodies.wall_boxes if circle == RIM else bodies.side_boxes)[starts[mate] : starts[mate + 1]]
        first = count
        # No gap on the curve is below a bound that takes no samples.
        if circle == RIM:
            if bodies.inner.inner[mate] - math.hypot(p[0], p[1]) - r > reach:
                continue
        else:
            a_x, a_y = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2]
            height = height_of(chamfer, circle)
            up = (height - p[2]) / a_z
            off = math.hypot(p[0] + up * a_x, p[1] + up * a_y)
            apart_by = bodies.clearance[mate] + (chamfer if circle == OUTER else 0.0)
            if max(lowest - height, a_z * (curve.inner[mate] - off) - r, a_z * (apart_by - off) - swept) > reach:
                continue
        for j in range(curve.mates[mate], curve.mates[mate + 1]):
            piece = row_of(curve.pieces, j)
            begin, end = curve.first[j], curve.first[j + 1]
            places, x, y = curve.places[begin:end], curve.x[begin:end], curve.y[begin:end]
            t_x, t_y = curve.t_x[begin:end], curve.t_y[begin:end]
            for k in range(len(others)):
                if apart(curve.boxes[j], boxes[k]) <= near:
                    count = add_minima(
                        chamfer, circle, piece, places, x, y, t_x, t_y, others, k, p, u, v, reach, found, first, count
                    )
        for j in range(curve.mate_ends[mate], curve.mate_ends[mate + 1]):
            end_x, end_y = curve.ends[j, 0], curve.ends[j, 1]
            for k in range(len(others)):
                if apart(curve.ends[j], boxes[k]) <= near:
                    count = add_end(chamfer, circle, end_x, end_y, others, k, p, u, v, reach, found, first, count)
    depth, rim = bodies.depth[mate], bodies.rim
    if lowest + depth < reach:
        count = add_floor_points(rim.pieces[rim.mates[mate] : rim.mates[mate + 1]], depth, p, u, v, reach, found, count)
    return count


@compiled
def apart(box: Array, other: Array) -> float:
    """Returns by how much two boxes are apart in one direction, m; negative if they overlap."""
    across, along = max(box[0] - other[2], other[0] - box[2]), max(box[1] - other[3], other[1] - box[3])
    return float(max(across, along))


@compiled
def add_minima(
    chamfer: float,
    circle: int,
    piece: Any,
    places: Array,
    x: Array,
    y: Array,
    t_x: Array,
    t_y: Array,
    others: Array,
    o: int,
    p: Array,
    u: Array,
    v: Array,
    reach: float,
    found: Array,
    first: int,
    count: int,
) -> int:
    """Adds the minima of a piece of a curve and piece ``o`` of the other body, see `find_minima`; returns the count."""
    other, n = row_of(others, o), len(x)
    gaps, slopes = np.empty(n), np.empty(n)
    sample_gaps(chamfer, circle, other, x, y, t_x, t_y, p, u, v, gaps, slopes)
    for k in range(n - 1):
        falling, rising = slopes[k], slopes[k + 1]
        if falling > 0.0 or rising <= 0.0:
            continue
        if piece[KIND] == 0.0:  # along a line a gap is convex, and above its tangents
            meet = (gaps[k + 1] - gaps[k] - rising * (places[k + 1] - places[k])) / (falling - rising)
            if gaps[k] + falling * meet > reach:
                continue
        elif min(gaps[k], gaps[k + 1]) > reach + DIP:
            continue
        t = lowest_place(
            chamfer, circle, piece, other, places[k], places[k + 1], gaps[k], gaps[k + 1], falling, rising, p, u, v
        )
        count = add_contact(on_curve(chamfer, circle, piece, other, t, p, u, v), others, o, reach, found, first, count)
    return count


@compiled
def add_end(
    chamfer: float,
    circle: int,
    x: float,
    y: float,
    others: Array,
    o: int,
    p: Array,
    u: Array,
    v: Array,
    reach: float,
    found: Array,
    first: int,
    count: int,
) -> int:
    """Adds the end of a segment of a curve, if it is near piece ``o`` of the other body; returns the count."""
    still = (0.0, x, y, 1.0, 0.0, 0.0, 0.0, 0.0)  # a segment without a length
    contact = on_curve(chamfer, circle, still, row_of(others, o), 0.0, p, u, v)
    gap, slope, x, y, z, n_x, n_y, n_z, kind, _, _, beside, at_x, at_y = contact
    end = (gap, slope, x, y, z, n_x, n_y, n_z, kind, 0.0, 0.0, beside, at_x, at_y)
    return add_contact(end, others, o, reach, found, first, count)


@compiled
def add_contact(contact: Any, others: Array, o: int, reach: float, found: Array, first: int, count: int) -> int:
    """Adds a contact of `on_curve` if it is near, and piece ``o`` the nearest one; returns the count.

    Of two contacts at one place on a curve, such as the end of a segment and the arc beside it, the deeper one stays.
    Those of this curve begin at ``first``.
    """
    gap, _, x, y, z, n_x, n_y, n_z, kind, c, s, beside, at_x, at_y = contact
    if not (gap < reach and is_nearest(others, o, at_x, at_y)):
        return count
    place = count
    for i in range(first, count):
        row = found[i]
        away = (row[1] - x) ** 2 + (row[2] - y) ** 2 + (row[3] - z) ** 2
        if away < SAME_PLACE**2 and row[4] * n_x + row[5] * n_y + row[6] * n_z > SAME_NORMAL:
            place = i
            break
    if place == MAX_CONTACTS - 3 or (place < count and found[place, GAP] <= gap):
        return count
    row = found[place]
    row[0], row[1], row[2], row[3] = gap, x, y, z
    row[4], row[5], row[6], row[7], row[8], row[9], row[10] = n_x, n_y, n_z, kind, c, s, beside
    return max(count, place + 1)


@compiled
def add_floor_points(
    rim: Array, depth: float, p: Array, u: Array, v: Array, reach: float, found: Array, count: int
) -> int:
    """Adds the points of the tip that are on the floor: the furthest downhill, and at 120 degrees to both sides."""
    first = math.atan2(-v[2], -u[2])
    for k in range(3):
        t = first + 2.0 * np.pi * k / 3.0
        c, s = math.cos(t), math.sin(t)
        x, y, r = furthest(rim, c, s)
        row = found[count]
        row[:] = 0.0
        for i in range(3):
            row[1 + i] = p[i] + r * (c * u[i] + s * v[i]) + (x * u[i] + y * v[i])
        gap = row[3] + depth
        if gap < reach:
            row[0], row[3], row[6], row[7], row[8], row[9] = gap, -depth, 1.0, FLOOR, c, s
            count += 1
    return count


@compiled
def furthest(pieces: Array, c: float, s: float) -> tuple[float, float, float]:
    """Returns the point of an outline that is furthest in a direction (c, s): a point, and how far beyond it it is."""
    best, found_x, found_y, found_r = -np.inf, 0.0, 0.0, 0.0
    for k in range(len(pieces)):
        piece = pieces[k]
        x, y, r = piece[X], piece[Y], 0.0
        if piece[KIND] != 0.0:
            r = piece[SIZE]
            if piece[KIND] < 0.0 or c * piece[C] + s * piece[S] < math.cos(0.5 * piece[SPAN]):
                x, y, r = x + r * math.cos(piece[START]), y + r * math.sin(piece[START]), 0.0
        along = x * c + y * s + r
        if along > best:
            best, found_x, found_y, found_r = along, x, y, r
    return found_x, found_y, found_r


@compiled
def crossing(
    circle: int, rim_out: Array, edge_out: Array, u: Array, v: Array, normal: Array
) -> tuple[bool, float, float, float]:
    """Returns whether the rim and an edge can touch where they cross, and the normal of this contact.

    It is perpendicular to both, and lies between the normals of the surfaces that meet at each of them.

    Args:
        circle: of the edge.
        rim_out: (2,), outward normal of the rim at its place, in P.
        edge_out: (2,), outward normal of the edge at its place, in H.
        u: see `find_contacts`.
        v: likewise.
        normal: (3,), that of the nearest surface, for the sign.
    """
    c, s, c_e, s_e = rim_out[0], rim_out[1], edge_out[0], edge_out[1]
    t_x, t_y, t_z = c * v[0] - s * u[0], c * v[1] - s * u[1], c * v[2] - s * u[2]  # along the rim
    x, y, z = -t_z * c_e, -t_z * s_e, t_x * c_e + t_y * s_e  # the edge is along (-s_e, c_e, 0)
    size = math.copysign(max(TINY, math.sqrt(x * x + y * y + z * z)), x * normal[0] + y * normal[1] + z * normal[2])
    x, y, z = x / size, y / size, z / size
    inwards = -(x * c_e + y * s_e)
    outwards = x * (c * u[0] + s * v[0]) + y * (c * u[1] + s * v[1]) + z * (c * u[2] + s * v[2])
    along = x * (u[1] * v[2] - u[2] * v[1]) + y * (u[2] * v[0] - u[0] * v[2]) + z * (u[0] * v[1] - u[1] * v[0])
    within = min(inwards, z - inwards) if circle == OUTER else min(z, inwards - z)
    return min(within, along, -outwards) > -1e-9, x, y, z


@compiled
def tip_in_mouth(bodies: Bodies, mate: int, p: Array, u: Array, v: Array) -> Array:
    """Returns the centre of a mate's tip from the centre of its mouth, in H, (3,), m; see `find_contacts`."""
    tip, mouth, found = bodies.tips[mate], bodies.mouths[mate], np.empty(3)
    axis = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    for i in range(3):
        found[i] = p[i] + (tip[0] * u[i] + tip[1] * v[i] + tip[2] * axis[i]) - mouth[i]
    return found


@compiled
def deepest_overlap(bodies: Bodies, p: Array, u: Array, v: Array) -> float:
    """Returns the deepest overlap of a pose, m, or 0; see `find_contacts`."""
    found, deepest = np.empty((MAX_CONTACTS, COLUMNS)), 0.0
    for mate in range(len(bodies.tips)):
        for i in range(find_minima(bodies, mate, p, u, v, REACH, found)):
            deepest = max(deepest, -found[i, GAP])
    return deepest


@compiled
def find_contacts(
    bodies: Bodies, p: Array, u: Array, v: Array, gap: Array, point: Array, normal: Array, surface: Numbers
) -> int:
    """Finds the contacts of a pose whose gap is below `REACH`.

    They are the minima of the gap on the three curves, and the ends of their straight pieces. Where the rim crosses an
    edge of the hole, there is a minimum on both; these become one contact, the normal of which is perpendicular to both
    curves. While the bodies do not overlap, it is that of the minima; where they do, the nearest surface is one of
    those beside the edge.

    Args:
        bodies: `Bodies`.
        p: (3,), centre of the tip in H, m.
        u: (3,), unit vector across the peg in H.
        v: (3,), another one; u x v is the axis away from the tip.
        gap: (MAX_CONTACTS,), receives the gaps, m.
        point: (MAX_CONTACTS, 3), receives the points on the bore in H, m.
        normal: (MAX_CONTACTS, 3), receives the directions in H in which the bore pushes the peg.
        surface: (MAX_CONTACTS,), receives the surfaces.

    Returns:
        The number of contacts.
    """
    found, out, count = np.empty((MAX_CONTACTS, COLUMNS)), np.empty((MAX_CONTACTS, 2)), 0
    for mate in range(len(bodies.tips)):
        mouth = bodies.mouths[mate]
        first = count
        number = find_minima(bodies, mate, p, u, v, REACH, found)
        for e in range(number):
            row, kind, crosses = found[e], int(found[e, SURFACE]), False
            if kind >= OUTER and (row[8] != 0.0 or row[9] != 0.0):
                for i in range(first, count):
                    # No minimum on the rim, or one that crosses another edge, or the end of a segment.
                    if surface[i] >= FLOOR or (out[i, 0] == 0.0 and out[i, 1] == 0.0):
                        continue
                    d_x, d_y, d_z = point[i, 0] - row[1], point[i, 1] - row[2], point[i, 2] - row[3]
                    if d_x * d_x + d_y * d_y + d_z * d_z > CROSSING**2:
                        continue
                    crosses, x, y, z = crossing(kind, out[i], row[OUT], u, v, normal[i])
                    if crosses:
                        aligned = normal[i, 0] * x + normal[i, 1] * y + normal[i, 2] * z
                        gap[i], surface[i] = d_x * x + d_y * y + d_z * z + gap[i] * aligned, kind
                        point[i] = row[POINT]
                        normal[i, 0], normal[i, 1], normal[i, 2] = x, y, z
                        break
            if not crosses and count < MAX_CONTACTS:
                gap[count], surface[count], out[count] = row[GAP], kind, row[OUT]
                point[count], normal[count] = row[POINT], row[NORMAL]
                count += 1
        for i in range(first, count):
            for j in range(3):
                point[i, j] += mouth[j]
    return count


@compiled
def lowest_gaps(bodies: Bodies, p_HP: Array, R_HP: Array) -> Array:
    """Returns the signed gaps (n,), m: the distance between peg and block, or minus their deepest overlap.

    Args:
        bodies: `Bodies`.
        p_HP: (n, 3), centres of the tip, m.
        R_HP: (n, 3, 3), rotations; the peg's axis is less than 45 degrees from z of H.
    """
    found, lowest = np.empty((MAX_CONTACTS, COLUMNS)), np.full(len(p_HP), FAR)
    for k in range(len(p_HP)):
        u, v, reach = R_HP[k, :, 0].copy(), R_HP[k, :, 1].copy(), REACH
        while lowest[k] == FAR and reach < FAR:
            for mate in range(len(bodies.tips)):
                for i in range(find_minima(bodies, mate, p_HP[k], u, v, reach, found)):
                    lowest[k] = min(lowest[k], found[i, GAP])
            reach *= 4.0
    return lowest


@compiled
def contact_labels(bodies: Bodies, p_HP: Array, R_HP: Array, tolerance: float) -> Numbers:
    """Returns the numbers (n,) of the `ContactLabel` of poses, see `lowest_gaps`.

    Args:
        bodies: `Bodies`.
        p_HP: (n, 3), m.
        R_HP: (n, 3, 3).
        tolerance: largest gap that counts as contact, m, below `REACH`.
    """
    found, labels = np.empty((MAX_CONTACTS, COLUMNS)), np.empty(len(p_HP), np.int64)
    touching = np.empty((MAX_CONTACTS * len(bodies.tips), COLUMNS))
    for k in range(len(p_HP)):
        u, v, count = R_HP[k, :, 0].copy(), R_HP[k, :, 1].copy(), 0
        for mate in range(len(bodies.tips)):
            for i in range(find_minima(bodies, mate, p_HP[k], u, v, REACH, found)):
                if found[i, GAP] <= tolerance:
                    touching[count] = found[i]
                    count += 1
        labels[k] = label_of(touching[:count])
    return labels


@compiled
def label_of(contacts: Array) -> int:
    """Returns the number of the `ContactLabel` of a pose with these contacts (n, COLUMNS)."""
    face, chamfer = FAR, FAR
    mouth = tip = both = opposite = False
    for i in range(len(contacts)):
        row, kind, beside = contacts[i], contacts[i, SURFACE], contacts[i, BESIDE] == 1.0
        if kind == FLOOR:
            return SEATED
        if kind == FACE or (kind == OUTER and not beside):
            face = min(face, row[GAP])
        elif kind == WALL:
            tip = True
        elif kind == INNER and beside:
            mouth = True
            for j in range(len(contacts)):
                if contacts[j, SURFACE] == WALL:
                    both = True
                    opposite = opposite or row[4] * contacts[j, 4] + row[5] * contacts[j, 5] < 0.0
        else:
            chamfer = min(chamfer, row[GAP])
    if min(face, chamfer) < FAR:
        return ON_FACE if face <= chamfer else ON_CHAMFER
    if both:
        return TWO_POINT if opposite else LINE
    return AT_MOUTH if mouth else AT_TIP if tip else FREE
