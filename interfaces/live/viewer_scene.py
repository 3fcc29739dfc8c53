"""The scene of a live session, as messages for the viewer in Drake's Meshcat page.

It has the methods of Drake's Meshcat for drawing. Meshcat itself is not used, because it serves a port of its own that
checks nobody: any page or program could press the buttons there, and an empty frame ends the process.
"""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
import umsgpack
from pydrake.geometry import Cylinder, Mesh, MeshcatCone, Rgba, Shape
from pydrake.math import RigidTransform

from interfaces.live.messages import Outbox
from skill.arrays import Array

SEGMENTS = 50  # of a cylinder or cone around its axis
# three.js's cylinder stands on its axis y, the cylinder here on z.
Y_TO_Z = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
GREY = Rgba(0.9, 0.9, 0.9)


class ViewerScene:
    """Draws into all browsers that show the page. The names of the methods are those of Drake's Meshcat.

    Args:
        outbox: receives the messages.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._ids = count()

    def SetObject(self, path: str, shape: Shape, rgba: Rgba = GREY) -> None:
        """Replaces the object at ``path``.

        Raises:
            ValueError: if the shape is neither a cylinder, a cone nor a mesh in memory.
        """
        geometry, matrix = _geometry(shape)
        ids = {name: str(next(self._ids)) for name in ("geometry", "material", "object")}
        material = {
            "type": "MeshPhongMaterial",
            "uuid": ids["material"],
            "color": int.from_bytes(bytes(int(255 * share) for share in (rgba.r(), rgba.g(), rgba.b()))),
            "opacity": rgba.a(),
            "transparent": rgba.a() < 1.0,
            "side": 2,
        }
        lowered = {
            "metadata": {"version": 4.5, "type": "Object"},
            "geometries": [{**geometry, "uuid": ids["geometry"]}],
            "materials": [material],
            "object": {
                "type": "Mesh",
                "uuid": ids["object"],
                "geometry": ids["geometry"],
                "material": ids["material"],
                "matrix": matrix.T.ravel().tolist(),
            },
        }
        self._put("set_object", path, object=lowered)

    def SetTransform(self, path: str, X_ParentPath: RigidTransform) -> None:
        """Moves ``path`` in its parent."""
        self._put("set_transform", path, matrix=X_ParentPath.GetAsMatrix4().T.ravel().tolist())

    def SetProperty(self, path: str, name: str, value: Any) -> None:
        """Changes a property of the object at ``path``."""
        self._put("set_property", path, name, property=name, value=value)

    def SetCameraPose(self, camera_in_world: Array, target_in_world: Array) -> None:
        """Moves the camera (3,) and points it at the target (3,), both in W, m."""
        # In the viewer y points upwards.
        (x, y, z), (u, v, w) = camera_in_world.tolist(), target_in_world.tolist()
        self.SetTransform("/Cameras/default", RigidTransform())
        self.SetProperty("/Cameras/default/rotated/<object>", "position", [x, z, -y])
        self._put("set_target", "/Cameras", value=[u, w, -v])

    def _put(self, kind: str, path: str, *key: str, **content: Any) -> None:
        absolute = path if path.startswith("/") else f"/drake/{path}"
        self._outbox.put((kind, absolute, *key), umsgpack.packb({"type": kind, "path": absolute, **content}))


def _geometry(shape: Shape) -> tuple[dict[str, Any], Array]:
    """Returns a shape as three.js describes it, and the matrix (4, 4) from there to Drake's frame of the shape."""
    if isinstance(shape, Cylinder):
        radii = {"radiusTop": shape.radius(), "radiusBottom": shape.radius()}
        return {"type": "CylinderGeometry", **radii, "height": shape.length(), "radialSegments": SEGMENTS}, Y_TO_Z
    if isinstance(shape, MeshcatCone):  # its point is at the origin, its base at z = height
        size = {"radiusTop": 1.0, "radiusBottom": 0.0, "height": shape.height(), "radialSegments": SEGMENTS}
        matrix = np.diag([shape.a(), shape.b(), 1.0, 1.0]) @ Y_TO_Z
        matrix[2, 3] = 0.5 * shape.height()
        return {"type": "CylinderGeometry", **size}, matrix
    if isinstance(shape, Mesh) and shape.source().is_in_memory():
        data = shape.source().in_memory().mesh_file.contents().decode()
        return {"type": "_meshfile_geometry", "format": "obj", "data": data}, np.eye(4)
    raise ValueError(f"the page cannot draw {shape}; expected a cylinder, a cone or a mesh in memory")
