"""Exact contact between a flat-ended cylinder and a chamfered blind bore: gaps, points, normals, and a name for it.

No meshes and no simulation: this is what simulated contact and discovered contact states are judged by.

Along each of the peg's generatrices the distance from the bore's axis is a convex function, so it is greatest at an
end. Two bodies therefore come closest, or overlap most, at one of three circles: the rim of the peg's tip against
the surfaces of the bore, or one of the two edges of the bore (outer and inner edge of the chamfer) against the peg. On
each circle the distance has a closed form; it is minimised over the one angle that is left. This holds for tilts
below 45 degrees, where the peg's side cannot lie flat on the chamfer.

Frames as everywhere: H, origin at the centre of the mouth, z out of the hole; P, origin at the centre of the tip
face, z along the peg away from the tip. The block's top face is unbounded and the peg is endless.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.arrays import Array

SAMPLES = 256
"""Angles at which a circle is searched. Where two surfaces of the bore are equally near the gap has kinks, two of
which can be a fifth of a radian apart; of 60,000 poses round the chamfer 64 samples miss one, 128 none."""

MINIMA = 4
"""Kept of each circle."""

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
GOLDEN_STEPS = 48
"""Shrink the bracket of two sample distances to 5e-12 rad."""


TINY = 1e-300
"""Keeps a quotient of zeros zero."""

GapFunction = Callable[[Array], tuple[Any, ...]]
"""Of angles (n, k) on a circle: the fields of `Contacts` there."""


class ContactLabel(IntEnum):
    """The contact state by geometry alone; ``label`` is its name for a person."""

    label: str

    FREE = 0, "free"
    FACE = 1, "on the face"
    CHAMFER = 2, "on the chamfer"
    MOUTH = 3, "one point at the mouth"
    TIP = 4, "one point at the tip"
    TWO_POINT = 5, "two-point contact"
    LINE = 6, "line contact"
    SEATED = 7, "seated"

    def __new__(cls, value: int, label: str = "") -> Self:
        """A member of this number and label."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.label = label
        return member


class Surface(IntEnum):
    """What touches what: the rim of the tip the nearest surface of the bore, or an edge of the bore the peg."""

    RIM_FACE = 0
    RIM_CHAMFER = 1
    RIM_WALL = 2
    RIM_FLOOR = 3
    OUTER_EDGE = 4
    INNER_EDGE = 5


@dataclass(frozen=True)
class Contacts:
    """Closest places of n poses, m = 16 to a pose: `MINIMA` on each circle, and as many against the floor.

    Attributes:
        gap: (n, m), m; negative where the bodies overlap, infinite where a circle has fewer minima.
        point: (n, m, 3), on the bore, in H, m.
        normal: (n, m, 3), unit, in H: the direction in which the bore pushes the peg.
        side: (n, m), whether it is the peg's side (not its tip face or rim) that an edge of the bore meets.
        surface: (n, m), `Surface` of each place.
    """

    gap: Array
    point: Array
    normal: Array
    side: NDArray[np.bool_]
    surface: NDArray[np.intp]

    def points_on_peg(self) -> Array:
        """(n, m, 3), in H, m."""
        gap = np.where(np.isfinite(self.gap), self.gap, 0.0)
        return self.point + self.normal * gap[..., None]


