"""A picture of the peg and the hole, cut open, without a display."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    FrameId,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    InMemoryMesh,
    LightParameter,
    MakeRenderEngineVtk,
    Mesh,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    Rgba,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from models.scenario import Geometry
from skill.arrays import Array
from systems.plant.contact_plant import BLOCK_COLOUR, PEG_COLOUR, peg_shape

CAMERA = np.array([0.062, 0.055, 0.030])  # in units of m, in W; it looks at TARGET
TARGET = np.array([0.0, 0.0, -0.004])  # in units of m, in W
SIZE = 480  # in units of pixels, width and height
VIEW = 0.75  # in units of rad, vertical angle of view
NEAR, FAR = 0.005, 1.0  # in units of m, what the camera sees
FACETS = 64  # of the drawn bore
RENDERER = "picture"
LIGHTS = ((1.0, (-0.6, -0.35, -0.7)), (0.5, (0.3, -0.9, -0.2)))  # intensity and direction in W


class Picture:
    """Draws the peg in the hole.

    It has a scene of its own, which is built once and does not touch the simulation.

    Args:
        geometry: sizes of peg and hole.
    """

    def __init__(self, geometry: Geometry) -> None:
        self._scene = SceneGraph()
        lights = [
            LightParameter(type="directional", direction=list(direction), frame="world", intensity=intensity)
            for intensity, direction in LIGHTS
        ]
        engine = RenderEngineVtkParams(default_clear_color=[1.0, 1.0, 1.0], lights=lights)
        self._scene.AddRenderer(RENDERER, MakeRenderEngineVtk(engine))
        self._source = self._scene.RegisterSource("rig")
        X_PC, peg = peg_shape(geometry)
        self._peg = self._add("peg", peg, X_PC, np.append(PEG_COLOUR[:3], 1.0))
        self._block = self._add("block", _cut_block(geometry), RigidTransform(), BLOCK_COLOUR)
        self._context = self._scene.CreateDefaultContext()
        lens = RenderCameraCore(RENDERER, CameraInfo(SIZE, SIZE, VIEW), ClippingRange(NEAR, FAR), RigidTransform())
        self._camera = ColorRenderCamera(lens, False)

    def draw(self, X_WP: RigidTransform, X_WH: RigidTransform) -> NDArray[np.uint8]:
        """Returns the picture (SIZE, SIZE, 3) of peg and block at these poses."""
        poses = FramePoseVector()
        poses.set_value(self._peg, X_WP)
        poses.set_value(self._block, X_WH)
        self._scene.get_source_pose_port(self._source).FixValue(self._context, poses)
        query = self._scene.get_query_output_port().Eval(self._context)
        image = query.RenderColorImage(self._camera, self._scene.world_frame_id(), camera_pose(CAMERA, TARGET))
        return np.array(image.data[..., :3], dtype=np.uint8)

    def _add(self, name: str, shape: Shape, X_FS: RigidTransform, colour: Array) -> FrameId:
        """Adds a coloured shape on a frame of its own."""
        frame = self._scene.RegisterFrame(self._source, GeometryFrame(name))
        properties = PerceptionProperties()
        properties.AddProperty("phong", "diffuse", Rgba(*colour))
        properties.AddProperty("label", "id", RenderLabel.kDontCare)
        instance = GeometryInstance(X_FS, shape, name)
        instance.set_perception_properties(properties)
        self._scene.RegisterGeometry(self._source, frame, instance)
        return frame


def camera_pose(camera: Array, target: Array) -> RigidTransform:
    """Returns X_WC of a camera at ``camera`` that looks at ``target`` (m, in W): z ahead, y down."""
    ahead = (target - camera) / np.linalg.norm(target - camera)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return RigidTransform(RotationMatrix(np.column_stack([right, np.cross(ahead, right), ahead])), camera)


def _cut_block(g: Geometry) -> Mesh:
    """Returns the block without the half that the camera looks in from."""
    mesh = g.assembly.block_mesh(FACETS, block_radius=g.block_radius, floor=g.floor)
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(mesh.to_faceted_obj(), ".obj", "block.obj")))
