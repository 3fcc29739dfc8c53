"""A peg and its hole from two bodies: axis, outlines, clearance over depth and angle, chamfer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize

from models import Array
from models.cad.outline import Points, rounded_polygon
from models.cad.solid_file import Solid
from models.section import KIND, SIZE, SPAN, Section, X, Y, section_of

SAME = 5e-7
"""Largest difference of two lengths that count as one, m."""

THIN, THICK = 1.5e-3, 0.05
"""Range of the radius of the largest circle inside a peg, m."""

LOOSE = 0.2
"""Clearance over that radius from which on two parts do not belong together."""

RATIO = 4.0
"""A clearance of more than this times the smallest one does not guide the peg."""

UNEVEN = 2.0
"""Largest over smallest clearance around a peg whose hole can be simulated as its offset."""

INCH = 25.4
"""Length of an inch, mm."""

SHARES = (0.01, 0.99)
"""Where a stretch is cut, in parts of its height."""

ANGLES = 360
"""Number of angles about the axis at which the clearance is stated."""

FINE = 4096
"""Number of points of a full circle in a measured outline; their sagitta is 3e-7 of the radius."""

MAX_LEVELS = 200
"""Largest number of heights at which a part may change; curved sides have more."""


@dataclass(frozen=True)
class Stretch:
    """A part of a body along its axis, between two heights at which it has vertices.

    Attributes:
        low: height of its lower end, m.
        high: height of its upper end, m.
        below: outline near its lower end: corners of a polygon (n, 2), m; None where there is none.
        above: outline near its upper end.
    """

    low: float
    high: float
    below: Array | None
    above: Array | None

    @property
    def is_prismatic(self) -> bool:
        """Whether the outline is the same at both ends."""
        if self.below is None or self.above is None:
            return False
        return max(_farthest(self.below, self.above), _farthest(self.above, self.below)) < SAME


@dataclass(frozen=True)
class Mating:
    """A part of the depth in which peg and hole keep their outlines while the peg is fully inserted.

    Attributes:
        depths: of its ends below the mouth, m.
        tip: height of the end of this part of the peg above its tip, m.
        mouth: depth of the mouth of this part of the hole, with its lead-in, below the top, m.
        corners: of the peg, rows (x, y, radius), about its axis, m.
        clearance: (`ANGLES`,), distance of the peg from the hole at angles about the axis, m.
    """

    depths: tuple[float, float]
    tip: float
    mouth: float
    corners: Array
    clearance: Array

    @property
    def section(self) -> Section:
        """Section of the peg, m."""
        return section_of_corners(self.corners)

    @property
    def is_round(self) -> bool:
        """Whether the section is a circle."""
        pieces = self.section.pieces
        centres = pieces[:, X] + 1j * pieces[:, Y]
        return bool(
            (pieces[:, KIND] == 1.0).all() and np.ptp(pieces[:, SIZE]) + np.abs(centres - centres[0]).max() < SAME
        )


@dataclass(frozen=True)
class Fit:
    """How a peg fits into a hole.

    Attributes:
        axis: of the files along which the hole opens, such as "+z".
        moved: of the peg's file across the axis, so that the clearance is as even as possible, m.
        length: of the peg, m.
        tip: width of the chamfer of its tip, m.
        depth: of the hole, m.
        chamfer: width of its lead-in, m.
        chamfer_height: height of its lead-in, m.
        through: whether it goes through the block.
        block: half of the smallest width of the block, m.
        floor: thickness of the block below the hole, m.
        matings: from the mouth downwards.
    """

    axis: str
    moved: tuple[float, float]
    length: float
    tip: float
    depth: float
    chamfer: float
    chamfer_height: float
    through: bool
    block: float
    floor: float
    matings: list[Mating]

    @property
    def clearance(self) -> float:
        """The smallest clearance, m."""
        return min(float(mating.clearance.min()) for mating in self.matings)

    @property
    def guide(self) -> Mating:
        """The mating with the smallest clearance."""
        return min(self.matings, key=lambda mating: float(mating.clearance.min()))

    @property
    def steps(self) -> list[Mating]:
        """One mating of each size that guides the peg, from the tip upwards."""
        found: list[Mating] = []
        for mating in sorted(self.matings, key=lambda mating: mating.tip):
            guides = float(mating.clearance.min()) < RATIO * self.clearance
            if guides and all(abs(_mean_radius(mating.corners) - _mean_radius(own.corners)) > SAME for own in found):
                found.append(mating)
        return found


def fit(peg: Solid, block: Solid) -> Fit:
    """Measures how a peg fits into the hole of a block.

    Both are drawn as they are assembled, up to a shift: along the axis by any length, across it to where the clearance
    is most even.

    Raises:
        ValueError: naming the file and why the parts are no peg and hole.
    """
    axis, sign = _opening(block)
    frame = _frame(axis, sign)
    hole = _stretches(block, frame, inside=True)
    top = hole[-1].high
    bottom = next(stretch.low for stretch in hole if stretch.above is not None)
    through = bottom <= hole[0].low + SAME
    walls = [stretch for stretch in hole if stretch.is_prismatic]
    if not walls:
        raise ValueError(f"{block.path}: the hole is not prismatic: no part of it keeps its outline along the axis")
    shank = _stretches(peg, frame, inside=False)
    prisms = [stretch for stretch in shank if stretch.is_prismatic]
    if not prisms:
        raise ValueError(f"{peg.path}: the peg is not prismatic: no part of it keeps its outline along the axis")
    tip, depth = shank[0].low, top - bottom
    # The peg's part and the hole's, depths of the ends, height of the tip, depth of the mouth.
    pairs: list[tuple[Array, Array, tuple[float, float], float, float]] = []
    for wall in walls:
        for prism in prisms:
            low = max(wall.low, bottom + prism.low - tip)
            high = min(wall.high, bottom + prism.high - tip)
            if high - low > SAME:
                over = [stretch for stretch in hole if stretch.low >= wall.high - SAME]
                mouth = over[0].high if over and not over[0].is_prismatic else wall.high
                own, other, depths = _outline(peg, prism), _outline(block, wall), (top - high, top - low)
                pairs.append((own, other, depths, prism.low - tip, top - mouth))
    if not pairs:
        raise ValueError(f"{peg.path}: no prismatic part of the peg reaches a prismatic part of the hole")
    _check_units(peg, block, pairs[0][0], pairs[0][1])
    tight = min(pairs, key=lambda pair: _mean_radius(pair[1]) - _mean_radius(pair[0]))
    moved = _evenly(tight[0], tight[1])
    centre = _centre(tight[0])
    matings = [
        Mating(depths, end, mouth, _moved(own, -centre), _clearance(_moved(own, moved), other, centre + moved))
        for own, other, depths, end, mouth in sorted(pairs, key=lambda pair: pair[2])
    ]
    tip_edge = shank[: next(k for k, stretch in enumerate(shank) if stretch.is_prismatic)]
    lead_in = hole[1 + max(k for k, stretch in enumerate(hole) if stretch.is_prismatic) :]
    found = Fit(
        axis=f"{'+' if sign > 0 else '-'}{'xyz'[axis]}",
        moved=(moved.real, moved.imag),
        length=shank[-1].high - tip,
        tip=sum((_widening(stretch) for stretch in tip_edge), 0.0),
        depth=depth,
        chamfer=sum((_widening(stretch) for stretch in lead_in), 0.0),
        chamfer_height=sum((stretch.high - stretch.low for stretch in lead_in), 0.0),
        through=through,
        block=0.5 * float(np.ptp(block.vertices @ frame[:2].T, axis=0).min()),
        floor=bottom - hole[0].low,
        matings=matings,
    )
    _check(found, peg, block)
    return found


def _check(found: Fit, peg: Solid, block: Solid) -> None:
    """Raises a ValueError if peg and hole interfere, do not belong together, or need another model."""
    guide = found.guide
    size, smallest = guide.section.inner_radius, found.clearance
    if not THIN <= size <= THICK:
        raise ValueError(
            f"{peg.path}: the largest circle inside has a radius of {1e3 * size:.4g} mm, expected {1e3 * THIN:g} to"
            f" {1e3 * THICK:g} mm; is the file in inches? Then give --unit inch"
        )
    if smallest <= 0.0:
        at = int(guide.clearance.argmin())
        raise ValueError(
            f"{peg.path} and {block.path}: they interfere by {-1e6 * smallest:.1f} um, at {at} deg about the axis and"
            f" {1e3 * guide.depths[0]:.2f} to {1e3 * guide.depths[1]:.2f} mm below the mouth"
        )
    if smallest > LOOSE * size:
        raise ValueError(
            f"{peg.path} and {block.path}: a clearance of {1e3 * smallest:.3g} mm at a radius of {1e3 * size:.3g} mm;"
            " expected a peg and its own hole"
        )
    if guide.clearance.max() > UNEVEN * smallest:
        raise ValueError(
            f"{peg.path} and {block.path}: the clearance around the peg is {1e6 * smallest:.4g} to"
            f" {1e6 * guide.clearance.max():.4g} um, expected a largest one of at most {UNEVEN:g} times the smallest"
        )
    others = [mating for mating in found.steps if not mating.is_round]
    if len(found.steps) > 1 and others:
        sizes = " and ".join(f"{1e3 * mating.section.inner_radius:.3f}" for mating in found.steps)
        raise ValueError(
            f"{peg.path} and {block.path}: sections of several sizes guide the peg, {sizes} mm inside, and one is not"
            " round; expected one size, or round steps"
        )


def _opening(block: Solid) -> tuple[int, int]:
    """Returns the axis along which a block has a hole, and the sign of the direction in which it opens."""
    for axis in range(3):
        for sign in (1, -1):
            frame = _frame(axis, sign)
            below, top = block.levels(frame[2])[-2:]
            loops = block.loops(frame[2], frame[0], frame[1], below + SHARES[1] * (top - below))
            if any(_signed_area(loop) < 0.0 for loop in loops):
                return axis, sign
    raise ValueError(f"{block.path}: no hole that opens along x, y or z, with material all around it")


def _frame(axis: int, sign: int) -> Array:
    """Returns the unit vectors x, y, z (3, 3) of a right-handed frame whose z is an axis of the files, up to a sign."""
    unit = np.eye(3)
    if sign > 0:
        return np.array([unit[(axis + 1) % 3], unit[(axis + 2) % 3], unit[axis]])
    return np.array([unit[(axis + 2) % 3], unit[(axis + 1) % 3], -unit[axis]])


def _stretches(solid: Solid, frame: Array, *, inside: bool) -> list[Stretch]:
    """Returns the stretches of a body from the bottom up: of its outer outline, or of the one hole in it.

    Raises:
        ValueError: if the body has several outlines at one height, or too many heights.
    """
    levels = solid.levels(frame[2])
    if len(levels) > MAX_LEVELS:
        raise ValueError(
            f"{solid.path}: not prismatic: it changes at {len(levels)} heights, expected {MAX_LEVELS} at most"
        )
    found = []
    for low, high in pairwise(levels):
        ends = [_one(solid, frame, low + share * (high - low), inside=inside) for share in SHARES]
        found.append(Stretch(float(low), float(high), *ends))
    return found


def _one(solid: Solid, frame: Array, height: float, *, inside: bool) -> Array | None:
    """Returns the outline at a height, counter-clockwise, or None."""
    loops = solid.loops(frame[2], frame[0], frame[1], height)
    inner = [loop[::-1] for loop in loops if _signed_area(loop) < 0.0]
    outer = [loop for loop in loops if _signed_area(loop) > 0.0]
    if len(outer) > 1 or len(inner) > 1 or (inner and not inside):
        what = "holes" if inside else "separate or hollow outlines"
        raise ValueError(
            f"{solid.path}: {max(len(inner), len(outer))} {what} at the height {1e3 * height:.3f} mm, expected one"
        )
    chosen = inner if inside else outer
    return chosen[0] if chosen else None


def _signed_area(points: Array) -> float:
    after = np.roll(points, -1, axis=0)
    return 0.5 * float((points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]).sum())


def _farthest(points: Array, outline: Array) -> float:
    """Largest distance of points (n, 2) from a polygon (m, 2)."""
    return float(_distances(points[:, 0] + 1j * points[:, 1], outline[:, 0] + 1j * outline[:, 1]).max())


def _distances(points: Points, outline: Points) -> Array:
    """Distances (n,) of points x + i y from the sides of a polygon (m,)."""
    side = np.roll(outline, -1) - outline
    share = ((points[:, None] - outline) * side.conj()).real / np.abs(side) ** 2
    return np.asarray(np.abs(points[:, None] - outline - np.clip(share, 0.0, 1.0) * side).min(axis=1))


def _outline(solid: Solid, stretch: Stretch) -> Array:
    """Returns the corners (x, y, radius) of the outline of a prismatic stretch in the axes of its file, m."""
    assert stretch.below is not None
    corners = np.array([[z.real, z.imag, radius] for z, radius in rounded_polygon(stretch.below)])
    try:
        section_of_corners(_moved(corners, -_centroid(stretch.below)))
    except ValueError as error:
        raise ValueError(f"{solid.path}: {error}") from None
    return corners


def section_of_corners(corners: Array) -> Section:
    """Returns the section of the polygon with the corners (x, y, radius) (n, 3), m.

    Raises:
        ValueError: see `section_of`.
    """
    size = float(np.abs(corners[:, :2]).max())
    return section_of((corners / size).tolist()).scaled(size)


def _moved(corners: Array, by: complex) -> Array:
    return np.asarray(corners + np.array([by.real, by.imag, 0.0]))


def _centre(corners: Array) -> complex:
    """Returns where the axis of an outline is: the centre of a circle of which it has half, or of its area."""
    section, middle = _about_centroid(corners)
    pieces = section.pieces
    arcs = pieces[pieces[:, KIND] == 1.0]
    for arc in arcs:
        same = np.abs(arcs[:, [X, Y, SIZE]] - arc[[X, Y, SIZE]]).max(axis=1) < SAME
        if arcs[same, SPAN].sum() > math.pi:
            return middle + complex(arc[X], arc[Y])
    return middle + _centroid(section.polyline(FINE))


def _about_centroid(corners: Array) -> tuple[Section, complex]:
    """Returns the section about the centre of the polygon of its corners, from where its sides are seen, and that."""
    middle = _centroid(corners)
    return section_of_corners(_moved(corners, -middle)), middle


def _centroid(points: Array) -> complex:
    """Returns the centre of the area of a polygon (n, 2 or more)."""
    z = points[:, 0] + 1j * points[:, 1]
    inside = z.mean()
    z = z - inside
    after = np.roll(z, -1)
    cross = (z.conj() * after).imag
    return complex(inside + ((z + after) * cross).sum() / (3.0 * cross.sum()))


def _points(corners: Array) -> Points:
    """Points x + i y of an outline, dense on its arcs."""
    section, middle = _about_centroid(corners)
    points = section.polyline(FINE)
    return np.asarray(points[:, 0] + 1j * points[:, 1] + middle)


def _mean_radius(corners: Array) -> float:
    return math.sqrt(_about_centroid(corners)[0].area / math.pi)


def _evenly(own: Array, other: Array) -> complex:
    """Returns the shift of the peg's outline with which its distance from the hole's is most even."""
    peg, hole = _points(own), _points(other)
    spread = np.linspace(0, len(peg), 180, endpoint=False).astype(int)
    first = _centre(other) - _centre(own)

    def unevenness(shift: Array) -> float:
        return float(np.var(1e6 * _distances(peg[spread] + first + 1e-6 * complex(*shift), hole)))

    found = minimize(unevenness, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-9})
    shift = first + 1e-6 * complex(*found.x)
    return 0j if abs(shift) < SAME else shift


def _clearance(own: Array, other: Array, centre: complex) -> Array:
    """Returns the distance (`ANGLES`,) of a peg's outline from the hole's by angle about a centre; negative inside."""
    peg, hole = _points(own) - centre, _points(other) - centre
    angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
    at = _at_angles(peg, angles)
    return np.asarray(np.where(np.abs(at) <= np.abs(_at_angles(hole, angles)), 1.0, -1.0) * _distances(at, hole))


def _at_angles(outline: Points, angles: Array) -> Points:
    """Returns the points (n,) of an outline around 0 that are seen from there at angles, rad."""
    closed = np.append(outline, outline[0])
    seen = np.unwrap(np.angle(closed))
    turned = seen[0] + np.mod(angles - seen[0], 2.0 * np.pi)
    k = np.clip(np.searchsorted(seen, turned, side="right") - 1, 0, len(outline) - 1)
    a, b = outline[k], closed[k + 1]
    ray = np.exp(1j * angles)
    return np.asarray((a.conj() * b).imag / (ray.conj() * (b - a)).imag * ray)


def _widening(stretch: Stretch) -> float:
    """Returns by how much the outline of a stretch moves outwards from one end to the other, m."""
    if stretch.below is None or stretch.above is None:
        return 0.0
    ends = [points @ [1.0, 1j] for points in (stretch.below, stretch.above)]
    around = sum(np.abs(np.roll(z, -1) - z).sum() for z in ends) / 2.0
    grown = abs(_signed_area(stretch.above) - _signed_area(stretch.below))
    return float(grown / around / (SHARES[1] - SHARES[0]))


def _check_units(peg: Solid, block: Solid, own: Array, other: Array) -> None:
    """Raises a ValueError if one file seems to be in inches and the other in millimetres."""
    ratio = _mean_radius(own) / _mean_radius(other)
    for factor, path in ((INCH, block.path), (1.0 / INCH, peg.path)):
        if abs(ratio / factor - 1.0) < 0.1:
            raise ValueError(
                f"{peg.path} and {block.path}: the peg is {ratio:.3g} times as wide as the hole; {path} seems to be in"
                " inches"
            )
