"""An arrow of a force or a velocity in the scene of the page."""

from __future__ import annotations

import math

import numpy as np
from pydrake.geometry import Cylinder, MeshcatCone, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from interfaces.live.viewer_scene import ViewerScene
from skill.arrays import Array
from systems.math.rotation import from_rotation_vector, rotation_between

RADIUS, HEAD_RADIUS, HEAD_LENGTH = 0.0008, 0.002, 0.004  # in units of m
SMALLEST = 1e-6  # scale of what has no length: an object without volume has no normals


class Arrow:
    """An arrow that is drawn over the other objects, so that neither peg nor block hides it.

    Args:
        scene: scene to draw into.
        path: path of the arrow in the scene.
        scale: force or velocity per length of the arrow, N/m or (m/s)/m.
        colour: colour of the arrow; its opacity must be below 1, because the viewer draws transparent objects last.
        order: drawing order; the arrow with the highest order is on top.
    """

    def __init__(self, scene: ViewerScene, path: str, *, scale: float, colour: Rgba, order: float = 10.0) -> None:
        self._scene, self._path, self._scale, self._colour = scene, path, scale, colour
        shapes = {"shaft/rod": Cylinder(RADIUS, 1.0), "head/cone": MeshcatCone(HEAD_LENGTH, HEAD_RADIUS, HEAD_RADIUS)}
        self._parts = [f"{path}/{name}" for name in shapes]
        for part, shape in zip(self._parts, shapes.values(), strict=True):
            scene.SetObject(part, shape, colour)
            scene.SetProperty(f"{part}/<object>", "material.depthTest", False)
            scene.SetProperty(f"{part}/<object>", "renderOrder", order)
        scene.SetTransform(self._parts[0], RigidTransform([0.0, 0.0, 0.5]))
        # The point of Meshcat's cone is at its origin, and its axis z leads inwards.
        scene.SetTransform(
            self._parts[1], RigidTransform(RotationMatrix.MakeXRotation(math.pi), [0.0, 0.0, HEAD_LENGTH])
        )

    def draw(self, start: Array, vector: Array) -> None:
        """Draws the arrow.

        Args:
            start: (3,), start of the arrow in W, m.
            vector: (3,), force or velocity in W, N or m/s.
        """
        magnitude = float(np.linalg.norm(vector))
        direction = vector / magnitude if magnitude > 1e-9 else np.array([0.0, 0.0, 1.0])
        R = from_rotation_vector(rotation_between(np.array([0.0, 0.0, 1.0]), direction))
        length = magnitude / self._scale
        thickness = max(SMALLEST, min(1.0, length / HEAD_LENGTH))  # a short arrow is small as a whole
        shaft = max(SMALLEST, length - HEAD_LENGTH)
        self._scene.SetTransform(self._path, RigidTransform(R, start))
        self._scene.SetProperty(f"{self._path}/shaft", "scale", [thickness, thickness, shaft])
        self._scene.SetProperty(f"{self._path}/head", "scale", [thickness] * 3)
        self._scene.SetProperty(f"{self._path}/head", "position", [0.0, 0.0, shaft])

    def set_colour(self, colour: Rgba) -> None:
        """Changes the colour; its opacity stays."""
        if colour == self._colour:  # a change of material costs the browser a frame
            return
        linear = [value**2.2 for value in (colour.r(), colour.g(), colour.b())]  # the viewer expects linear light
        for part in self._parts:
            self._scene.SetProperty(part, "color", [*linear, self._colour.a()])
        self._colour = colour
