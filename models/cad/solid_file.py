"""One body of a CAD file, as a closed triangle mesh, and its cross-sections."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models import Array

UNITS = {"mm": 1e-3, "inch": 25.4e-3, "m": 1.0}
"""Lengths of the units of an STL file, m."""

STEP_SUFFIXES = (".step", ".stp")
SUFFIXES = (*STEP_SUFFIXES, ".stl")

DEFLECTION, TURN = 1e-3, 0.1
"""Largest distance (mm) and angle (rad) between a surface of a STEP file and its triangles. Their corners lie on it."""

APART = 1e-7
"""Smallest difference of two heights, m."""

SMALLEST, LARGEST = 1e-3, 1.0
"""Extents that a peg or a block can have, m; others are of another unit."""


@dataclass(frozen=True)
class Solid:
    """A body.

    Attributes:
        path: of its file.
        vertices: (n, 3), m.
        faces: (m, 3), vertices of each triangle, counter-clockwise from outside.
    """

    path: Path
    vertices: Array
    faces: NDArray[np.intp]

    def levels(self, axis: Array) -> Array:
        """Returns the heights along a unit vector at which the body has vertices, ascending, m."""
        heights: Array = np.sort(self.vertices @ axis)
        return np.asarray(heights[np.concatenate([[True], np.diff(heights) > APART])])

    def loops(self, axis: Array, x: Array, y: Array, height: float) -> list[Array]:
        """Returns the outlines of a cross-section, counter-clockwise around material, in the axes x and y, m.

        Args:
            axis: unit vector normal to the plane; x, y and axis are a right-handed frame.
            x: unit vector.
            y: unit vector.
            height: of the plane along the axis, at which the body has no vertex, m.
        """
        above = self.vertices @ axis > height
        crossed = self.faces[above[self.faces].any(axis=1) & ~above[self.faces].all(axis=1)]
        after: dict[tuple[int, int], tuple[int, int]] = {}
        for face in crossed.tolist():
            # Material is on the left of the line from the edge that goes down through the plane to that which goes up.
            edges = list(zip(face, face[1:] + face[:1], strict=True))
            down = next((a, b) for a, b in edges if above[a] and not above[b])
            up = next((a, b) for a, b in edges if above[b] and not above[a])
            after[_key(*down)] = _key(*up)
        loops = []
        while after:
            first = edge = next(iter(after))
            loop = []
            while True:
                loop.append(edge)
                edge = after.pop(edge)
                if edge == first:
                    break
            ends = self.vertices[np.array(loop)]
            z = ends @ axis
            share = (height - z[:, 0]) / (z[:, 1] - z[:, 0])
            points = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
            loops.append(np.column_stack([points @ x, points @ y]))
        return loops


def _key(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def read_solid(path: Path, unit: str = "mm") -> Solid:
    """Reads the one body of a STEP or STL file.

    Args:
        path: of the file; its suffix says the format. STEP files state their unit.
        unit: of an STL file, one of `UNITS`.

    Raises:
        ValueError: naming the file and why its body is none: it cannot be read, is open, inside out, in several pieces,
            or has no size of a part.
        OSError: if the file cannot be read.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ValueError(f"{path}: the suffix {path.suffix!r}, expected one of {list(SUFFIXES)}")
    mesh = _read_mesh(path, UNITS[unit])
    if len(mesh.faces) == 0:
        raise ValueError(f"{path}: no triangles in it, expected the surface of one body")
    edges = np.sort(mesh.edges, axis=1)
    shared = np.unique(edges, axis=0, return_counts=True)[1]
    if (shared != 2).any():
        open_edges = int((shared != 2).sum())
        raise ValueError(f"{path}: the surface is open: {open_edges} of {len(shared)} edges do not join two triangles")
    if not mesh.is_winding_consistent or mesh.volume <= 0.0:
        raise ValueError(f"{path}: the surface is inside out: its triangles enclose {1e9 * mesh.volume:.4g} mm^3")
    bodies = mesh.body_count
    if bodies != 1:
        raise ValueError(f"{path}: {bodies} bodies, expected one; save each part as a file of its own")
    extents = mesh.extents
    if extents.max() < SMALLEST or extents.max() > LARGEST:
        size = " x ".join(f"{1e3 * extent:.4g}" for extent in extents)
        hint = f"read in the unit {unit!r}; is it another one?" if path.suffix.lower() == ".stl" else "as its unit says"
        raise ValueError(f"{path}: {size} mm, expected a part of {1e3 * SMALLEST:g} to {1e3 * LARGEST:g} mm; {hint}")
    return Solid(path, np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.intp))


def _read_mesh(path: Path, scale: float) -> Any:
    """Returns the triangles of a file, with common vertices, m."""
    import cascadio
    import trimesh

    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; expected a body in a STEP or STL file")
    try:
        if path.suffix.lower() in STEP_SUFFIXES:
            with tempfile.TemporaryDirectory() as folder:
                converted = Path(folder) / "part.glb"
                cascadio.step_to_glb(str(path), str(converted), DEFLECTION, TURN)
                mesh = trimesh.load_scene(converted).to_mesh() if converted.is_file() else trimesh.Trimesh()
            scale = 1.0
        else:
            mesh = trimesh.load_scene(path).to_mesh()
    except Exception as error:
        raise ValueError(f"{path}: cannot be read as {path.suffix[1:].upper()} ({error})") from error
    mesh.apply_scale(scale)
    digits = 9  # single precision has 1e-9 m at the size of a part
    mesh.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=digits)
    mesh.update_faces(mesh.nondegenerate_faces())
    mesh.remove_unreferenced_vertices()
    return mesh
