"""Exact contact geometry of a flat-ended cylindrical peg and a chamfered blind bore.

Computes gaps, contact points and normals, and the contact label of a pose. It uses no meshes and no simulation, so it
serves as the reference for simulated contact and for learnt contact states.

Along each generatrix of the peg, the distance from the bore's axis is a convex function, so its maximum is at an end.
The closest points of the two bodies, or their deepest overlap, therefore lie on one of three circles: the rim of the
peg's tip (against the surfaces of the bore), or the outer or inner edge of the chamfer (against the peg). On each
circle the distance is a closed-form function of one angle, which is minimised numerically. This holds for tilts below
45 degrees, where the peg's side cannot lie flat on the chamfer.

Frames: H has its origin at the centre of the mouth and z out of the hole. P has its origin at the centre of the tip
face and z along the peg, away from the tip. The top face of the block is unbounded and the peg is infinitely long.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models import Array
from models.labelled_enum import LabelledEnum

SAMPLES = 256
"""Number of angles at which a circle is sampled. The gap has kinks where two surfaces of the bore are equally near, and
two kinks can be 0.2 rad apart. Of 60,000 poses near the chamfer, 64 samples miss one minimum and 128 miss none."""

MINIMA = 4
"""Number of local minima that are kept on each circle."""

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
GOLDEN_STEPS = 48
"""Number of golden-section steps; they shrink a bracket of two sample distances to 5e-12 rad."""

TINY = 1e-300
"""Minimum of a denominator, so that 0/0 gives 0."""

GapFunction = Callable[[Array], tuple[Any, ...]]
"""Maps angles (n, k) on a circle to the fields of `Contacts` at these angles."""


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
    """Candidate contacts of n poses, m = 16 for each: `MINIMA` on each circle and `MINIMA` against the floor.

    Attributes:
        gap: Signed gaps (n, m), m. Negative where the bodies overlap, infinite where a circle has fewer minima.
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
    """Peg and bore, given by their sizes.

    Attributes:
        peg_radius: Radius r of the peg, m.
        hole_radius: Radius R of the bore, m.
        hole_depth: Depth from mouth to floor, m.
        chamfer: Width and height of the 45 degree chamfer, m; 0 for a sharp edge.

    Raises:
        ValueError: If a size is not positive and finite, or the chamfer is not smaller than the depth.
    """

    peg_radius: float
    hole_radius: float
    hole_depth: float
    chamfer: float = 0.0

    def __post_init__(self) -> None:
        sizes = (self.peg_radius, self.hole_radius, self.hole_depth)
        if not (all(np.isfinite(sizes)) and min(sizes) > 0 and 0 <= self.chamfer < self.hole_depth):
            raise ValueError(
                f"peg radius {self.peg_radius}, hole radius {self.hole_radius}, depth {self.hole_depth}, chamfer"
                f" {self.chamfer} (m): expected positive sizes and a chamfer smaller than the depth"
            )

    def contacts(self, p_HP: ArrayLike, axis_H: ArrayLike) -> Contacts:
        """Returns the candidate contacts of every pair of features.

        Args:
            p_HP: Centres of the tip (n, 3), m.
            axis_H: Unit vectors (n, 3) along the peg's axis, away from the tip, less than 45 degrees from z of H.

        Raises:
            ValueError: If a shape is wrong, a number is NaN or infinite, an axis is not a unit vector, or a tilt is
                too large.
        """
        p, a = _checked_poses(p_HP, axis_H)
        parts = []
        for evaluate in (self._rim_function(p, a), self._floor_function(p, a), *self._edge_functions(p, a)):
            angle = _minima(evaluate, len(p))
            gap, *rest = evaluate(np.nan_to_num(angle))
            parts.append((np.where(np.isnan(angle), np.inf, gap), *rest))
        return Contacts(*(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)))

    def gap(self, p_HP: ArrayLike, axis_H: ArrayLike) -> Array:
        """Returns the signed gap (n,), m: the distance between peg and block, or minus their deepest overlap."""
        return np.asarray(self.contacts(p_HP, axis_H).gap.min(axis=1))

    def label(self, p_HP: ArrayLike, axis_H: ArrayLike, *, tolerance: float = 0.0) -> NDArray[np.intp]:
        """Returns the `ContactLabel` of each pose (n,).

        Args:
            p_HP: See `contacts`.
            axis_H: See `contacts`.
            tolerance: Largest gap that counts as contact, m.
        """
        return label_contacts(self.contacts(p_HP, axis_H), tolerance=tolerance)

    def _rim(self, p: Array, a: Array) -> Callable[[Array], Array]:
        """Returns a function from angles (n, k) to points (n, k, 3) on the rim of the tip."""
        u, v = _across(a)

        def rim(angle: Array) -> Array:
            t = angle[..., None]
            return np.asarray(p[:, None] + self.peg_radius * (np.cos(t) * u[:, None] + np.sin(t) * v[:, None]))

        return rim

    def _rim_function(self, p: Array, a: Array) -> GapFunction:
        """Returns the gap of the tip's rim to face, chamfer and wall."""
        rim = self._rim(p, a)

        def evaluate(angle: Array) -> tuple[Any, ...]:
            q = rim(angle)
            gap, n_x, n_y, n_z, nearest = rim_gap(self.hole_radius, self.chamfer, q[..., 0], q[..., 1], q[..., 2])
            normal = np.stack([n_x, n_y, n_z], axis=-1)
            return gap, q - gap[..., None] * normal, normal, np.zeros(gap.shape, dtype=bool), nearest.astype(np.intp)

        return evaluate

    def _floor_function(self, p: Array, a: Array) -> GapFunction:
        """Returns the gap of the tip's rim to the floor, which is treated as unbounded."""
        rim = self._rim(p, a)

        def evaluate(angle: Array) -> tuple[Any, ...]:
            q = rim(angle)
            gap = q[..., 2] + self.hole_depth
            up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), q.shape)
            kind = np.full(gap.shape, np.intp(Surface.RIM_FLOOR))
            return gap, q - gap[..., None] * up, up, np.zeros(gap.shape, dtype=bool), kind

        return evaluate

    def _edge_functions(self, p: Array, a: Array) -> list[GapFunction]:
        """Returns the gaps of the outer and the inner edge of the chamfer to the peg."""

        def edge_function(radius: float, height: float, kind: Surface) -> GapFunction:
            def evaluate(angle: Array) -> tuple[Any, ...]:
                e = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full_like(angle, height)], axis=-1)
                d = np.moveaxis(e - p[:, None], -1, 0)
                gap, n_x, n_y, n_z, side = edge_gap(self.peg_radius, *d, *a.T[..., None])
                return gap, e, np.stack([n_x, n_y, n_z], axis=-1), side, np.full(angle.shape, np.intp(kind))

            return evaluate

        R, c = self.hole_radius, self.chamfer
        return [edge_function(R + c, 0.0, Surface.OUTER_EDGE), edge_function(R, -c, Surface.INNER_EDGE)]


