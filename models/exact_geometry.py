"""Exact contact geometry of a flat-ended prismatic peg and a chamfered blind hole.

How far a point of one body is from a piece of the other, in closed form, and where that is least, compiled. There are
no meshes and no simulation, so that this also is the reference for simulated contact and for learnt contact states.

Along each generatrix of the peg, the distance to each side of the hole is a concave function, so its minimum is at an
end. The closest points of the two bodies, or their deepest overlap, therefore lie on one of three curves: the rim of
the peg's tip (against the surfaces of the hole), or the outer or inner edge of the chamfer (against the peg). For each
piece of a curve and each piece of the other outline (`models.section`), the distance is a closed-form function of one
number. The contacts are its minima, and the ends of straight pieces, on which a side lies flat. This holds for tilts
below 45 degrees, where the peg's side cannot lie flat on the chamfer.

Frames: H has its origin at the centre of the mouth and z out of the hole. P has its origin at the centre of the tip
face and z along the peg, away from the tip. The top face of the block is unbounded and the peg is infinitely long.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from compiled import compiled, compiled_within
from models import Array
from models.contact_bodies import (
    BEYOND,
    BOX,
    CLEARANCE,
    DEPTH,
    FACE,
    FLOOR,
    INNER,
    INNER_PIECES,
    INSIDE,
    OUTER,
    OUTER_PIECES,
    RADIUS,
    RIM_PIECES,
    SIDES,
    WALL,
    WALLS,
    Bodies,
    Numbers,
)
from models.section import KIND, SIZE, SPAN, START, C, S, X, Y

FAR = 1e3
"""Larger than any distance, m."""

TINY = 1e-300
"""Minimum of a denominator, so that 0/0 gives 0."""

MAX_CONTACTS = 32

REACH = 2e-5
"""Largest gap of a contact that is given to the solver, m; in a step of 0.25 ms bodies close it at 80 mm/s."""

DIP = REACH
"""By how much a gap is lower between two samples than at the nearer one, at most, m."""

MARGIN, ROUND_OFF = 1e-4, 1e-12
"""A surface is the nearest one if a curve overlaps it by less, and is further from the others (m); and the largest
round-off of a multiple of a slope."""

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

CONTACTS = 2 * MAX_CONTACTS, COLUMNS
"""Shape of the array that receives contacts; the second half is for the search."""

Pose = tuple[float, float, float, float, float, float, float, float, float]
"""The centre of the tip in H, m, and two unit vectors across the peg; their product is the axis, away from the tip."""

FREE, ON_FACE, ON_CHAMFER, AT_MOUTH, AT_TIP, TWO_POINT, LINE, SEATED = range(8)
"""Numbers of the members of `ContactLabel`."""


@compiled
def row_of(pieces: Array, k: int) -> tuple[float, float, float, float, float, float, float, float]:
    """Returns a piece as a tuple, whose values a loop need not read again."""
    p = pieces[k]
    return p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]


@compiled_within
def planar_gap(piece: Any, x: Any, y: Any) -> tuple[Any, ...]:
    """Returns how far points are outside of an outline beside one of its pieces.

    Args:
        piece: Of the outline, see `models.section`.
        x: First coordinate of the points, m.
        y: Second coordinate, m.

    Returns:
        Distance to the outline, m, negative inside; two components of a vector along its outward normal; and the length
        of this vector.
    """
    d_x, d_y = x - piece[X], y - piece[Y]
    if piece[KIND] == 0.0:
        one = 1.0 + 0.0 * d_x
        return d_x * piece[S] - d_y * piece[C], piece[S] * one, -piece[C] * one, one
    off = np.sqrt(d_x * d_x + d_y * d_y)
    return piece[KIND] * (off - piece[SIZE]), piece[KIND] * d_x, piece[KIND] * d_y, off


@compiled_within
def is_beside(piece: Any, x: Any, y: Any) -> Any:
    """Returns whether a piece is the nearest part of its outline around it to points; see `planar_gap`."""
    d_x, d_y = x - piece[X], y - piece[Y]
    along = d_x * piece[C] + d_y * piece[S]
    if piece[KIND] == 0.0:
        return (along >= 0.0) & (along <= piece[SIZE])
    return along >= np.sqrt(d_x * d_x + d_y * d_y) * math.cos(0.5 * piece[SPAN])


@compiled
def is_nearest(pieces: Array, begin: int, end: int, k: int, x: Any, y: Any) -> Any:
    """Returns whether piece ``k`` of the outline of the pieces from ``begin`` is as near to points as any, or almost.

    A point in a sharp corner is near to both of its sides. See `planar_gap`.
    """
    own = least = FAR + 0.0 * x
    for i in range(begin, end):
        piece = row_of(pieces, i)
        away = np.abs(planar_gap(piece, x, y)[0]) + FAR * (1 - is_beside(piece, x, y))
        least = np.minimum(least, away)
        if i == k:
            own = away
    return (own <= least + 3.0 * BEYOND) & (own < FAR)


@compiled_within
def rim_gap(c: float, outside: Any, r_x: Any, r_y: Any, size: Any, z: Any) -> tuple[Any, ...]:
    """Returns the gap of points to face, chamfer and wall of the hole, the normal, and the nearest surface.

    These bound a convex region beside a piece of the outline. The wall is treated as infinitely deep.

    Args:
        c: Width and height of the chamfer, m.
        outside: Distance of the points from the outline, m, negative inside.
        r_x: First component of a vector along the outward normal of the outline.
        r_y: Second component.
        size: Length of this vector.
        z: Height of the points in H, m.

    Returns:
        Gap, m; the normal's three components in H; and the number of the nearest surface: `FACE`, `CHAMFER` or `WALL`.
    """
    half = math.sqrt(0.5)

    def to_piece(x: Any, z: Any, d_rho: float, d_z: float, n_rho: float, n_z: float, end: float) -> tuple[Any, ...]:
        """Returns depth below, distance from, and direction from a piece with a direction d, a normal n and an end."""
        t = x * d_rho + z * d_z
        past = t - np.minimum(np.maximum(t, 0.0), end)
        depth = x * n_rho + z * n_z
        away = np.sqrt(depth * depth + past * past)
        on, size = away == 0.0, np.maximum(away, TINY)
        return (
            depth,
            away,
            on * n_rho + (depth * n_rho + past * d_rho) / size,
            on * n_z + (depth * n_z + past * d_z) / size,
        )

    face, near_face, face_rho, face_z = to_piece(outside - c, z, 1.0, 0.0, 0.0, 1.0, np.inf)
    slope, near_slope, slope_rho, slope_z = to_piece(outside, z + c, half, half, -half, half, c / half)
    wall, near_wall, wall_rho, wall_z = to_piece(outside, z + c, 0.0, -1.0, -1.0, 0.0, np.inf)
    inside = (face < 0.0) & (slope < 0.0) & (wall < 0.0)
    without = 1 - inside
    # Inside a convex block, the nearest surface is the one with the smallest depth.
    d0 = without * near_face - inside * face
    d1 = without * near_slope - inside * slope
    d2 = without * near_wall - inside * wall
    first = (d0 <= d1) & (d0 <= d2)
    second = (d1 < d0) & (d1 <= d2)
    third = 1 - first - second
    distance = first * d0 + second * d1 + third * d2
    n_rho = without * (first * face_rho + second * slope_rho + third * wall_rho) - inside * (second * half + third)
    n_z = without * (first * face_z + second * slope_z + third * wall_z) + inside * (first + second * half)
    across = n_rho / np.maximum(size, TINY)
    return (without - 1.0 * inside) * distance, across * r_x, across * r_y, n_z, second + 2 * third


@compiled_within
def side_gap(
    piece: Any, d_x: Any, d_y: Any, d_z: Any, u_x: Any, u_y: Any, u_z: Any, v_x: Any, v_y: Any, v_z: Any
) -> tuple[Any, ...]:
    """Returns how far points are outside of a side of the peg; see `edge_gap`.

    Returns:
        Distance, m, negative inside; three components of a vector along the outward normal, in H; the length of this
        vector; and how far the points are above the tip, along the peg, m.
    """
    a_x, a_y, a_z = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z, u_x * v_y - u_y * v_x
    along = d_x * a_x + d_y * a_y + d_z * a_z
    if piece[KIND] == 0.0:
        x, y = d_x * u_x + d_y * u_y + d_z * u_z, d_x * v_x + d_y * v_y + d_z * v_z
        beside, on_x, on_y, off = planar_gap(piece, x, y)
        r_x, r_y, r_z = on_x * u_x + on_y * v_x, on_x * u_y + on_y * v_y, on_x * u_z + on_y * v_z
    else:
        r_x = d_x - along * a_x - (piece[X] * u_x + piece[Y] * v_x)
        r_y = d_y - along * a_y - (piece[X] * u_y + piece[Y] * v_y)
        r_z = d_z - along * a_z - (piece[X] * u_z + piece[Y] * v_z)
        off = np.sqrt(r_x * r_x + r_y * r_y + r_z * r_z)
        beside = piece[KIND] * (off - piece[SIZE])
        r_x, r_y, r_z = piece[KIND] * r_x, piece[KIND] * r_y, piece[KIND] * r_z
    return beside, r_x, r_y, r_z, off, along


@compiled_within
def around_tip(
    beside: Any, r_x: Any, r_y: Any, r_z: Any, off: Any, along: Any, a_x: Any, a_y: Any, a_z: Any
) -> tuple[Any, ...]:
    """Returns what `edge_gap` does, from what `side_gap` returns and from the axis of the peg."""
    below = -along
    above = below <= 0.0
    corner = (below > 0.0) & (beside > 0.0)
    under = 1 - above - corner
    gap = above * np.maximum(beside, below) + corner * np.sqrt(beside * beside + below * below) + under * below
    side = above & (beside >= below)
    reach = np.maximum(gap, TINY)
    w = (side + corner * beside / reach) / np.maximum(off, TINY)
    h = 1 - side - corner + corner * below / reach
    return gap, h * a_x - w * r_x, h * a_y - w * r_y, h * a_z - w * r_z, side


@compiled_within
def edge_gap(
    piece: Array, d_x: Any, d_y: Any, d_z: Any, u_x: Any, u_y: Any, u_z: Any, v_x: Any, v_y: Any, v_z: Any
) -> tuple[Any, ...]:
    """Returns the gap of points, such as those on an edge of the hole, to the infinitely long peg, and the normal.

    Args:
        piece: Of the outline of the peg.
        d_x: First coordinate of the points relative to the centre of the tip, in H, m.
        d_y: Second coordinate, m.
        d_z: Third coordinate, m.
        u_x: First component of the unit vector along x of P, in H.
        u_y: Second component.
        u_z: Third component.
        v_x: First component of the unit vector along y of P.
        v_y: Second component.
        v_z: Third component.

    Returns:
        Gap, m; the normal's three components in H; and whether the point is beside the peg rather than below its tip.
    """
    beside, r_x, r_y, r_z, off, along = side_gap(piece, d_x, d_y, d_z, u_x, u_y, u_z, v_x, v_y, v_z)
    a_x, a_y, a_z = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z, u_x * v_y - u_y * v_x
    return around_tip(beside, r_x, r_y, r_z, off, along, a_x, a_y, a_z)


@compiled
def height_of(chamfer: float, circle: int) -> float:
    """Returns the height of an edge of the hole, m."""
    return 0.0 if circle == OUTER else -chamfer


@compiled
def rim_point_gap(chamfer: float, surface: Any, x: float, y: float, z: float) -> tuple[Any, ...]:
    """Returns `rim_gap` of one point, quickly where only the wall can be nearest."""
    outside, r_x, r_y, size = planar_gap(surface, x, y)
    if z < -chamfer - MARGIN and outside < MARGIN:
        across = -1.0 / max(size, TINY)
        return -outside, across * r_x, across * r_y, 0.0, WALL
    return rim_gap(chamfer, outside, r_x, r_y, size, z)


@compiled
def edge_point_gap(surface: Any, d_x: float, d_y: float, d_z: float, pose: Pose) -> tuple[Any, ...]:
    """Returns `edge_gap` of one point, quickly where only the side of the peg can be nearest."""
    _, _, _, u_x, u_y, u_z, v_x, v_y, v_z = pose
    outside, r_x, r_y, r_z, off, along = side_gap(surface, d_x, d_y, d_z, u_x, u_y, u_z, v_x, v_y, v_z)
    if along > MARGIN and outside > -MARGIN:
        w = 1.0 / max(off, TINY)
        return outside, -w * r_x, -w * r_y, -w * r_z, True
    a_x, a_y, a_z = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z, u_x * v_y - u_y * v_x
    return around_tip(outside, r_x, r_y, r_z, off, along, a_x, a_y, a_z)


@compiled
def on_curve(chamfer: float, circle: int, piece: Any, surface: Any, place: float, pose: Pose) -> tuple[Any, ...]:
    """Returns a gap on a piece of a curve to a piece of the other body.

    Returns:
        The gap (m), its slope over the place (m/rad, or m/m), point on the hole (3), normal (3) and surface; all in H.
        Then the outward normal of the curve (2), whether an edge is beside the peg, and the coordinates of the point in
        the plane of the other outline.
    """
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    if piece[KIND] == 0.0:
        c, s, r = piece[S], -piece[C], 0.0
        x_c, y_c, t_x, t_y = piece[X] + place * piece[C], piece[Y] + place * piece[S], piece[C], piece[S]
    else:
        c, s, r = math.cos(place), math.sin(place), piece[SIZE]
        x_c, y_c, t_x, t_y = piece[X], piece[Y], -s, c
    if circle == RIM:
        x = p_x + r * (c * u_x + s * v_x) + (x_c * u_x + y_c * v_x)
        y = p_y + r * (c * u_y + s * v_y) + (x_c * u_y + y_c * v_y)
        z = p_z + r * (c * u_z + s * v_z) + (x_c * u_z + y_c * v_z)
        gap, n_x, n_y, n_z, kind = rim_point_gap(chamfer, surface, x, y, z)
        along_u, along_v = n_x * u_x + n_y * u_y + n_z * u_z, n_x * v_x + n_y * v_y + n_z * v_z
        slope = t_y * along_v + t_x * along_u
        at_x, at_y, beside = x, y, False
        x, y, z = x - gap * n_x, y - gap * n_y, z - gap * n_z
    else:
        x, y, z = x_c + r * c, y_c + r * s, height_of(chamfer, circle)
        d_x, d_y, d_z = x - p_x, y - p_y, z - p_z
        gap, n_x, n_y, n_z, beside = edge_point_gap(surface, d_x, d_y, d_z, pose)
        slope = -t_x * n_x - t_y * n_y
        at_x, at_y = d_x * u_x + d_y * u_y + d_z * u_z, d_x * v_x + d_y * v_y + d_z * v_z
        kind = circle
    if r > 0.0:
        slope *= r
    sign = -1.0 if piece[KIND] < 0.0 else 1.0
    return gap, slope, x, y, z, n_x, n_y, n_z, kind, sign * c, sign * s, beside, at_x, at_y


@compiled
def sample_gaps(
    chamfer: float, circle: int, other: Any, samples: Array, begin: int, end: int, pose: Pose, found: Array
) -> None:
    """Computes the gaps of samples of a curve to a piece of the other body, and their slopes over the place: (2, n)."""
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    if circle == RIM:
        for k in range(end - begin):
            x, y, t_x, t_y = samples[1, begin + k], samples[2, begin + k], samples[3, begin + k], samples[4, begin + k]
            q_x, q_y, q_z = p_x + x * u_x + y * v_x, p_y + x * u_y + y * v_y, p_z + x * u_z + y * v_z
            outside, r_x, r_y, size = planar_gap(other, q_x, q_y)
            gap, n_x, n_y, n_z, _ = rim_gap(chamfer, outside, r_x, r_y, size, q_z)
            found[0, k] = gap
            found[1, k] = t_y * (n_x * v_x + n_y * v_y + n_z * v_z) + t_x * (n_x * u_x + n_y * u_y + n_z * u_z)
    else:
        d_z = height_of(chamfer, circle) - p_z
        for k in range(end - begin):
            x, y, t_x, t_y = samples[1, begin + k], samples[2, begin + k], samples[3, begin + k], samples[4, begin + k]
            gap, n_x, n_y, _, _ = edge_gap(other, x - p_x, y - p_y, d_z, u_x, u_y, u_z, v_x, v_y, v_z)
            found[0, k], found[1, k] = gap, -t_x * n_x - t_y * n_y


@compiled
def sample_gap(chamfer: float, circle: int, other: Any, samples: Array, k: int, pose: Pose) -> tuple[float, float]:
    """Returns gap and slope of sample ``k`` of a curve; see `sample_gaps`."""
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    x, y, t_x, t_y = samples[1, k], samples[2, k], samples[3, k], samples[4, k]
    if circle == RIM:
        q_x, q_y, q_z = p_x + x * u_x + y * v_x, p_y + x * u_y + y * v_y, p_z + x * u_z + y * v_z
        gap, n_x, n_y, n_z, _ = rim_point_gap(chamfer, other, q_x, q_y, q_z)
        slope = t_y * (n_x * v_x + n_y * v_y + n_z * v_z) + t_x * (n_x * u_x + n_y * u_y + n_z * u_z)
        return gap, slope
    gap, n_x, n_y, _, _ = edge_point_gap(other, x - p_x, y - p_y, height_of(chamfer, circle) - p_z, pose)
    return gap, -t_x * n_x - t_y * n_y


@compiled
def signs_of_slopes(
    chamfer: float, circle: int, other: Any, samples: Array, begin: int, end: int, pose: Pose, found: Array
) -> bool:
    """Computes positive multiples of the slopes of `sample_gaps`, without roots and divisions, where that is possible.

    Beside a side, a gap has the direction of the point from the side's centre. So it is where the whole rim is below
    the chamfer, or a whole edge above the tip, and no sample overlaps by more than `MARGIN`.

    Returns:
        Whether all samples are beside the piece. The multiples differ from zero by round-off where the slopes are zero.
    """
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    kind, size, c_x, c_y = other[KIND], other[SIZE], other[X], other[Y]
    elsewhere = 0
    if circle == RIM:
        for k in range(end - begin):
            x, y, t_x, t_y = samples[1, begin + k], samples[2, begin + k], samples[3, begin + k], samples[4, begin + k]
            d_x, d_y, q_z = p_x + x * u_x + y * v_x - c_x, p_y + x * u_y + y * v_y - c_y, p_z + x * u_z + y * v_z
            if kind == 0.0:
                r_x, r_y, overlaps = other[S], -other[C], d_x * other[S] - d_y * other[C] > MARGIN
            else:
                r_x, r_y = kind * d_x, kind * d_y
                overlaps = kind * (d_x * d_x + d_y * d_y - size * size) > MARGIN * size
            elsewhere += overlaps | (q_z > -chamfer - MARGIN)
            found[1, k] = -t_x * (r_x * u_x + r_y * u_y) - t_y * (r_x * v_x + r_y * v_y)
        return elsewhere == 0
    a_x, a_y, a_z = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z, u_x * v_y - u_y * v_x
    d_z = height_of(chamfer, circle) - p_z
    for k in range(end - begin):
        d_x, d_y = samples[1, begin + k] - p_x, samples[2, begin + k] - p_y
        t_x, t_y = samples[3, begin + k], samples[4, begin + k]
        x, y = d_x * u_x + d_y * u_y + d_z * u_z - c_x, d_x * v_x + d_y * v_y + d_z * v_z - c_y
        if kind == 0.0:
            r_x, r_y, overlaps = other[S], -other[C], x * other[S] - y * other[C] < -MARGIN
        else:
            r_x, r_y, overlaps = kind * x, kind * y, kind * (x * x + y * y - size * size) < -MARGIN * size
        elsewhere += overlaps | (d_x * a_x + d_y * a_y + d_z * a_z < MARGIN)
        found[1, k] = t_x * (r_x * u_x + r_y * v_x) + t_y * (r_x * u_y + r_y * v_y)
    return elsewhere == 0


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
    pose: Pose,
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
        pose: `Pose`.
    """
    place = low
    for k in range(MAX_SEARCH):
        share, width = falling / (falling - rising), high - low
        meet = (g_high - g_low - rising * width) / ((falling - rising) * width)
        if k % 3 > 0:
            share = meet if k % 3 == 1 and 0.0 < meet < 1.0 else 0.5
        place = low + share * width
        g, slope = on_curve(chamfer, circle, piece, surface, place, pose)[:2]
        if abs(slope) < FLAT or (width < NARROW and 0.0 < meet < 1.0 and g - g_low - falling * meet * width < SHALLOW):
            break
        if slope > 0.0:
            high, g_high, rising = place, g, slope
        else:
            low, g_low, falling = place, g, slope
    return place


