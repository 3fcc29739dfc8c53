"""Exact contact geometry of a flat-ended prismatic peg and a chamfered blind hole.

Computes gaps, contact points and normals, and the contact label of a pose. It uses no meshes and no simulation, so it
serves as the reference for simulated contact and for learnt contact states.

Along each generatrix of the peg, the distance to each side of the hole is a concave function, so its minimum is at an
end. The closest points of the two bodies, or their deepest overlap, therefore lie on one of three curves: the rim of
the peg's tip (against the surfaces of the hole), or the outer or inner edge of the chamfer (against the peg). For each
piece of a curve and each piece of the other outline (`models.section`), the distance is a closed-form function of one
number, which is minimised numerically. This holds for tilts below 45 degrees, where the peg's side cannot lie flat on
the chamfer.

Frames: H has its origin at the centre of the mouth and z out of the hole. P has its origin at the centre of the tip
face and z along the peg, away from the tip. The top face of the block is unbounded and the peg is infinitely long.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from models import Array
from models.labelled_enum import LabelledEnum
from models.section import KIND, SIZE, SPAN, C, S, Section, X, Y, on_piece, section_of

SAMPLES = 256
"""Number of samples of a full circle. The gap has kinks where two surfaces of the bore are equally near, and two kinks
can be 0.2 rad apart. Of 60,000 poses near the chamfer, 64 samples miss one minimum and 128 miss none."""

MIN_SAMPLES = 9
"""Minimum number of samples of a piece of an outline."""

MINIMA = 4
"""Number of local minima that are kept of two pieces."""

BEYOND = 2e-5
"""Distance by which a side reaches beyond a sharp corner in which the other body lies, m; overlaps are smaller."""

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
GOLDEN_STEPS = 48
"""Number of golden-section steps; they shrink a bracket of two sample distances to 5e-12 rad."""

FAR = 1e3
"""Larger than any distance, m."""

TINY = 1e-300
"""Minimum of a denominator, so that 0/0 gives 0."""

GapFunction = Callable[[Array], tuple[Any, ...]]
"""Maps shares (n, k) of the length of a piece to the fields of `Contacts` there."""

PartFunction = Callable[[Array], NDArray[np.bool_]]
"""Maps such shares to whether the other piece is the part of its outline that is nearest."""


class ContactLabel(LabelledEnum):
    """Contact state determined from geometry alone; ``label`` is its display name."""

    FREE = 0, "free"
    FACE = 1, "on the face"
    CHAMFER = 2, "on the chamfer"
    MOUTH = 3, "one point at the mouth"
    TIP = 4, "one point at the tip"
    TWO_POINT = 5, "two-point contact"
    LINE = 6, "line contact"
    SEATED = 7, "seated"


class Surface(IntEnum):
    """Pair of features in contact: the tip's rim and a surface of the bore, or an edge of the bore and the peg."""

    RIM_FACE = 0
    RIM_CHAMFER = 1
    RIM_WALL = 2
    RIM_FLOOR = 3
    OUTER_EDGE = 4
    INNER_EDGE = 5


@dataclass(frozen=True)
class Contacts:
    """Candidate contacts of n poses, m for each: `MINIMA` of each two pieces of the outlines and of the floor.

    Attributes:
        gap: Signed gaps (n, m), m. Negative where the bodies overlap, infinite where two pieces have fewer minima.
        point: Points on the bore (n, m, 3), in H, m.
        normal: Unit vectors (n, m, 3), in H, in the direction in which the bore pushes the peg.
        side: Whether an edge of the bore meets the peg's side rather than its tip face or rim, (n, m).
        surface: `Surface` of each contact, (n, m).
    """

    gap: Array
    point: Array
    normal: Array
    side: NDArray[np.bool_]
    surface: NDArray[np.intp]


