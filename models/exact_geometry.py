"""Exact contact geometry of a flat-ended prismatic peg and a chamfered blind hole.

How far a point of one body is from a piece of the other, in closed form, and the names of contact states. There are no
meshes and no simulation, so that this also is the reference for simulated contact and for learnt contact states.

Along each generatrix of the peg, the distance to each side of the hole is a concave function, so its minimum is at an
end. The closest points of the two bodies, or their deepest overlap, therefore lie on one of three curves: the rim of
the peg's tip (against the surfaces of the hole), or the outer or inner edge of the chamfer (against the peg). For each
piece of a curve and each piece of the other outline (`models.section`), the distance is a closed-form function of one
number, whose minima `models.contact_search` finds. This holds for tilts below 45 degrees, where the peg's side cannot
lie flat on the chamfer.

Frames: H has its origin at the centre of the mouth and z out of the hole. P has its origin at the centre of the tip
face and z along the peg, away from the tip. The top face of the block is unbounded and the peg is infinitely long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from models import Array
from models.labelled_enum import LabelledEnum
from models.section import KIND, SIZE, SPAN, C, S, Section, X, Y

BEYOND = 2e-5
"""Distance by which a side reaches beyond a sharp corner in which the other body lies, m; overlaps are smaller."""

FAR = 1e3
"""Larger than any distance, m."""

TINY = 1e-300
"""Minimum of a denominator, so that 0/0 gives 0."""

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


@register_jitable(inline="always")
def planar_gap(piece: Array, x: Any, y: Any) -> tuple[Any, ...]:
    """Returns how far points are outside of an outline beside one of its pieces.

    Like `rim_gap` and `edge_gap`, this is written for arrays of any shape and, compiled, for single points.

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


@register_jitable(inline="always")
def is_beside(piece: Array, x: Any, y: Any) -> Any:
    """Returns whether a piece is the nearest part of its outline around it to points; see `planar_gap`."""
    d_x, d_y = x - piece[X], y - piece[Y]
    along = d_x * piece[C] + d_y * piece[S]
    if piece[KIND] == 0.0:
        return (along >= 0.0) & (along <= piece[SIZE])
    return along >= np.sqrt(d_x * d_x + d_y * d_y) * math.cos(0.5 * piece[SPAN])


@register_jitable
def is_nearest(pieces: Array, k: int, x: Any, y: Any) -> Any:
    """Returns whether piece ``k`` of an outline is as near to points as any, or almost; see `planar_gap`.

    A point in a sharp corner is near to both of its sides.
    """
    own = least = FAR + 0.0 * x
    for i in range(len(pieces)):
        away = np.abs(planar_gap(pieces[i], x, y)[0]) + FAR * (1 - is_beside(pieces[i], x, y))
        least = np.minimum(least, away)
        if i == k:
            own = away
    return (own <= least + 3.0 * BEYOND) & (own < FAR)


@register_jitable(inline="always")
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


@register_jitable(inline="always")
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


def rotations_of_vectors(rotation: ArrayLike) -> Array:
    """Returns the rotations R_HP (n, 3, 3) of rotation vectors (n, 3), rad."""
    return np.asarray(Rotation.from_rotvec(np.asarray(rotation, dtype=np.float64)).as_matrix())