@compiled
def find_minima(bodies: Bodies, mate: int, pose: Pose, reach: float, found: Array) -> int:
    """Finds the minima of the gap that are below ``reach``, on the rim and on both edges, and the points on the floor.

    Args:
        bodies: `Bodies`.
        mate: number of the mate.
        pose: `Pose`.
        reach: m.
        found: (MAX_CONTACTS, COLUMNS), receives the minima, their points from the centre of the mate's mouth.

    Returns:
        The number of minima.
    """
    pose, count = tip_in_mouth(bodies.mates, mate, pose), 0
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    r = bodies.mates[mate, RADIUS]
    lowest = p_z - r * math.hypot(u_z, v_z)
    if lowest > reach:
        return count
    chamfer, a_z, mates = bodies.chamfer, u_x * v_y - u_y * v_x, len(bodies.mates)
    pieces, outlines, samples = bodies.pieces, bodies.outlines, np.empty((2, bodies.most))
    # By as much as the peg is off the axis, tilted and turned, it can touch a piece beside its own.
    turn = abs(u_y) + abs(v_x) + abs(u_z) + abs(v_z) + (1.0 - u_x) + (1.0 - v_y)
    near = math.hypot(p_x, p_y) + abs(p_z) * (abs(u_z) + abs(v_z)) + r * turn + chamfer + 5.0 * reach
    # By as much the outline of a tilted and turned peg, cut by a plane across the hole, can be outside of itself.
    swept = r * (abs(u_y) + abs(v_x) + (1.0 - u_x) + (1.0 - v_y) + (1.0 / a_z - 1.0))
    for circle in (RIM, OUTER, INNER):
        outline = RIM_PIECES if circle == RIM else OUTER_PIECES if circle == OUTER else INNER_PIECES
        touched = (WALLS if circle == RIM else SIDES) * mates + mate
        begin, end = outlines[touched], outlines[touched + 1]
        first = count
        # No gap on the curve is below a bound that takes no samples.
        if circle == RIM:
            if bodies.mates[mate, INSIDE + INNER_PIECES] - math.hypot(p_x, p_y) - r > reach:
                continue
        else:
            a_x, a_y = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z
            height = height_of(chamfer, circle)
            up = (height - p_z) / a_z
            off = math.hypot(p_x + up * a_x, p_y + up * a_y)
            apart_by = bodies.mates[mate, CLEARANCE] + (chamfer if circle == OUTER else 0.0)
            inside = bodies.mates[mate, INSIDE + outline]
            if max(lowest - height, a_z * (inside - off) - r, a_z * (apart_by - off) - swept) > reach:
                continue
        curve = outline * mates + mate
        for j in range(outlines[curve], outlines[curve + 1]):
            for k in range(begin, end):
                if apart(pieces, j, BOX, pieces, k) <= near:
                    count = add_minima(bodies, circle, j, begin, end, k, pose, reach, samples, found, first, count)
        for j in range(bodies.corners[curve], bodies.corners[curve + 1]):
            for k in range(begin, end):
                if apart(bodies.ends, j, 0, pieces, k) <= near:
                    count = add_end(bodies, circle, j, begin, end, k, pose, reach, found, first, count)
    depth = bodies.mates[mate, DEPTH]
    if lowest + depth < reach:
        curve = RIM_PIECES * mates + mate
        count = add_floor_points(pieces, outlines[curve], outlines[curve + 1], depth, pose, reach, found, count)
    return count