def rim_gap(R: float, c: float, x: Any, y: Any, z: Any) -> tuple[Any, ...]:
    """Returns the gap of points to face, chamfer and wall of the bore, the normal, and the nearest surface.

    These bound a convex region in (rho, z). The wall is treated as infinitely deep. Like `edge_gap`, this is written
    without branches, for arrays of any shape and, compiled, for single points (`systems.plant.exact_contact`).

    Args:
        R: Radius of the bore, m.
        c: Width and height of the chamfer, m.
        x: First coordinate of the points in H, m.
        y: Second coordinate, m.
        z: Third coordinate, m.

    Returns:
        Gap, m; the normal's three components in H; and the number of the nearest `Surface`: 0, 1 or 2.
    """
    half = math.sqrt(0.5)
    rho = np.sqrt(x * x + y * y)

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

    face, near_face, face_rho, face_z = to_piece(rho - R - c, z, 1.0, 0.0, 0.0, 1.0, np.inf)
    slope, near_slope, slope_rho, slope_z = to_piece(rho - R, z + c, half, half, -half, half, c / half)
    wall, near_wall, wall_rho, wall_z = to_piece(rho - R, z + c, 0.0, -1.0, -1.0, 0.0, np.inf)
    inside = (face < 0.0) & (slope < 0.0) & (wall < 0.0)
    outside = 1 - inside
    # Inside a convex block, the nearest surface is the one with the smallest depth.
    d0 = outside * near_face - inside * face
    d1 = outside * near_slope - inside * slope
    d2 = outside * near_wall - inside * wall
    first = (d0 <= d1) & (d0 <= d2)
    second = (d1 < d0) & (d1 <= d2)
    third = 1 - first - second
    distance = first * d0 + second * d1 + third * d2
    n_rho = outside * (first * face_rho + second * slope_rho + third * wall_rho) - inside * (second * half + third)
    n_z = outside * (first * face_z + second * slope_z + third * wall_z) + inside * (first + second * half)
    across = n_rho / np.maximum(rho, TINY)
    return (outside - 1.0 * inside) * distance, across * x, across * y, n_z, second + 2 * third


