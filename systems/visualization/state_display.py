"""Shows the estimated contact state in Meshcat by the colour of the peg and by name."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from pydrake.common import MemoryFile
from pydrake.geometry import Cylinder, InMemoryMesh, Mesh, Meshcat, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, EventStatus, LeafSystem

from models.scenario import Geometry
from skill.arrays import Array
from skill.states.state_style import state_colours

PATH = "contact_state"
COVER = 1.002  # size of a coloured peg relative to the drawn peg, which it hides
PLATE_HEIGHT = 0.0055  # in units of m, of a name plate
LETTER_PIXELS = 44  # height of the letters in the picture
DOTS_PER_INCH = 100.0  # resolution of the picture on a plate


class StateDisplay(LeafSystem):
    """
    .. pydrake_system::

        name: StateDisplay
        input_ports:
        - state
        - carriage_state

    Publishes the estimated contact state into Meshcat. For every state there is a coloured peg and a name plate; those
    of the present state are visible, the others are hidden. (A recording replays the visibility of an object, but not
    its colour.) The pegs follow the carriage: the height of the tip above the mouth is the position of the carriage
    minus ``home``. The deflection of the mount is too small to see.
    """

    def __init__(
        self,
        *,
        meshcat: Meshcat,
        names: Sequence[str],
        geometry: Geometry,
        home: float,
        period: float,
        X_WL: RigidTransform,
    ) -> None:
        """Draws the pegs and the plates.

        Args:
            meshcat: Meshcat to draw into.
            names: names of the states.
            geometry: geometry of the peg.
            home: position of the carriage at which the tip is level with the mouth, m.
            period: publishing period, s.
            X_WL: pose of the upper left corner of the plates, which lie in the x-z plane of L; see `plate_pose`.
        """
        super().__init__()
        self._meshcat = meshcat
        self._home = home
        self._n_states = len(names)
        self._state = self.DeclareVectorInputPort("state", 1)
        self._carriage = self.DeclareVectorInputPort("carriage_state", 2)
        peg = Cylinder(COVER * geometry.peg_radius, COVER * geometry.peg_length)
        X_TipCentre = RigidTransform([0.0, 0.0, 0.5 * geometry.peg_length])
        for k, (name, colour) in enumerate(zip(names, state_colours(len(names)), strict=True)):
            red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
            meshcat.SetObject(f"{PATH}/peg/{k}", peg, Rgba(red, green, blue, 1.0))
            meshcat.SetTransform(f"{PATH}/peg/{k}", X_TipCentre)
            meshcat.SetObject(f"{PATH}/name/{k}", name_plate(name, colour, PLATE_HEIGHT))
        meshcat.SetTransform(f"{PATH}/name", X_WL)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)

    def _publish(self, context: Context) -> EventStatus:
        time = context.get_time()
        state = round(float(self._state.Eval(context)[0]))
        position, _speed = self._carriage.Eval(context)
        self._meshcat.SetTransform(f"{PATH}/peg", RigidTransform([0.0, 0.0, position - self._home]), time)
        for kind in ("peg", "name"):
            for k in range(self._n_states):
                self._meshcat.SetProperty(f"{PATH}/{kind}/{k}", "visible", k == state, time)
        return EventStatus.Succeeded()


def plate_pose(camera: Array, target: Array) -> RigidTransform:
    """Returns X_WL of plates that face the camera, to the lower left of its target.

    Args:
        camera: (3,), position of the camera in W, m.
        target: (3,), point that the camera looks at, in W, m.
    """
    to_camera = (camera - target) / np.linalg.norm(camera - target)
    right = np.cross([0.0, 0.0, 1.0], to_camera)
    right /= np.linalg.norm(right)
    up = np.cross(to_camera, right)
    R_WL = RotationMatrix(np.column_stack([right, -to_camera, up]))
    return RigidTransform(R_WL, target + 0.25 * (camera - target) - 0.050 * right - 0.028 * up)


def name_plate(name: str, colour: str, height: float) -> Mesh:
    """Returns a plate with one line of text after a coloured square, as a glTF mesh with an embedded picture.

    The plate lies in the x-z plane with its upper left corner at the origin; a viewer who looks along +y can read it.

    Args:
        name: the text.
        colour: colour of the square, hexadecimal.
        height: height of the plate, m.
    """
    picture, aspect = _text_picture(name, colour)
    width = height * aspect
    # In glTF y points upwards; Drake turns it into z.
    corners = np.array([[0, -height, 0], [width, -height, 0], [width, 0, 0], [0, 0, 0]], dtype="<f4")
    texture_points = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype="<f4")
    triangles = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
    parts = [corners.tobytes(), texture_points.tobytes(), triangles.tobytes()]
    offsets = np.cumsum([0, *map(len, parts)])
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                "doubleSided": True,
                "extensions": {"KHR_materials_unlit": {}},
            }
        ],
        "extensionsUsed": ["KHR_materials_unlit"],
        "textures": [{"source": 0}],
        "images": [{"uri": _data_uri(picture, "image/png")}],
        "buffers": [{"uri": _data_uri(b"".join(parts), "application/octet-stream"), "byteLength": int(offsets[-1])}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(part)}
            for start, part in zip(offsets, parts, strict=False)
        ],
        "accessors": [
            {
                **{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                **{"min": corners.min(axis=0).tolist(), "max": corners.max(axis=0).tolist()},
            },
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
    }
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(json.dumps(gltf), ".gltf", f"plate '{name}'")))


def _data_uri(data: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _text_picture(text: str, colour: str) -> tuple[bytes, float]:
    """Returns a PNG of the coloured square and the text, and its ratio of width to height."""
    figure = Figure(figsize=(1.0, 1.0), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)  # attaches itself to the figure
    pixels, points = LETTER_PIXELS, 72.0 * LETTER_PIXELS / DOTS_PER_INCH
    patch = figure.text(0.0, 0.5, "\N{BLACK SQUARE}", color=colour, fontsize=points, va="center")
    words = figure.text(0.0, 0.5, text, color="#1D2329", fontsize=points, va="center_baseline")
    width, height = words.get_window_extent().width + 2.2 * pixels, 1.7 * pixels
    figure.set_size_inches(width / DOTS_PER_INCH, height / DOTS_PER_INCH)
    patch.set_x(0.5 * pixels / width)
    words.set_x(1.6 * pixels / width)
    stream = io.BytesIO()
    figure.savefig(stream, format="png")
    return stream.getvalue(), width / height
