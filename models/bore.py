"""Watertight meshes of a chamfered blind bore in a round block.

The bore is a regular prism whose edges lie on the true cylinder, like those of the peg that Drake makes of a cylinder.
Two such prisms with as many sides, aligned, are similar: the clearance between them is R - r across the edges and
(R - r) cos(pi/n) across the sides, the true one to a thousandth. With the sides on the cylinder instead, the play
would be larger by a sagitta, a quarter of the clearance.

Frame H: origin at the centre of the mouth, z out of the hole.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TriangleMesh:
    """A closed surface: ``vertices`` (n, 3) in m, ``triangles`` (m, 3) of indices, normals pointing outwards."""

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]

    def to_obj(self) -> str:
        """Wavefront OBJ text."""
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.vertices]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in self.triangles]
        return "\n".join(lines) + "\n"

    def volume(self) -> float:
        """Enclosed volume in m^3, by the divergence theorem; negative if the normals point inwards."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def facet_sagitta(radius: float, facets: int) -> float:
    """How far a regular polygon with ``facets`` sides departs from its circle of ``radius`` m: r (1 - cos(pi/n))."""
    return radius * (1.0 - math.cos(math.pi / facets))


def minimum_facets(radius: float, clearance: float) -> int:
    """Fewest facets whose sagitta stays below a quarter of the clearance (both in m)."""
    return math.ceil(math.pi / math.acos(1.0 - clearance / (4.0 * radius)))


def make_bore(
    *,
    radius: float,
    depth: float,
    chamfer: float,
    facets: int,
    block_radius: float,
    floor: float,
    sector: tuple[int, int] | None = None,
) -> TriangleMesh:
    """A round block, pierced from above by a chamfered blind bore.

    Args:
        radius: of the true cylinder, in m; the edges of the bore lie on it.
        depth: from the mouth to the bottom of the bore, in m.
        chamfer: width and depth of the 45 degree chamfer, in m; 0 leaves a sharp edge.
        facets: number of flat faces round the bore.
        block_radius: of the outer cylinder, in m.
        floor: thickness below the bottom of the bore, in m.
        sector: first and last facet to keep, for a block cut open for the eye; None for the whole ring. A cut block
            is closed by planes through the axis.

    Raises:
        ValueError: where the sizes make no bore.
    """
    if facets < 3:
        raise ValueError(f"bore: {facets} facets, expected at least 3")
    if not (radius > 0 and 0 <= chamfer < depth and radius + chamfer < block_radius and floor > 0):
        raise ValueError(
            f"bore: radius {radius}, chamfer {chamfer}, depth {depth}, block radius {block_radius}, floor {floor}"
            " (m); expected all positive, chamfer < depth and radius + chamfer < block radius"
        )
    # The profile (radius, height) from the bottom of the bore over the rim to the bottom of the block.
    profile = [(0.0, -depth), (radius, -depth)]
    if chamfer > 0:
        profile += [(radius, -chamfer), (radius + chamfer, 0.0)]
    else:
        profile += [(radius, 0.0)]
    profile += [(block_radius, 0.0), (block_radius, -depth - floor), (0.0, -depth - floor)]
    first, last = sector if sector is not None else (0, facets)
    closed = last - first == facets
    columns = facets if closed else last - first + 1
    angles = 2.0 * math.pi * (first + np.arange(columns)) / facets

    vertices: list[tuple[float, float, float]] = []
    ring: list[list[int]] = []  # ring[p][c]: index of profile point p in column c; points on the axis are shared
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
    """Triangles that close the cut through one column: the profile is star-shaped about its outer bottom corner."""
    pivot = len(profile) - 2
    others = [(pivot + k) % len(profile) for k in range(1, len(profile))]
    faces = []
    for a, b in itertools.pairwise(others):
        corner = (indices[pivot], indices[a], indices[b])
        faces.append(corner[::-1] if flip else corner)
    return faces