def edge_gap(r: float, d_x: Any, d_y: Any, d_z: Any, a_x: Any, a_y: Any, a_z: Any) -> tuple[Any, ...]:
    """Returns the gap of points, such as those on an edge of the bore, to the infinitely long peg, and the normal.

    Args:
        r: Radius of the peg, m.
        d_x: First coordinate of the points relative to the centre of the tip, in H, m.
        d_y: Second coordinate, m.
        d_z: Third coordinate, m.
        a_x: First component of the unit vector along the peg, in H.
        a_y: Second component.
        a_z: Third component.

    Returns:
        Gap, m; the normal's three components in H; and `Contacts.side`.
    """
    along = d_x * a_x + d_y * a_y + d_z * a_z
    r_x, r_y, r_z = d_x - along * a_x, d_y - along * a_y, d_z - along * a_z
    off = np.sqrt(r_x * r_x + r_y * r_y + r_z * r_z)
    beside, below = off - r, -along
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


def axes_of_rotation_vectors(rotation: ArrayLike) -> Array:
    """Returns the peg's axes (n, 3) in H: the third column of R_HP by Rodrigues' formula.

    Args:
        rotation: Rotation vectors (n, 3) of R_HP, rad.
    """
    w = np.asarray(rotation, dtype=np.float64)
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    k = w / np.where(angle > 0.0, angle, 1.0)
    z = np.array([0.0, 0.0, 1.0])
    turned = np.cos(angle) * z + np.sin(angle) * np.cross(k, z)
    return np.asarray(turned + (1.0 - np.cos(angle)) * k[..., 2:3] * k)


def _across(a: Array) -> tuple[Array, Array]:
    """Returns two unit vectors (n, 3) that form a right-handed frame with the axes."""
    u = np.cross(np.array([0.0, 1.0, 0.0]), a)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(a, u)


def _minima(evaluate: GapFunction, n: int) -> Array:
    """Returns the angles (n, MINIMA) of the lowest local minima of a periodic function.

    Entries are NaN where there are fewer minima.
    """

    def f(angle: Array) -> Array:
        return np.asarray(evaluate(angle)[0])

    step = 2.0 * np.pi / SAMPLES
    grid = step * np.arange(SAMPLES)
    values = f(np.broadcast_to(grid, (n, SAMPLES)))
    lowest = (values <= np.roll(values, 1, axis=1)) & (values < np.roll(values, -1, axis=1))
    lowest[np.arange(n), values.argmin(axis=1)] = True
    ranked = np.where(lowest, values, np.inf)
    best = np.argsort(ranked, axis=1)[:, :MINIMA]
    exists = np.isfinite(np.take_along_axis(ranked, best, axis=1))
    low, high = step * (best - 1.0), step * (best + 1.0)
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


def _checked_poses(p_HP: ArrayLike, axis_H: ArrayLike) -> tuple[Array, Array]:
    """Returns both as arrays (n, 3); see `PegInHole.contacts` for the errors."""
    p, a = np.asarray(p_HP, dtype=np.float64), np.asarray(axis_H, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or a.shape != p.shape:
        raise ValueError(f"p_HP has shape {p.shape} and axis_H {a.shape}, expected (n, 3) for both")
    if not (np.isfinite(p).all() and np.isfinite(a).all()):
        raise ValueError("p_HP or axis_H contains NaN or infinite numbers")
    off = np.abs(np.linalg.norm(a, axis=1) - 1.0)
    if off.size and off.max() > 1e-9:
        raise ValueError(f"axis_H has length {1 + off.max():.9g} in row {int(off.argmax())}, expected unit vectors")
    if a.size and a[:, 2].min() <= np.sqrt(0.5):
        tilt = np.degrees(np.arccos(a[:, 2].min()))
        raise ValueError(f"axis_H is tilted by {tilt:.1f} deg, expected less than 45 deg")
    return p, a