@dataclass(frozen=True)
class PegInHole:
    """Sizes in m.

    Attributes:
        peg_radius: r.
        hole_radius: R.
        hole_depth: from mouth to floor.
        chamfer: width and height of the 45 degree chamfer; 0 for a sharp edge.
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

    # ------------------------------------------------------------------ what is asked

    def contacts(self, p_HP: ArrayLike, axis_H: ArrayLike) -> Contacts:
        """Closest places of every pair of surfaces.

        Args:
            p_HP: (n, 3), centre of the tip, m.
            axis_H: (n, 3), unit, the peg's axis away from the tip; tilted less than 45 degrees from z of H.

        Raises:
            ValueError: if the shapes differ from these, or a number is not finite, or the tilt is too large.
        """
        p, a = _checked_poses(p_HP, axis_H)
        parts = []
        for evaluate in (self._rim_function(p, a), self._floor_function(p, a), *self._edge_functions(p, a)):
            angle = _minima(evaluate, len(p))
            gap, *rest = evaluate(np.nan_to_num(angle))
            parts.append((np.where(np.isnan(angle), np.inf, gap), *rest))
        return Contacts(*(np.concatenate(columns, axis=1) for columns in zip(*parts, strict=True)))

    def gap(self, p_HP: ArrayLike, axis_H: ArrayLike) -> Array:
        """Signed gap (n,), m: the distance between peg and block, or minus their deepest overlap."""
        return np.asarray(self.contacts(p_HP, axis_H).gap.min(axis=1))

    def label(self, p_HP: ArrayLike, axis_H: ArrayLike, *, tolerance: float = 0.0) -> NDArray[np.intp]:
        """`ContactLabel` of each pose (n,).

        Args:
            p_HP: as for `contacts`.
            axis_H: as for `contacts`.
            tolerance: largest gap, in m, that counts as touching.
        """
        return label_contacts(self.contacts(p_HP, axis_H), tolerance=tolerance)

    # ------------------------------------------------------------------ distances on a circle

    def _rim(self, p: Array, a: Array) -> Callable[[Array], Array]:
        """Of an angle (n, k): points (n, k, 3) on the rim of the tip."""
        u, v = _across(a)

        def rim(angle: Array) -> Array:
            t = angle[..., None]
            return np.asarray(p[:, None] + self.peg_radius * (np.cos(t) * u[:, None] + np.sin(t) * v[:, None]))

        return rim

    def _rim_function(self, p: Array, a: Array) -> GapFunction:
        """The rim against face, chamfer and wall, whose block is convex in (rho, z); the wall has no lower end."""
        rim, R, c, half = self._rim(p, a), self.hole_radius, self.chamfer, np.sqrt(0.5)
        # Origin, direction, normal into the open and end of each piece, in `Surface`'s order; they start at 0.
        pieces = (
            ((R + c, 0.0), (1.0, 0.0), (0.0, 1.0), np.inf),
            ((R, -c), (half, half), (-half, half), c / half),
            ((R, -c), (0.0, -1.0), (-1.0, 0.0), np.inf),
        )

        def evaluate(angle: Array) -> tuple[Any, ...]:
            q = rim(angle)
            rho = np.hypot(q[..., 0], q[..., 1])
            signed, distance, normals = [], [], []
            for origin, direction, normal, end in pieces:
                x, z = rho - origin[0], q[..., 2] - origin[1]
                t = x * direction[0] + z * direction[1]
                past = t - np.clip(t, 0.0, end)
                depth = x * normal[0] + z * normal[1]
                away = np.hypot(depth, past)
                unit = [
                    np.where(past == 0.0, m, (depth * m + past * d) / np.maximum(away, TINY))
                    for m, d in zip(normal, direction, strict=True)
                ]
                signed.append(depth)
                distance.append(away)
                normals.append(unit)
            depths = np.stack(signed)
            inside = (depths < 0.0).all(axis=0)
            # Inside a convex block the nearest surface is the one with the least depth, and the foot is on it.
            nearest = np.where(inside, depths.argmax(axis=0), np.stack(distance).argmin(axis=0))
            gap = np.where(inside, depths.max(axis=0), np.stack(distance).min(axis=0))
            flat = np.array([piece[2] for piece in pieces])[nearest]
            n = np.take_along_axis(np.array(normals), nearest[None, None], axis=0)[0]
            n_rho, n_z = np.where(inside, np.moveaxis(flat, -1, 0), n)
            n_x, n_y = n_rho * q[..., 0] / np.maximum(rho, TINY), n_rho * q[..., 1] / np.maximum(rho, TINY)
            normal_H = np.stack([n_x, n_y, n_z], axis=-1)
            return gap, q - gap[..., None] * normal_H, normal_H, np.zeros(gap.shape, dtype=bool), nearest

        return evaluate

    def _floor_function(self, p: Array, a: Array) -> GapFunction:
        """The rim against the floor, which has no end."""
        rim = self._rim(p, a)

        def evaluate(angle: Array) -> tuple[Any, ...]:
            q = rim(angle)
            gap = q[..., 2] + self.hole_depth
            up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), q.shape)
            kind = np.full(gap.shape, np.intp(Surface.RIM_FLOOR))
            return gap, q - gap[..., None] * up, up, np.zeros(gap.shape, dtype=bool), kind

        return evaluate

    def _edge_functions(self, p: Array, a: Array) -> list[GapFunction]:
        """The outer and the inner edge of the chamfer against the peg."""

        def of(radius: float, height: float, kind: Surface) -> GapFunction:
            def evaluate(angle: Array) -> tuple[Any, ...]:
                heights = np.full_like(angle, height)
                e = np.stack([radius * np.cos(angle), radius * np.sin(angle), heights], axis=-1)
                return *self._edge_to_peg(e, p[:, None], a[:, None]), np.full(angle.shape, np.intp(kind))

            return evaluate

        R, c = self.hole_radius, self.chamfer
        return [of(R + c, 0.0, Surface.OUTER_EDGE), of(R, -c, Surface.INNER_EDGE)]

    def _edge_to_peg(self, e: Array, p: Array, a: Array) -> tuple[Any, ...]:
        """Distance of points e from the endless cylinder, and what it is measured along."""
        along = np.einsum("...i,...i", e - p, a)
        radial = (e - p) - along[..., None] * a
        off = np.linalg.norm(radial, axis=-1)
        outward = radial / np.maximum(off, TINY)[..., None]
        beside = off - self.peg_radius
        below = -along
        gap = np.where(below <= 0.0, np.maximum(beside, below), np.where(beside <= 0.0, below, np.hypot(beside, below)))
        side = (below <= 0.0) & (beside >= below)
        corner = (below > 0.0) & (beside > 0.0)
        w = np.where(corner, beside / np.maximum(gap, TINY), side)[..., None]
        h = np.where(corner, below / np.maximum(gap, TINY), ~side)[..., None]
        return gap, e, h * a - w * outward, side


def label_contacts(contacts: Contacts, *, tolerance: float = 0.0) -> NDArray[np.intp]:
    """`ContactLabel` (n,) of contacts whose gap is at most ``tolerance`` m.

    A tip that stands on the floor is seated whatever else touches; one that has not passed the chamfer is on the
    chamfer or the face, whichever it presses harder. Inside, the inner edge of the chamfer is the mouth: contact there
    and at the tip is two-point contact on opposite sides of the bore, line contact on the same side.
    """
    on = contacts.gap <= tolerance
    kind = contacts.surface

    def deepest(chosen: NDArray[np.bool_]) -> Array:
        return np.where(chosen, contacts.gap, np.inf).min(axis=1)

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
    """The peg's axis (n, 3) in H from rotation vectors (n, 3) of R_HP, rad: the third column, by Rodrigues."""
    w = np.asarray(rotation, dtype=np.float64)
    angle = np.linalg.norm(w, axis=-1, keepdims=True)
    k = w / np.where(angle > 0.0, angle, 1.0)
    z = np.array([0.0, 0.0, 1.0])
    turned = np.cos(angle) * z + np.sin(angle) * np.cross(k, z)
    return np.asarray(turned + (1.0 - np.cos(angle)) * k[..., 2:3] * k)