@compiled
def apart(boxes: Array, i: int, column: int, pieces: Array, k: int) -> float:
    """Returns by how much the box in row ``i`` and that of piece ``k`` are apart in one direction, m, or overlap."""
    across = max(boxes[i, column] - pieces[k, BOX + 2], pieces[k, BOX] - boxes[i, column + 2])
    along = max(boxes[i, column + 1] - pieces[k, BOX + 3], pieces[k, BOX + 1] - boxes[i, column + 3])
    return float(max(across, along))


@compiled
def add_minima(
    bodies: Bodies,
    circle: int,
    j: int,
    begin: int,
    end: int,
    o: int,
    pose: Pose,
    reach: float,
    samples: Array,
    found: Array,
    first: int,
    count: int,
) -> int:
    """Adds the minima of piece ``j`` of a curve and piece ``o`` of the other body; returns the count.

    The outline of the other body has the pieces from ``begin`` to ``end``; ``samples`` (2, n) is filled. See
    `find_minima`.
    """
    piece, other, chamfer = row_of(bodies.pieces, j), row_of(bodies.pieces, o), bodies.chamfer
    start, stop = bodies.first[j], bodies.first[j + 1]
    signs = signs_of_slopes(chamfer, circle, other, bodies.samples, start, stop, pose, samples)
    if not signs:
        sample_gaps(chamfer, circle, other, bodies.samples, start, stop, pose, samples)
    for k in range(stop - start - 1):
        g_low, falling, g_high, rising = samples[0, k], samples[1, k], samples[0, k + 1], samples[1, k + 1]
        if signs:
            if falling > ROUND_OFF or rising < -ROUND_OFF:
                continue
            g_low, falling = sample_gap(chamfer, circle, other, bodies.samples, start + k, pose)
            g_high, rising = sample_gap(chamfer, circle, other, bodies.samples, start + k + 1, pose)
        if falling > 0.0 or rising <= 0.0:
            continue
        low, high = bodies.samples[0, start + k], bodies.samples[0, start + k + 1]
        if piece[KIND] == 0.0:  # along a line a gap is convex, and above its tangents
            meet = (g_high - g_low - rising * (high - low)) / (falling - rising)
            if g_low + falling * meet > reach:
                continue
        elif min(g_low, g_high) > reach + DIP:
            continue
        t = lowest_place(chamfer, circle, piece, other, low, high, g_low, g_high, falling, rising, pose)
        contact = on_curve(chamfer, circle, piece, other, t, pose)
        count = add_contact(contact, bodies.pieces, begin, end, o, reach, found, first, count)
    return count


