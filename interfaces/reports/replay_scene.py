"""A replay as an animated meshcat scene: shapes, colours, arrows, light and camera."""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshcat
import meshcat.geometry as shapes
import numpy as np
import umsgpack
from meshcat.animation import Animation, AnimationClip, AnimationTrack
from meshcat.commands import SetAnimation
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from interfaces.reports.motion import Motion
from models.assembly import Assembly
from skill.arrays import Array
from skill.data.geometry import PegHoleGeometry
from skill.data.rig_run import ContactPlace

TARGET = np.array([0.0, 0.0, 0.004])  # in units of m, in W; the camera looks at it
CAMERA = np.array([0.124, 0.110, 0.070])  # in units of m, in W
FIELD_OF_VIEW = 42.0  # in units of deg, vertical

BLOCK_COLOUR = 0xA9B2BB
EDGE_COLOUR = 0x3A4148
FORCE_COLOUR = 0xC1121F
MOMENT_COLOUR = 0x6A1B9A
CONTACT_COLOUR = 0x0E2A47
MAX_ARROW_LENGTH = 0.035  # in units of m
ARROW_RADIUS = 0.0007  # in units of m
HEAD_LENGTH = 0.004  # in units of m; arrows shorter than 1.5 heads are scaled down as a whole
FACETS = 96  # points on a full circle of the peg
MARK_SPACING = 0.005  # in units of m, between the rings on the peg

OBJECT = "<object>"  # the viewer's name for the object at a path


class PageWindow:
    """Collects the drawing commands for a self-contained page.

    It replaces meshcat's own window, which needs a server process and two free ports.

    Attributes:
        commands: in order, as the viewer's `handle_command_bytearray` takes them, in base64.
    """

    def __init__(self) -> None:
        self.commands: list[str] = []

    def send(self, command: Any) -> None:
        """Appends a meshcat command."""
        self.commands.append(base64.b64encode(umsgpack.packb(command.lower())).decode())


def viewer_source() -> str:
    """Returns the JavaScript of the viewer, from the meshcat package."""
    return (Path(meshcat.viewer_assets_path()) / "dist" / "main.min.js").read_text(encoding="utf-8")


@dataclass(frozen=True)
class ArrowScale:
    """Scales of the arrows.

    Attributes:
        force: force per length of an arrow, N/m.
        moment: moment per length of an arrow, N m/m.
    """

    force: float
    moment: float


def arrow_scale(motion: Motion) -> ArrowScale:
    """Returns round scales (1, 2 or 5 times a power of ten per cm) at which the largest arrows fit the scene."""

    def fit(vectors: Array, minimum: float) -> float:
        least = 0.01 * max(float(np.linalg.norm(vectors, axis=1).max()), minimum) / MAX_ARROW_LENGTH
        decade = 10.0 ** math.floor(math.log10(least))
        return 100.0 * next(m * decade for m in (1, 2, 5, 10) if m * decade >= least * (1 - 1e-9))  # rounding errors

    contacts = np.zeros((1, 3)) if motion.contact_forces is None else motion.contact_forces.reshape(-1, 3)
    return ArrowScale(force=fit(np.vstack([motion.force, contacts]), 1.0), moment=fit(motion.moment, 0.01))


def draw_scene(motion: Motion) -> PageWindow:
    """Draws the scene of a motion and its animation; a frame of the animation is a second of the motion."""
    window = PageWindow()
    scene = meshcat.Visualizer(window=window)
    _set_stage(scene)
    _draw_block(scene["hole"], motion.geometry)
    _draw_peg(scene["peg"], motion.geometry)
    animation, scale = Animation(), arrow_scale(motion)
    times = [float(t) for t in motion.time]
    _animate_pose(animation, scene["hole"], times, motion.p_WH, motion.R_WH)
    _animate_pose(animation, scene["peg"], times, motion.p_WP, motion.R_WP)
    arrows = {  # colour, number of heads, start and vector of each
        "force": (FORCE_COLOUR, 1, motion.p_WP, motion.R_WP.apply(motion.force) / scale.force),
        "moment": (MOMENT_COLOUR, 2, motion.p_WP, motion.R_WP.apply(motion.moment) / scale.moment),
    }
    if motion.contact_points is not None and motion.contact_forces is not None:
        points, forces = motion.contact_points, motion.contact_forces / scale.force
        arrows |= {
            f"contact_{place}": (CONTACT_COLOUR, 1, points[:, k], forces[:, k]) for k, place in enumerate(ContactPlace)
        }
    for name, (colour, heads, starts, vectors) in arrows.items():
        _draw_arrow(scene[name], colour, heads=heads)
        _animate_arrow(animation, scene[name], times, starts, vectors)
    window.send(SetAnimation(animation, play=True, repetitions=1))
    return window


def _set_stage(scene: meshcat.Visualizer) -> None:
    # The camera orbits the origin of this path. Below the path, y points upwards.
    scene["/Cameras/default"].set_transform(_transform(TARGET))
    x, y, z = (CAMERA - TARGET).tolist()
    camera = "/Cameras/default/rotated/" + OBJECT
    for path, name, value in (
        ("/Grid", "visible", False),
        ("/Axes", "visible", False),
        ("/Background", "top_color", [0.98, 0.985, 0.99]),
        ("/Background", "bottom_color", [0.77, 0.80, 0.84]),
        ("/Lights/AmbientLight/" + OBJECT, "intensity", 0.62),
        ("/Lights/FillLight/" + OBJECT, "intensity", 0.25),
        (camera, "near", 0.001),  # the viewer's default of 10 mm would cut off parts of a zoomed scene
        (camera, "far", 10.0),
        (camera, "fov", FIELD_OF_VIEW),
        (camera, "position", [x, z, -y]),
    ):
        scene[path].set_property(name, value)