def _across(a: Array) -> tuple[Array, Array]:
    """Two unit vectors (n, 3) that make a right-handed frame with the axes."""
    u = np.cross(np.array([0.0, 1.0, 0.0]), a)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u, np.cross(a, u)


def _minima(evaluate: GapFunction, n: int) -> Array:
    """Angles (n, MINIMA) of the lowest local minima of a periodic function; NaN where there is no second one."""

    def f(angle: Array) -> Array:
        return np.asarray(evaluate(angle)[0])

    step = 2.0 * np.pi / SAMPLES
    grid = step * np.arange(SAMPLES)
    values = f(np.broadcast_to(grid, (n, SAMPLES)))
    lowest = (values <= np.roll(values, 1, axis=1)) & (values < np.roll(values, -1, axis=1))
    lowest[np.arange(n), values.argmin(axis=1)] = True
    ranked = np.where(lowest, values, np.inf)
    best = np.argsort(ranked, axis=1)[:, :MINIMA]
    there = np.isfinite(np.take_along_axis(ranked, best, axis=1))
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
    return np.where(there, 0.5 * (low + high), np.nan)


def _checked_poses(p_HP: ArrayLike, axis_H: ArrayLike) -> tuple[Array, Array]:
    p, a = np.asarray(p_HP, dtype=np.float64), np.asarray(axis_H, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or a.shape != p.shape:
        raise ValueError(f"p_HP has shape {p.shape} and axis_H {a.shape}, expected (n, 3) both")
    if not (np.isfinite(p).all() and np.isfinite(a).all()):
        raise ValueError("p_HP or axis_H has a number that is not finite")
    off = np.abs(np.linalg.norm(a, axis=1) - 1.0)
    if off.size and off.max() > 1e-9:
        raise ValueError(f"axis_H has length {1 + off.max():.9g} in row {int(off.argmax())}, expected unit vectors")
    if a.size and a[:, 2].min() <= np.sqrt(0.5):
        tilt = np.degrees(np.arccos(a[:, 2].min()))
        raise ValueError(f"axis_H is tilted by {tilt:.1f} deg, expected less than 45 deg")
    return p, a
