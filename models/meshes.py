"""Generates meshes of a chamfered blind hole in a round block, closed or of the inside only, and of the peg.

Round outlines become regular polygons whose corners lie on the true circle, like the edges of the prism into which
Drake converts a cylindrical peg. Two aligned prisms with the same number n of sides are similar: the clearance between
them is R - r at the edges and (R - r) cos(pi/n) at the sides, which is within 0.5 % of the true clearance for n = 32.
If the sides lay on the cylinder instead, the play would be larger by the sagitta. Peg and hole of any section have
corresponding corners in the same way.

Frame H has its origin at the centre of the mouth and z out of the hole.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.section import Section

CUTAWAY_TURNS = (3 / 8, 7 / 8)
"""Part of the ring that a cutaway picture shows, in turns about z; the camera looks in from the other half."""


MAX_FACETS = 512
"""Maximum number of facets. The time of a step grows with it; 256 are as good as round (docs/physics.md)."""

MAX_PLAY_ERROR = 0.01
"""Largest error of the play of two aligned polygons, as a part of the clearance."""

EDGE_ANGLE = 1.5
"""Angle of the broken edge to the wall, over the largest tilt at which the peg enters."""

EDGE_HEIGHT = 0.4
"""Height of the broken edge, over the clearance."""


@dataclass(frozen=True)
class TriangleMesh:
    """A surface with outward normals, closed or open.

    Attributes:
        vertices: Points (n, 3), m.
        triangles: Vertex indices (m, 3), counter-clockwise as seen from outside.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]

    def to_obj(self) -> str:
        """Returns the mesh as Wavefront OBJ text."""
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.vertices]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in self.triangles]
        return "\n".join(lines) + "\n"

    def to_faceted_obj(self) -> str:
        """Returns the mesh as Wavefront OBJ text with a normal of each triangle, as Drake's renderer requires."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.vertices]
        lines += [f"vn {x:.6f} {y:.6f} {z:.6f}" for x, y, z in normals]
        lines += [
            "f " + " ".join(f"{vertex + 1}//{k}" for vertex in triangle) for k, triangle in enumerate(self.triangles, 1)
        ]
        return "\n".join(lines) + "\n"


def facet_sagitta(radius: float, facets: int) -> float:
    """Returns the sagitta (m) of a regular polygon in a circle of ``radius`` r (m): r (1 - cos(pi/n))."""
    return radius * (1.0 - math.cos(math.pi / facets))


def minimum_facets(radius: float, clearance: float) -> int:
    """Returns the minimum number of facets whose sagitta is at most a quarter of the clearance (both in m).

    A peg that may rotate about its axis needs as many: a rotation by half a facet costs one sagitta of the play.
    """
    return math.ceil(math.pi / math.acos(1.0 - clearance / (4.0 * radius)))


def minimum_clearance(radius: float) -> float:
    """Returns the smallest clearance (m) for which `MAX_FACETS` are enough; see `minimum_facets`."""
    return 4.0 * facet_sagitta(radius, MAX_FACETS)


@dataclass(frozen=True)
class BrokenEdge:
    """A band between the wall of the bore and its chamfer, steeper than the chamfer.

    Drake extrapolates the pressure of every face over a step with the speed at which the bodies approach along the
    normal of that face. A peg that slides along the edge of the mouth approaches the chamfer, so that a chamfer of 45
    degrees next to the edge pushes against the motion: the axial force of a sliding peg is too large by an amount
    proportional to the tangent of the angle between the faces, the speed and the step (docs/physics.md).

    Attributes:
        width: Radial width of the band, m.
        height: Height of the band above the mouth, m.
    """

    width: float
    height: float

    @classmethod
    def of(cls, *, radius: float, clearance: float, chamfer: float) -> BrokenEdge | None:
        """Returns the band for a bore, or None if there is no chamfer.

        The band is as flat as it can be without touching the peg before the edge of the mouth does: its angle is 1.5
        times the largest tilt at which the peg enters, arccos(r/R). Its height is 0.4 of the clearance: contacts are
        smaller, and no point of the band is further than 0.3 of the clearance from the chamfer.

        Args:
            radius: Radius R of the bore, m.
            clearance: R - r, m.
            chamfer: Width of the chamfer, m.
        """
        if chamfer == 0.0:
            return None
        angle = min(EDGE_ANGLE * math.acos(1.0 - clearance / radius), math.radians(45.0))
        height = min(EDGE_HEIGHT * clearance, 0.2 * chamfer)
        return cls(width=height * math.tan(angle), height=height)


def cutaway_columns(outline: NDArray[np.float64]) -> NDArray[np.int64]:
    """Returns the numbers of the points (n, 2) of an outline at which a block that is cut open has walls."""
    turns = np.arctan2(outline[:, 1], outline[:, 0]) / (2.0 * math.pi) % 1.0
    first, last = (int(np.abs(turns - turn).argmin()) for turn in CUTAWAY_TURNS)
    return np.arange(first, last + 1 if last > first else last + 1 + len(outline)) % len(outline)


def make_prism(section: Section, length: float, facets: int) -> TriangleMesh:
    """Returns the surface of a peg along z from its tip at z = 0; see `make_peg`."""
    outline = section.polyline(facets)
    n = len(outline)
    rings = [np.column_stack([outline, np.full(n, z)]) for z in (0.0, length)]
    triangles = []
    for a in range(n):
        b = (a + 1) % n
        triangles += [(2 * n, b, a), (2 * n + 1, a + n, b + n), (a, b, b + n), (a, b + n, a + n)]
    return TriangleMesh(np.vstack([*rings, (0.0, 0.0, 0.0), (0.0, 0.0, length)]), np.array(triangles))


@dataclass(frozen=True)
class TetrahedronMesh:
    """A solid.

    Attributes:
        vertices: Points (n, 3), m.
        tetrahedra: Vertex indices (m, 4); the fourth lies where the first three turn counter-clockwise about it.
    """

    vertices: NDArray[np.float64]
    tetrahedra: NDArray[np.int64]

    def to_vtk(self) -> str:
        """Returns the mesh as text of a legacy VTK file."""
        n, m = len(self.vertices), len(self.tetrahedra)
        lines = ["# vtk DataFile Version 3.0", "peg", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {n} double"]
        lines += [f"{x:.12g} {y:.12g} {z:.12g}" for x, y, z in self.vertices]
        lines += [f"CELLS {m} {5 * m}", *(f"4 {a} {b} {c} {d}" for a, b, c, d in self.tetrahedra)]
        lines += [f"CELL_TYPES {m}", *["10"] * m]
        return "\n".join(lines) + "\n"


def make_peg(section: Section, length: float, facets: int) -> TetrahedronMesh:
    """Returns the solid of a peg along z from its tip at z = 0.

    Vertices inside lie on the axis, at least the inner radius below the surface. Drake's pressure, which is 0 on the
    surface and largest there, thus grows from every face as it does from the side of its own cylinder.

    Args:
        section: Outline of the peg, m, every point of which is visible from the axis.
        length: m.
        facets: Number of points on a full circle.
    """
    outline = section.polyline(facets)
    n, inside = len(outline), min(section.inner_radius, 0.4 * length)
    ring = [np.column_stack([outline, np.full(n, z)]) for z in (0.0, length)]
    axis = [(0.0, 0.0, z) for z in (0.0, length, inside, length - inside)]
    foot, head, low, high = range(2 * n, 2 * n + 4)
    tetrahedra = []
    for a in range(n):
        b = (a + 1) % n
        tetrahedra += [(foot, a, b, low), (head, b + n, a + n, high)]
        tetrahedra += [(b, a, b + n, low), (b + n, a, a + n, low), (b + n, a + n, high, low)]
    return TetrahedronMesh(np.vstack([*ring, axis]), np.array(tetrahedra))


def make_hole(
    *,
    section: Section,
    depth: float,
    chamfer: float,
    facets: int,
    block_radius: float,
    floor: float,
    wider: Sequence[tuple[Section, float]] = (),
    edge: BrokenEdge | None = None,
    cutaway: bool = False,
    inside: bool = False,
) -> TriangleMesh:
    """Returns the mesh of a round block with a chamfered blind hole in its top face.

    Args:
        section: Outline of the hole, m; its points lie on it. Every point is visible from the axis.
        depth: Depth from the top of the block to the bottom of the hole, m.
        chamfer: Width and depth of the 45 degree chamfer, m; 0 for a sharp edge.
        facets: Number of points on a full circle.
        block_radius: Radius of the block, m.
        floor: Thickness of the block below the hole, m.
        wider: Outlines of wider holes above this one, of the same shape, and the depths at which they end, m; the
            widest is the last one, and has its mouth in the top face. Each has the chamfer.
        edge: Band between wall and chamfer; None for a chamfer that begins at the mouth. It needs a chamfer.
        cutaway: Whether to cut the block open for a picture, along planes through the axis.
        inside: Whether to leave out the outer side and the bottom. The surface is then open, and Drake's
            query of contact costs 15 to 40 % less: it tests each part of the peg against all triangles with near boxes.

    Raises:
        ValueError: If there are fewer than three facets, or the sizes describe no hole.
    """
    if facets < 3:
        raise ValueError(f"hole: {facets} facets, expected at least 3")
    radius = wider[-1][0].outer_radius if wider else section.outer_radius
    if not (radius > 0 and 0 <= chamfer < depth and radius + chamfer < block_radius and floor > 0):
        raise ValueError(
            f"hole: outer radius {radius}, chamfer {chamfer}, depth {depth}, block radius {block_radius}, floor {floor}"
            " (m); expected positive sizes (chamfer may be 0), chamfer < depth and radius + chamfer < block radius"
        )
    outline = section.polyline(facets)
    around = block_radius * outline / np.hypot(outline[:, 0], outline[:, 1])[:, None]
    # The profile of outlines and heights runs from the bottom of the hole over the rim to the bottom of the block.
    rim: list[tuple[Any, float]] = []
    ends = [end for _, end in wider]
    for hole, bottom, mouth in zip((section, *(hole for hole, _ in wider)), (depth, *ends), (*ends, 0.0), strict=True):
        rim += [(hole.polyline(facets), -bottom), (hole.polyline(facets), -mouth - chamfer)]
        if edge is not None:
            rim.append((hole.offset(edge.width).polyline(facets), -mouth - chamfer + edge.height))
        if chamfer > 0:
            rim.append((hole.offset(chamfer).polyline(facets), -mouth))
    profile: list[tuple[Any, float]] = [
        *((None, -depth), *rim),
        *((around, 0.0), (around, -depth - floor), (None, -depth - floor)),
    ]
    if inside:
        del profile[-2:]
    closed, chosen = not cutaway, cutaway_columns(outline) if cutaway else np.arange(len(outline))
    columns = len(chosen)

    vertices: list[tuple[float, float, float]] = []
    ring: list[list[int]] = []  # ring[p][c] is the index of profile point p in column c; the axis points are shared
    for curve, z in profile:
        if curve is None:
            ring.append([len(vertices)] * columns)
            vertices.append((0.0, 0.0, z))
        else:
            ring.append(list(range(len(vertices), len(vertices) + columns)))
            vertices += [(x, y, z) for x, y in curve[chosen]]
    triangles: list[tuple[int, int, int]] = []
    for p in range(len(profile) - 1):
        for c in range(columns if closed else columns - 1):
            d = (c + 1) % columns
            a, b, e, f = ring[p][c], ring[p][d], ring[p + 1][c], ring[p + 1][d]
            triangles += [t for t in ((a, e, f), (a, f, b)) if len(set(t)) == 3]
    if not closed:
        for column, flip in ((0, True), (columns - 1, False)):
            triangles += _fan([ring[p][column] for p in range(len(profile))], flip)
    return TriangleMesh(np.array(vertices), np.array(triangles))


def _fan(indices: list[int], flip: bool) -> list[tuple[int, int, int]]:
    """Returns triangles that close the cut at one column.

    They share the outer bottom corner: the profile is star-shaped about it.
    """
    pivot = len(indices) - 2
    others = [(pivot + k) % len(indices) for k in range(1, len(indices))]
    faces = []
    for a, b in itertools.pairwise(others):
        corner = (indices[pivot], indices[a], indices[b])
        faces.append(corner[::-1] if flip else corner)
    return faces
