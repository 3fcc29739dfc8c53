"""Generates meshes of a chamfered blind bore in a round block, closed or of the inside only.

The bore is a regular prism whose edges lie on the true cylinder, like the edges of the prism into which Drake converts
the cylindrical peg. Two aligned prisms with the same number n of sides are similar: the clearance between them is R - r
at the edges and (R - r) cos(pi/n) at the sides, which is within 0.5 % of the true clearance for n = 32. If the sides
lay on the cylinder instead, the play would be larger by the sagitta.

Frame H has its origin at the centre of the mouth and z out of the hole.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


def facet_sagitta(radius: float, facets: int) -> float:
    """Returns the sagitta (m) of a regular polygon in a circle of ``radius`` r (m): r (1 - cos(pi/n))."""
    return radius * (1.0 - math.cos(math.pi / facets))


def minimum_facets(radius: float, clearance: float) -> int:
    """Returns the minimum number of facets whose sagitta is at most a quarter of the clearance (both in m).

    A peg that may rotate about its axis needs as many: a rotation by half a facet costs one sagitta of the play.
    """
    return math.ceil(math.pi / math.acos(1.0 - clearance / (4.0 * radius)))


def play_error(facets: int) -> float:
    """Returns the error of the play of a peg whose corners are aligned with those of the bore: 1 - cos(pi/n).

    It is a part of the clearance.
    """
    return 1.0 - math.cos(math.pi / facets)


def minimum_aligned_facets() -> int:
    """Returns the minimum number of facets whose `play_error` is at most `MAX_PLAY_ERROR`."""
    return math.ceil(math.pi / math.acos(1.0 - MAX_PLAY_ERROR))


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


def cutaway_sector(facets: int) -> tuple[int, int]:
    """Returns the first and last facet of a block that is cut open for a picture (see `make_bore`)."""
    start, end = CUTAWAY_TURNS
    return round(start * facets), round(end * facets)


def make_bore(
    *,
    radius: float,
    depth: float,
    chamfer: float,
    facets: int,
    block_radius: float,
    floor: float,
    edge: BrokenEdge | None = None,
    sector: tuple[int, int] | None = None,
    inside: bool = False,
) -> TriangleMesh:
    """Returns the mesh of a round block with a chamfered blind bore in its top face.

    Args:
        radius: Radius of the true cylinder, m; the edges of the bore lie on it.
        depth: Depth from the mouth to the bottom of the bore, m.
        chamfer: Width and depth of the 45 degree chamfer, m; 0 for a sharp edge.
        facets: Number of flat faces of the bore.
        block_radius: Radius of the block, m.
        floor: Thickness of the block below the bore, m.
        edge: Band between wall and chamfer; None for a chamfer that begins at the mouth. It needs a chamfer.
        sector: First and last facet to keep, for a block that is cut open; None for the whole ring. A cut block is
            closed by planes through the axis.
        inside: Whether to leave out the outer side and the bottom. The surface is then open, and Drake's
            query of contact costs 15 to 40 % less: it tests each part of the peg against all triangles with near boxes.

    Raises:
        ValueError: If there are fewer than three facets, or the sizes describe no bore.
    """
    if facets < 3:
        raise ValueError(f"bore: {facets} facets, expected at least 3")
    if not (radius > 0 and 0 <= chamfer < depth and radius + chamfer < block_radius and floor > 0):
        raise ValueError(
            f"bore: radius {radius}, chamfer {chamfer}, depth {depth}, block radius {block_radius}, floor {floor}"
            " (m); expected positive sizes (chamfer may be 0), chamfer < depth and radius + chamfer < block radius"
        )
    # The profile (radius, height) runs from the bottom of the bore over the rim to the bottom of the block.
    rim = [(radius, -chamfer), (radius + chamfer, 0.0)] if chamfer > 0 else [(radius, 0.0)]
    if edge is not None:
        rim.insert(1, (radius + edge.width, -chamfer + edge.height))
    profile = [
        *((0.0, -depth), (radius, -depth), *rim),
        *((block_radius, 0.0), (block_radius, -depth - floor), (0.0, -depth - floor)),
    ]
    if inside:
        del profile[-2:]
    first, last = sector if sector is not None else (0, facets)
    closed = last - first == facets
    columns = facets if closed else last - first + 1
    angles = 2.0 * math.pi * (first + np.arange(columns)) / facets

    vertices: list[tuple[float, float, float]] = []
    ring: list[list[int]] = []  # ring[p][c] is the index of profile point p in column c; the axis points are shared
    for rho, z in profile:
        if rho == 0.0:
            ring.append([len(vertices)] * columns)
            vertices.append((0.0, 0.0, z))
        else:
            ring.append(list(range(len(vertices), len(vertices) + columns)))
            vertices += [(rho * math.cos(t), rho * math.sin(t), z) for t in angles]
    triangles: list[tuple[int, int, int]] = []
    for p in range(len(profile) - 1):
        for c in range(columns if closed else columns - 1):
            d = (c + 1) % columns
            a, b, e, f = ring[p][c], ring[p][d], ring[p + 1][c], ring[p + 1][d]
            triangles += [t for t in ((a, e, f), (a, f, b)) if len(set(t)) == 3]
    if not closed:
        for column, flip in ((0, True), (columns - 1, False)):
            triangles += _fan([ring[p][column] for p in range(len(profile))], profile, flip)
    return TriangleMesh(np.array(vertices), np.array(triangles))


def _fan(indices: list[int], profile: list[tuple[float, float]], flip: bool) -> list[tuple[int, int, int]]:
    """Returns triangles that close the cut at one column.

    They share the outer bottom corner: the profile is star-shaped about it.
    """
    pivot = len(profile) - 2
    others = [(pivot + k) % len(profile) for k in range(1, len(profile))]
    faces = []
    for a, b in itertools.pairwise(others):
        corner = (indices[pivot], indices[a], indices[b])
        faces.append(corner[::-1] if flip else corner)
    return faces