def _draw_block(node: meshcat.Visualizer, size: PegHoleGeometry) -> None:
    """Draws the block, cut open to the camera; replay.js draws its edges."""
    assembly = Assembly.of(size)
    block = assembly.block_mesh(size.facets, block_radius=size.block_radius, floor=size.floor)
    material = shapes.MeshPhongMaterial(color=BLOCK_COLOUR, shininess=12, flatShading=True, side=2)
    node["body"].set_object(shapes.TriangularMeshGeometry(block.vertices, block.triangles), material)


def _draw_peg(node: meshcat.Visualizer, size: PegHoleGeometry) -> None:
    """Draws the peg; replay.js gives it the colour of the phase."""
    assembly = Assembly.of(size)
    peg = assembly.peg_mesh(FACETS)
    material = shapes.MeshPhongMaterial(shininess=25, flatShading=True)
    node["body"].set_object(shapes.TriangularMeshGeometry(peg.vertices, peg.triangles), material)
    for i, mate in enumerate(assembly.fits):
        mark = mate.peg.scaled(1.0005).polyline(FACETS) + mate.tip[:2]
        for k, z in enumerate(np.arange(mate.tip[2], mate.top, MARK_SPACING)):
            ring = np.column_stack([np.vstack([mark, mark[:1]]), np.full(len(mark) + 1, z)])
            geometry = shapes.PointsGeometry(ring.astype(np.float32).T)
            node[f"mark{i}_{k}"].set_object(shapes.Line(geometry, shapes.LineBasicMaterial(color=EDGE_COLOUR)))


def _draw_arrow(node: meshcat.Visualizer, colour: int, *, heads: int) -> None:
    """Draws an arrow along z with a shaft of 1 m; the animation scales the shaft."""
    # Without a depth test: the arrow begins at the tip of the peg, which the bore hides.
    material = shapes.MeshPhongMaterial(
        color=colour, emissive=colour, emissiveIntensity=0.45, transparent=True, opacity=0.999, depthTest=False, side=0
    )
    node["shaft/rod"].set_object(shapes.Cylinder(1.0, ARROW_RADIUS), material)
    node["shaft/rod"].set_transform(_upright_cylinder(centre=0.5))
    length = HEAD_LENGTH / heads
    for k in range(heads):
        cone = shapes.Cylinder(length, radiusTop=0.0, radiusBottom=2.6 * ARROW_RADIUS)
        node[f"head/cone{k}"].set_object(cone, material)
        node[f"head/cone{k}"].set_transform(_upright_cylinder(centre=0.5 * length + (heads - 1 - k) * length))


def _transform(translation: ArrayLike) -> Array:
    """Returns a (4, 4) translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = translation
    return matrix


def _upright_cylinder(*, centre: float) -> Array:
    """Returns the (4, 4) transform of meshcat's cylinder, whose axis is y, to the axis z at height ``centre`` m."""
    matrix = _transform([0.0, 0.0, centre])
    matrix[:3, :3] = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0]).as_matrix()
    return matrix


# ---------------------------------------------------------------------- animation


def _set_track(
    animation: Animation, node: meshcat.Visualizer, name: str, kind: str, times: list[float], values: ArrayLike
) -> None:
    """Gives the property ``name`` of a node one value for each of ``times`` (s)."""
    clip = animation.clips.setdefault(node.path, AnimationClip(fps=1))
    clip.tracks[name] = AnimationTrack(name, kind, times, np.asarray(values, dtype=float).tolist())


def _animate_pose(
    animation: Animation, node: meshcat.Visualizer, times: list[float], positions: Array, rotations: Rotation
) -> None:
    _set_track(animation, node, "position", "vector3", times, positions)
    quaternions = rotations.as_quat()
    # q and -q are the same rotation. Without a change of sign the viewer interpolates the short way.
    flips = np.sign(np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]))
    quaternions[1:] *= np.cumprod(np.where(flips == 0, 1.0, flips))[:, None]
    _set_track(animation, node, "quaternion", "quaternion", times, quaternions)


def _animate_arrow(
    animation: Animation, node: meshcat.Visualizer, times: list[float], starts: Array, arrows: Array
) -> None:
    """Moves an arrow to ``starts`` (n, 3) and stretches it along ``arrows`` (n, 3), both m, in W."""
    length = np.linalg.norm(arrows, axis=1)
    size = np.clip(length / (1.5 * HEAD_LENGTH), 1e-4, 1.0)  # scale of the whole arrow
    shaft = np.maximum(length, 1.5 * HEAD_LENGTH) - HEAD_LENGTH
    _animate_pose(animation, node, times, starts, _rotations_from_z(arrows))
    _set_track(animation, node, "scale", "vector3", times, np.repeat(size[:, None], 3, axis=1))
    ones = np.ones_like(shaft)
    _set_track(animation, node["shaft"], "scale", "vector3", times, np.column_stack([ones, ones, shaft]))
    zeros = np.zeros_like(shaft)
    _set_track(animation, node["head"], "position", "vector3", times, np.column_stack([zeros, zeros, shaft]))


def _rotations_from_z(vectors: Array) -> Rotation:
    """Returns the n smallest rotations that turn z into ``vectors`` (n, 3); the identity for a zero vector."""
    norm = np.linalg.norm(vectors, axis=1)
    unit = np.where(norm[:, None] > 1e-12, vectors / np.maximum(norm, 1e-12)[:, None], [0.0, 0.0, 1.0])
    quaternion = np.column_stack([-unit[:, 1], unit[:, 0], np.zeros(len(unit)), 1.0 + unit[:, 2]])
    quaternion[unit[:, 2] < -1 + 1e-9] = [1.0, 0.0, 0.0, 0.0]
    return Rotation.from_quat(quaternion)