@dataclass(frozen=True)
class PegInHole:
    """Peg and hole, given by their outlines.

    Attributes:
        peg: Section of the peg, m.
        hole: Section of the hole, m, which holds that of the peg.
        hole_depth: Depth from mouth to floor, m.
        chamfer: Width and height of the 45 degree chamfer, m; 0 for a sharp edge.

    Raises:
        ValueError: If a size is not positive and finite, or the chamfer is not smaller than the depth.
    """

    peg: Section
    hole: Section
    hole_depth: float
    chamfer: float = 0.0

    def __post_init__(self) -> None:
        sizes = (self.peg.area, self.hole.area, self.hole_depth)
        if not (all(np.isfinite(sizes)) and min(sizes) > 0 and 0 <= self.chamfer < self.hole_depth):
            raise ValueError(
                f"areas of peg {self.peg.area} and hole {self.hole.area} (m^2), depth {self.hole_depth}, chamfer"
                f" {self.chamfer} (m): expected positive sizes and a chamfer smaller than the depth"
            )

    @classmethod
    def of(cls, geometry: Any) -> Self:
        """Returns peg and hole of `models.scenario.Geometry`, or of what was stored of it with a recording."""
        peg = section_of(geometry.corners or geometry.section).scaled(geometry.peg_radius)
        hole = peg.offset(geometry.hole_radius - geometry.peg_radius)
        return cls(peg, hole, geometry.hole_depth, geometry.chamfer)

    def contacts(self, p_HP: ArrayLike, R_HP: ArrayLike) -> Contacts:
        """Returns the candidate contacts of every pair of features.

        Args:
            p_HP: Centres of the tip (n, 3), m.
            R_HP: Rotations (n, 3, 3); the peg's axis is less than 45 degrees from z of H.

        Raises:
            ValueError: If a shape is wrong, a number is NaN or infinite, a matrix is no rotation, or a tilt is too
                large.
        """
        p, R = _checked_poses(p_HP, R_HP)
        parts = []
        for piece, evaluate, is_part in self._pairs(p, R):
            share = _minima(evaluate, is_part, len(p), piece)
            known = np.nan_to_num(share)
            gap, *rest = evaluate(known)
            parts.append((np.where(np.isnan(share) | ~is_part(known), np.inf, gap), *rest))
        return Contacts(*(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)))

    def gap(self, p_HP: ArrayLike, R_HP: ArrayLike) -> Array:
        """Returns the signed gap (n,), m: the distance between peg and block, or minus their deepest overlap."""
        return np.asarray(self.contacts(p_HP, R_HP).gap.min(axis=1))

    def label(self, p_HP: ArrayLike, R_HP: ArrayLike, *, tolerance: float = 0.0) -> NDArray[np.intp]:
        """Returns the `ContactLabel` of each pose (n,).

        Args:
            p_HP: See `contacts`.
            R_HP: See `contacts`.
            tolerance: Largest gap that counts as contact, m.
        """
        return label_contacts(self.contacts(p_HP, R_HP), tolerance=tolerance)

    def _pairs(self, p: Array, R: Array) -> Iterator[tuple[Array, GapFunction, PartFunction]]:
        """Yields each piece of a curve with its gap to a piece of the other outline, and where this is the gap."""
        walls, sides = surface_pieces(self.hole, inside=True), surface_pieces(self.peg, inside=False)
        for piece in curve_pieces(self.peg):
            yield piece, self._floor_function(piece, p, R), lambda share: np.ones(share.shape, dtype=bool)
            for k in range(len(walls)):
                yield piece, *self._rim_functions(piece, walls, k, p, R)
        for edge, height, kind in (
            (self.hole.offset(self.chamfer), 0.0, Surface.OUTER_EDGE),
            (self.hole, -self.chamfer, Surface.INNER_EDGE),
        ):
            for piece in curve_pieces(edge):
                for k in range(len(sides)):
                    yield piece, *_edge_functions(piece, height, sides, k, kind, p, R)

    def _rim_functions(
        self, piece: Array, walls: Array, k: int, p: Array, R: Array
    ) -> tuple[GapFunction, PartFunction]:
        """Returns the gap of a piece of the tip's rim to face, chamfer and wall beside piece ``k`` of the hole."""

        def evaluate(share: Array) -> tuple[Any, ...]:
            q = _rim(piece, p, R, share)
            d, r_x, r_y, size = planar_gap(walls[k], q[..., 0], q[..., 1])
            gap, n_x, n_y, n_z, nearest = rim_gap(self.chamfer, d, r_x, r_y, size, q[..., 2])
            normal = np.stack([n_x, n_y, n_z], axis=-1)
            side = np.zeros(gap.shape, dtype=bool)
            return gap, q - gap[..., None] * normal, normal, side, nearest.astype(np.intp)

        def is_part(share: Array) -> NDArray[np.bool_]:
            q = _rim(piece, p, R, share)
            return np.asarray(is_nearest(walls, k, q[..., 0], q[..., 1]))

        return evaluate, is_part

    def _floor_function(self, piece: Array, p: Array, R: Array) -> GapFunction:
        """Returns the gap of a piece of the tip's rim to the floor, which is treated as unbounded."""

        def evaluate(share: Array) -> tuple[Any, ...]:
            q = _rim(piece, p, R, share)
            gap = q[..., 2] + self.hole_depth
            up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), q.shape)
            kind = np.full(gap.shape, np.intp(Surface.RIM_FLOOR))
            return gap, q - gap[..., None] * up, up, np.zeros(gap.shape, dtype=bool), kind

        return evaluate


