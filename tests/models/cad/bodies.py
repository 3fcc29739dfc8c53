"""Closed triangle meshes of parts with known sizes, written as STL files."""

import numpy as np
import trimesh


def circle(radius, count=96):
    angles = 2.0 * np.pi * np.arange(count) / count
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def lofted(rings):
    """A body between polygons of equally many corners (z, (n, 2)), mm; the first and the last are closed by fans."""
    n = len(rings[0][1])
    vertices = np.vstack([np.column_stack([points, np.full(n, z)]) for z, points in rings])
    k = np.arange(n)
    after = (k + 1) % n
    faces = []
    for ring in range(len(rings) - 1):
        a, b, c, d = ring * n + k, ring * n + after, (ring + 1) * n + after, (ring + 1) * n + k
        faces += [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    middles = [np.array([[*points.mean(axis=0), z]]) for z, points in (rings[0], rings[-1])]
    low, high = len(vertices), len(vertices) + 1
    last = (len(rings) - 1) * n
    faces += [np.column_stack([after, k, np.full(n, low)]), np.column_stack([last + k, last + after, np.full(n, high)])]
    return trimesh.Trimesh(np.vstack([vertices, *middles]), np.vstack(faces), process=False)


def peg(outline, length=40.0):
    """A prism with its tip at z = 0."""
    return lofted([(0.0, outline), (length, outline)])


def block(outline, depth=20.0, *, mouth=None, chamfer=0.0, outer=30.0, floor=10.0):
    """A round block with its top at z = 0 and a hole, which may widen to the outline ``mouth`` over ``chamfer``."""
    around = circle(outer, len(outline))
    rings = [(-depth - floor, around), (0.0, around)]
    if mouth is not None:
        rings.append((0.0, mouth))
    return lofted([*rings, (-chamfer, outline), (-depth, outline)])


def save(mesh, path, *, scale=1.0, turn=None, shift=(0.0, 0.0, 0.0)):
    """Writes an STL file in mm, of a body that is turned, shifted and scaled."""
    moved = mesh.copy()
    if turn is not None:
        moved.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, turn))
    moved.apply_translation(shift)
    moved.apply_scale(scale)
    moved.export(path)
    return path