@compiled
def add_end(
    bodies: Bodies,
    circle: int,
    j: int,
    begin: int,
    end: int,
    o: int,
    pose: Pose,
    reach: float,
    found: Array,
    first: int,
    count: int,
) -> int:
    """Adds end ``j`` of the segments of a curve, if it is near piece ``o`` of the other body; see `add_minima`."""
    # a segment without a length
    still = (0.0, bodies.ends[j, 0], bodies.ends[j, 1], 1.0, 0.0, 0.0, 0.0, 0.0)
    contact = on_curve(bodies.chamfer, circle, still, row_of(bodies.pieces, o), 0.0, pose)
    gap, slope, x, y, z, n_x, n_y, n_z, kind, _, _, beside, at_x, at_y = contact
    at_end = (gap, slope, x, y, z, n_x, n_y, n_z, kind, 0.0, 0.0, beside, at_x, at_y)
    return add_contact(at_end, bodies.pieces, begin, end, o, reach, found, first, count)


@compiled
def add_contact(
    contact: Any, pieces: Array, begin: int, end: int, o: int, reach: float, found: Array, first: int, count: int
) -> int:
    """Adds a contact of `on_curve` if it is near, and piece ``o`` the nearest one of its outline; returns the count.

    Of two contacts at one place on a curve, such as the end of a segment and the arc beside it, the deeper one stays.
    Those of this curve begin at ``first``.
    """
    gap, _, x, y, z, n_x, n_y, n_z, kind, c, s, beside, at_x, at_y = contact
    if not (gap < reach and is_nearest(pieces, begin, end, o, at_x, at_y)):
        return count
    place = count
    for i in range(first, count):
        away = (found[i, 1] - x) ** 2 + (found[i, 2] - y) ** 2 + (found[i, 3] - z) ** 2
        if away < SAME_PLACE**2 and found[i, 4] * n_x + found[i, 5] * n_y + found[i, 6] * n_z > SAME_NORMAL:
            place = i
            break
    if place == MAX_CONTACTS - 3 or (place < count and found[place, GAP] <= gap):
        return count
    set_row(found, place, (gap, x, y, z, n_x, n_y, n_z, kind, c, s, beside))
    return max(count, place + 1)