def _edge_functions(
    piece: Array, height: float, sides: Array, k: int, kind: Surface, p: Array, R: Array
) -> tuple[GapFunction, PartFunction]:
    """Returns the gap of a piece of an edge of the chamfer to side ``k`` of the peg, and to its tip face."""
    u, v = R[:, :, 0].T[..., None], R[:, :, 1].T[..., None]

    def points(share: Array) -> Array:
        x, y = on_piece(piece, share)
        return np.stack([x, y, np.full_like(x, height)], axis=-1)

    def evaluate(share: Array) -> tuple[Any, ...]:
        e = points(share)
        gap, n_x, n_y, n_z, beside = edge_gap(sides[k], *np.moveaxis(e - p[:, None], -1, 0), *u, *v)
        return gap, e, np.stack([n_x, n_y, n_z], axis=-1), beside, np.full(share.shape, np.intp(kind))

    def is_part(share: Array) -> NDArray[np.bool_]:
        d = np.moveaxis(points(share) - p[:, None], -1, 0)
        return np.asarray(is_nearest(sides, k, (d * u).sum(axis=0), (d * v).sum(axis=0)))

    return evaluate, is_part


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

    Like `rim_gap` and `edge_gap`, this is written for arrays of any shape and, compiled, for single points
    (`systems.plant.exact_contact`).

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
        Gap, m; the normal's three components in H; and the number of the nearest `Surface`: 0, 1 or 2.
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
        Gap, m; the normal's three components in H; and `Contacts.side`.
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


def label_contacts(contacts: Contacts, *, tolerance: float = 0.0) -> NDArray[np.intp]:
    """Returns the `ContactLabel` (n,) of contacts whose gap is at most ``tolerance`` (m).

    A tip on the floor is seated, whatever else touches. A tip that has not passed the chamfer is on the chamfer or on
    the face, whichever has the deeper overlap. Inside the bore, the inner edge of the chamfer is the mouth. Contact at
    both mouth and tip is two-point contact if they are on opposite sides of the bore, and line contact otherwise.
    """
    on = contacts.gap <= tolerance
    kind = contacts.surface

    def deepest(chosen: NDArray[np.bool_]) -> Array:
        return np.asarray(np.where(chosen, contacts.gap, np.inf).min(axis=1))

    face = deepest(on & ((kind == Surface.RIM_FACE) | ((kind == Surface.OUTER_EDGE) & ~contacts.side)))
    chamfer = deepest(
        on
        & (
            (kind == Surface.RIM_CHAMFER)
            | ((kind == Surface.INNER_EDGE) & ~contacts.side)
            | ((kind == Surface.OUTER_EDGE) & contacts.side)
        )
    )
    mouth = on & (kind == Surface.INNER_EDGE) & contacts.side
    tip = on & (kind == Surface.RIM_WALL)
    sides = contacts.normal[..., :2]
    facing = np.einsum("nai,nbi->nab", sides, sides)
    pair = mouth[:, :, None] & tip[:, None, :]
    opposite = (pair & (facing < 0.0)).any(axis=(1, 2))
    seated = (on & (kind == Surface.RIM_FLOOR)).any(axis=1)
    conditions = [
        seated,
        np.isfinite(face) & (face <= chamfer),
        np.isfinite(chamfer),
        opposite,
        pair.any(axis=(1, 2)),
        mouth.any(axis=1),
        tip.any(axis=1),
    ]
    names = [
        ContactLabel.SEATED,
        ContactLabel.FACE,
        ContactLabel.CHAMFER,
        ContactLabel.TWO_POINT,
        ContactLabel.LINE,
        ContactLabel.MOUTH,
        ContactLabel.TIP,
    ]
    return np.select(conditions, [np.intp(name) for name in names], default=np.intp(ContactLabel.FREE))


