"""A peg and a hole of several sections that mate: the steps of a shaft, or the pins of a plug.

All sections of the peg are rigidly joined, and so are those of the hole. A part that mates in one section is the
special case of one. Frames H and P are those of `models.exact_geometry`; P is at the tip that is furthest in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models import Array
from models.contact_bodies import Bodies, Mate
from models.exact_geometry import contact_labels, lowest_gaps
from models.meshes import TriangleMesh, make_hole, make_prism
from models.section import section_of


@dataclass(frozen=True)
class Assembly:
    """Peg and hole.

    Attributes:
        fits: the mates that fit with the clearance.
        passes: those of a section that goes through the wider hole above its own.
    """

    fits: tuple[Mate, ...]
    passes: tuple[Mate, ...]

    @classmethod
    def of(cls, geometry: Any) -> Self:
        """Returns peg and hole of `models.scenario.Geometry`, or of what was stored of it with a recording.

        Raises:
            ValueError: if a shape or a row of ``mates`` describes no peg and hole; the message names it.
        """
        shape, clearance = section_of(geometry.corners or geometry.section), geometry.hole_radius - geometry.peg_radius
        rows = [Row(*row) for row in geometry.mates] or [Row(0.0, 0.0, geometry.peg_radius, 0.0, 0.0)]
        if geometry.mates:
            _check(rows, geometry, shape.outer_radius)
        fits, passes = [], []
        for row in rows:
            wider = [other for other in rows if row.holds(other)]
            narrower = [other for other in rows if other.holds(row)]
            peg, depth = shape.scaled(row.radius), geometry.hole_depth - row.mouth
            top = min([other.tip for other in wider], default=geometry.peg_length)
            bottom = -min([other.mouth for other in narrower], default=geometry.hole_depth)
            tip, mouth = np.array([row.x, row.y, row.tip]), np.array([row.x, row.y, -row.mouth])
            fits.append(Mate(peg, peg.offset(clearance), depth, geometry.chamfer, tip, mouth, top, bottom))
            for other in wider:
                # The floor belongs to the narrower hole.
                hole = shape.scaled(other.radius).offset(clearance)
                mouth = np.array([row.x, row.y, -other.mouth])
                passes.append(replace(fits[-1], hole=hole, depth=2.0 * geometry.hole_depth, mouth=mouth))
        return cls(tuple(fits), tuple(passes))

    @property
    def mates(self) -> tuple[Mate, ...]:
        """All mates."""
        return self.fits + self.passes

    @cached_property
    def reach(self) -> float:
        """Radius of a circle about the axis that holds the peg, m; the smallest one if it is centred."""
        return max(math.hypot(*mate.tip[:2]) + mate.peg.outer_radius for mate in self.fits)

    @cached_property
    def mouth_reach(self) -> float:
        """The same of the mouth, with its chamfer, m."""
        return max(math.hypot(*mate.mouth[:2]) + mate.hole.offset(mate.chamfer).outer_radius for mate in self.fits)

    @cached_property
    def volume(self) -> float:
        """Volume of the peg, m^3."""
        return float(sum(mate.peg.area * (mate.top - mate.tip[2]) for mate in self.fits))

    @cached_property
    def bodies(self) -> Bodies:
        """What the contact search takes, without a law of the contact."""
        return Bodies.of_mates(self.mates)

    def gap(self, p_HP: ArrayLike, R_HP: ArrayLike) -> Array:
        """Returns the signed gap (n,), m: the distance between peg and block, or minus their deepest overlap.

        Args:
            p_HP: Centres of the tip (n, 3), m.
            R_HP: Rotations (n, 3, 3); the peg's axis is less than 45 degrees from z of H.
        """
        return np.asarray(lowest_gaps(self.bodies, *_poses(p_HP, R_HP)))

    def label(self, p_HP: ArrayLike, R_HP: ArrayLike, *, tolerance: float = 0.0) -> NDArray[np.intp]:
        """Returns the `ContactLabel` of each pose (n,), see `gap`; a gap of up to ``tolerance`` (m) is a contact."""
        return np.asarray(contact_labels(self.bodies, *_poses(p_HP, R_HP), tolerance))

    def peg_mesh(self, facets: int) -> TriangleMesh:
        """Returns the surface of the peg for pictures."""
        meshes = [make_prism(mate.peg, mate.top - mate.tip[2], facets) for mate in self.fits]
        return _joined(meshes, [mate.tip for mate in self.fits])

    def block_mesh(self, facets: int, *, block_radius: float, floor: float) -> TriangleMesh:
        """Returns the block for pictures, cut open towards the camera: a sleeve around each of several holes."""
        meshes, places = [], []
        for axis, mates in self.axes():
            deepest, top = mates[0], float(mates[-1].mouth[2])
            meshes.append(
                make_hole(
                    section=deepest.hole,
                    depth=top - deepest.bottom,
                    wider=[(mate.hole, top - mate.bottom) for mate in mates[1:]],
                    chamfer=deepest.chamfer,
                    facets=facets,
                    block_radius=self.sleeve_radius(mates, block_radius),
                    floor=floor,
                    cutaway=True,
                )
            )
            places.append(np.array([*axis, top]))
        return _joined(meshes, places)

    def sleeve_radius(self, mates: Sequence[Mate], block_radius: float) -> float:
        """Returns the radius of what is drawn around the holes of an axis, m: the block, if there is no other axis."""
        place, hole = mates[0].mouth[:2], mates[-1].hole
        others = [mate for mate in self.fits if (mate.mouth[:2] != place).any()]
        apart = [math.hypot(*(mate.mouth[:2] - place)) - mate.hole.outer_radius for mate in others]
        own = hole.offset(mates[-1].chamfer).outer_radius
        return 0.5 * (own + min(apart)) if apart else block_radius

    def axes(self) -> list[tuple[Array, list[Mate]]]:
        """Returns each axis (x, y), m, with its mates that fit, the deepest first."""
        found: dict[tuple[float, float], list[Mate]] = {}
        for mate in sorted(self.fits, key=lambda mate: float(mate.mouth[2])):
            found.setdefault((float(mate.mouth[0]), float(mate.mouth[1])), []).append(mate)
        return [(np.array(axis), mates) for axis, mates in found.items()]


@dataclass(frozen=True)
class Row:
    """A row of ``mates``.

    Attributes:
        x, y: place of the axis of both sections, m.
        radius: size of the section of the peg, m.
        tip: height of its tip above that which is furthest in, m.
        mouth: depth of its mouth below the top of the block, m.
    """

    x: float
    y: float
    radius: float
    tip: float
    mouth: float

    def holds(self, wider: Row) -> bool:
        """Whether another section has the same axis, is wider and mates above this one."""
        same_axis = (wider.x, wider.y) == (self.x, self.y)
        return same_axis and wider.radius > self.radius and wider.tip > self.tip and wider.mouth < self.mouth


def _check(rows: Sequence[Row], geometry: Any, widest: float) -> None:
    """Raises ValueError if rows describe no mates; ``widest`` is the outer radius of the shape over its size."""
    around = 2.0 * (geometry.hole_radius - geometry.peg_radius + geometry.chamfer)  # two holes
    if min(row.radius for row in rows) <= 0.0 or min(row.tip for row in rows) or min(row.mouth for row in rows):
        raise ValueError("mates: expected positive radii, the lowest tip at 0 and the highest mouth at 0")
    for k, row in enumerate(rows, 1):
        for number, other in enumerate(rows[: k - 1], 1):
            apart = math.hypot(row.x - other.x, row.y - other.y)
            if not (apart > widest * (row.radius + other.radius + around) or row.holds(other) or other.holds(row)):
                raise ValueError(
                    f"mates {number} and {k} overlap: expected axes further apart than both mouths reach, or one axis,"
                    " with the tip and the mouth of the wider one above those of the other"
                )
        bottom = min([other.mouth for other in rows if other.holds(row)], default=geometry.hole_depth)
        if not row.mouth + geometry.chamfer < bottom:
            raise ValueError(f"mate {k}: its hole ends {1e3 * (bottom - row.mouth):.3g} mm below its mouth")
        if geometry.hole_depth - row.tip > bottom:
            raise ValueError(f"mate {k}: its tip would be below the bottom of its hole when the peg is inserted")


def _poses(p_HP: ArrayLike, R_HP: ArrayLike) -> tuple[Array, Array]:
    return np.ascontiguousarray(p_HP, dtype=np.float64), np.ascontiguousarray(R_HP, dtype=np.float64)


def _joined(meshes: Sequence[TriangleMesh], places: Sequence[Array]) -> TriangleMesh:
    """Returns one mesh of several, each moved to a place (3,), m."""
    vertices = [mesh.vertices + place for mesh, place in zip(meshes, places, strict=True)]
    starts = np.cumsum([0, *map(len, vertices)])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    return TriangleMesh(np.vstack(vertices), np.vstack(triangles))