@compiled
def set_row(found: Array, i: int, values: Any) -> None:
    """Sets a contact."""
    found[i, 0], found[i, 1], found[i, 2], found[i, 3] = values[0], values[1], values[2], values[3]
    found[i, 4], found[i, 5], found[i, 6] = values[4], values[5], values[6]
    found[i, 7], found[i, 8], found[i, 9], found[i, 10] = values[7], values[8], values[9], values[10]


@compiled
def add_floor_points(
    pieces: Array, begin: int, end: int, depth: float, pose: Pose, reach: float, found: Array, count: int
) -> int:
    """Adds the points of the tip that are on the floor: the furthest downhill, and at 120 degrees to both sides."""
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    first = math.atan2(-v_z, -u_z)
    for k in range(3):
        t = first + 2.0 * np.pi * k / 3.0
        c, s = math.cos(t), math.sin(t)
        x, y, r = furthest(pieces, begin, end, c, s)
        at_z = p_z + r * (c * u_z + s * v_z) + (x * u_z + y * v_z)
        gap = at_z + depth
        if gap < reach:
            at_x = p_x + r * (c * u_x + s * v_x) + (x * u_x + y * v_x)
            at_y = p_y + r * (c * u_y + s * v_y) + (x * u_y + y * v_y)
            set_row(found, count, (gap, at_x, at_y, -depth, 0.0, 0.0, 1.0, FLOOR, c, s, 0.0))
            count += 1
    return count