def rotations_of_vectors(rotation: ArrayLike) -> Array:
    """Returns the rotations R_HP (n, 3, 3) of rotation vectors (n, 3), rad."""
    return np.asarray(Rotation.from_rotvec(np.asarray(rotation, dtype=np.float64)).as_matrix())


def _rim(piece: Array, p: Array, R: Array, share: Array) -> Array:
    """Returns points (n, k, 3) on a piece of the rim of the tip, at shares (n, k) of its length."""
    x, y = on_piece(piece, share)
    u, v = R[:, None, :, 0], R[:, None, :, 1]
    return np.asarray(p[:, None] + x[..., None] * u + y[..., None] * v)


def _minima(evaluate: GapFunction, is_part: PartFunction, n: int, piece: Array) -> Array:
    """Returns the shares (n, MINIMA) of a piece's length at which a gap has its lowest local minima.

    Entries are NaN where there are fewer minima.
    """
    closed = abs(piece[SPAN]) >= 2.0 * np.pi
    count = max(MIN_SAMPLES, math.ceil(SAMPLES * abs(piece[SPAN]) / (2.0 * np.pi)))
    step = 1.0 / count if closed else 1.0 / (count - 1)
    grid = step * np.arange(count)

    def f(share: Array) -> Array:
        return np.asarray(evaluate(share)[0])

    everywhere = np.broadcast_to(grid, (n, count))
    values = f(everywhere)
    if piece[KIND] != 0.0:  # along a segment a gap is convex
        values = np.where(is_part(everywhere), values, np.inf)
    wall = np.full((n, 1), np.inf)
    before = np.roll(values, 1, axis=1) if closed else np.hstack([wall, values[:, :-1]])
    after = np.roll(values, -1, axis=1) if closed else np.hstack([values[:, 1:], wall])
    lowest = (values <= before) & (values < after)
    lowest[np.arange(n), values.argmin(axis=1)] = True
    ranked = np.where(lowest, values, np.inf)
    best = np.argsort(ranked, axis=1)[:, :MINIMA]
    exists = np.isfinite(np.take_along_axis(ranked, best, axis=1))
    if not exists.any():
        return np.full((n, 1), np.nan)
    low, high = step * (best - 1.0), step * (best + 1.0)
    if not closed:
        low, high = np.maximum(low, 0.0), np.minimum(high, 1.0)
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    f_left, f_right = f(left), f(right)
    for _ in range(GOLDEN_STEPS):
        smaller = f_left < f_right
        high, low = np.where(smaller, right, high), np.where(smaller, low, left)
        kept, f_kept = np.where(smaller, left, right), np.where(smaller, f_left, f_right)
        new = np.where(smaller, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        f_new = f(new)
        left, right = np.where(smaller, new, kept), np.where(smaller, kept, new)
        f_left, f_right = np.where(smaller, f_new, f_kept), np.where(smaller, f_kept, f_new)
    return np.where(exists, 0.5 * (low + high), np.nan)


def _checked_poses(p_HP: ArrayLike, R_HP: ArrayLike) -> tuple[Array, Array]:
    """Returns both as arrays (n, 3) and (n, 3, 3); see `PegInHole.contacts` for the errors."""
    p, R = np.asarray(p_HP, dtype=np.float64), np.asarray(R_HP, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or R.shape != (len(p), 3, 3):
        raise ValueError(f"p_HP has shape {p.shape} and R_HP {R.shape}, expected (n, 3) and (n, 3, 3)")
    if not (np.isfinite(p).all() and np.isfinite(R).all()):
        raise ValueError("p_HP or R_HP contains NaN or infinite numbers")
    if not len(p):
        return p, R
    off = np.abs(R.swapaxes(1, 2) @ R - np.eye(3)).max(axis=(1, 2))
    if off.max() > 1e-9 or np.linalg.det(R).min() < 0.0:
        raise ValueError(f"R_HP is no rotation in row {int(off.argmax())}")
    if R[:, 2, 2].min() <= np.sqrt(0.5):
        tilt = np.degrees(np.arccos(R[:, 2, 2].min()))
        raise ValueError(f"the peg is tilted by {tilt:.1f} deg, expected less than 45 deg")
    return p, R