@compiled
def furthest(pieces: Array, begin: int, end: int, c: float, s: float) -> tuple[float, float, float]:
    """Returns the point of an outline that is furthest in a direction (c, s): a point, and how far beyond it it is."""
    best, found_x, found_y, found_r = -np.inf, 0.0, 0.0, 0.0
    for k in range(begin, end):
        piece = row_of(pieces, k)
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
def crossing(found: Array, i: int, e: int, pose: Pose) -> tuple[bool, float, float, float]:
    """Returns whether the rim and an edge can touch where they cross, and the normal of this contact.

    It is perpendicular to both, and lies between the normals of the surfaces that meet at each of them. Its sign is
    that of the nearest surface.

    Args:
        found: contacts.
        i: number of that on the rim.
        e: number of that on the edge.
        pose: `Pose`.
    """
    _, _, _, u_x, u_y, u_z, v_x, v_y, v_z = pose
    c, s, c_e, s_e = found[i, 8], found[i, 9], found[e, 8], found[e, 9]
    t_x, t_y, t_z = c * v_x - s * u_x, c * v_y - s * u_y, c * v_z - s * u_z  # along the rim
    x, y, z = -t_z * c_e, -t_z * s_e, t_x * c_e + t_y * s_e  # the edge is along (-s_e, c_e, 0)
    size = math.copysign(
        max(TINY, math.sqrt(x * x + y * y + z * z)), x * found[i, 4] + y * found[i, 5] + z * found[i, 6]
    )
    x, y, z = x / size, y / size, z / size
    inwards = -(x * c_e + y * s_e)
    outwards = x * (c * u_x + s * v_x) + y * (c * u_y + s * v_y) + z * (c * u_z + s * v_z)
    along = x * (u_y * v_z - u_z * v_y) + y * (u_z * v_x - u_x * v_z) + z * (u_x * v_y - u_y * v_x)
    within = min(inwards, z - inwards) if found[e, SURFACE] == OUTER else min(z, inwards - z)
    return min(within, along, -outwards) > -1e-9, x, y, z


@compiled
def tip_in_mouth(mates: Array, mate: int, pose: Pose) -> Pose:
    """Returns the pose of a mate's tip from the centre of its mouth."""
    p_x, p_y, p_z, u_x, u_y, u_z, v_x, v_y, v_z = pose
    a_x, a_y, a_z = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z, u_x * v_y - u_y * v_x
    t_x, t_y, t_z = mates[mate, 0], mates[mate, 1], mates[mate, 2]
    return (
        p_x + (t_x * u_x + t_y * v_x + t_z * a_x) - mates[mate, 3],
        p_y + (t_x * u_y + t_y * v_y + t_z * a_y) - mates[mate, 4],
        p_z + (t_x * u_z + t_y * v_z + t_z * a_z) - mates[mate, 5],
        *(u_x, u_y, u_z),
        *(v_x, v_y, v_z),
    )


@compiled
def pose_of(p: Array, R: Array) -> Pose:
    """Returns the pose of a tip at p (3,), m, with the rotation R_HP (3, 3)."""
    return p[0], p[1], p[2], R[0, 0], R[1, 0], R[2, 0], R[0, 1], R[1, 1], R[2, 1]


@compiled
def deepest_overlap(bodies: Bodies, pose: Pose) -> float:
    """Returns the deepest overlap of a pose, m, or 0."""
    found, deepest = np.empty((MAX_CONTACTS, COLUMNS)), 0.0
    for mate in range(len(bodies.mates)):
        for i in range(find_minima(bodies, mate, pose, REACH, found)):
            deepest = max(deepest, -found[i, GAP])
    return deepest


@compiled
def find_contacts(bodies: Bodies, pose: Pose, contacts: Array) -> int:
    """Finds the contacts of a pose whose gap is below `REACH`.

    They are the minima of the gap on the three curves, and the ends of their straight pieces. Where the rim crosses an
    edge of the hole, there is a minimum on both; these become one contact, the normal of which is perpendicular to both
    curves. While the bodies do not overlap, it is that of the minima; where they do, the nearest surface is one of
    those beside the edge.

    Args:
        bodies: `Bodies`.
        pose: `Pose`.
        contacts: `CONTACTS`, receives the gaps (m), the points on the bore in H (m), the directions in H in which the
            bore pushes the peg, and the surfaces.

    Returns:
        The number of contacts.
    """
    count, minima = 0, contacts[MAX_CONTACTS:]
    for mate in range(len(bodies.mates)):
        first = count
        number = find_minima(bodies, mate, pose, REACH, minima)
        for e in range(MAX_CONTACTS, MAX_CONTACTS + number):
            crosses = False
            if contacts[e, SURFACE] >= OUTER and (contacts[e, 8] != 0.0 or contacts[e, 9] != 0.0):
                for i in range(first, count):
                    # No minimum on the rim, or one that crosses another edge, or the end of a segment.
                    if contacts[i, SURFACE] >= FLOOR or (contacts[i, 8] == 0.0 and contacts[i, 9] == 0.0):
                        continue
                    d_x, d_y = contacts[i, 1] - contacts[e, 1], contacts[i, 2] - contacts[e, 2]
                    d_z = contacts[i, 3] - contacts[e, 3]
                    if d_x * d_x + d_y * d_y + d_z * d_z > CROSSING**2:
                        continue
                    crosses, x, y, z = crossing(contacts, i, e, pose)
                    if crosses:
                        aligned = contacts[i, 4] * x + contacts[i, 5] * y + contacts[i, 6] * z
                        contacts[i, GAP] = d_x * x + d_y * y + d_z * z + contacts[i, GAP] * aligned
                        contacts[i, SURFACE] = contacts[e, SURFACE]
                        for k in range(3):
                            contacts[i, 1 + k] = contacts[e, 1 + k]
                        contacts[i, 4], contacts[i, 5], contacts[i, 6] = x, y, z
                        break
            if not crosses and count < MAX_CONTACTS:
                for k in range(COLUMNS):
                    contacts[count, k] = contacts[e, k]
                count += 1
        for i in range(first, count):
            for k in range(3):
                contacts[i, 1 + k] += bodies.mates[mate, 3 + k]
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
        pose, reach = pose_of(p_HP[k], R_HP[k]), REACH
        while lowest[k] == FAR and reach < FAR:
            for mate in range(len(bodies.mates)):
                for i in range(find_minima(bodies, mate, pose, reach, found)):
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
    touching = np.empty((MAX_CONTACTS * len(bodies.mates), COLUMNS))
    for k in range(len(p_HP)):
        pose, count = pose_of(p_HP[k], R_HP[k]), 0
        for mate in range(len(bodies.mates)):
            for i in range(find_minima(bodies, mate, pose, REACH, found)):
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


def rotations_of_vectors(rotation: ArrayLike) -> Array:
    """Returns the rotations R_HP (n, 3, 3) of rotation vectors (n, 3), rad."""
    return np.asarray(Rotation.from_rotvec(np.asarray(rotation, dtype=np.float64)).as_matrix())
