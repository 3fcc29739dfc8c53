"""Geometry and motion as a meshcat scene with an animation: shapes, colours, arrows, light and camera; no Drake."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import meshcat
import meshcat.geometry as shapes
import numpy as np
import umsgpack
from meshcat.animation import Animation, AnimationClip, AnimationTrack
from meshcat.commands import SetAnimation
from scipy.spatial.transform import Rotation

from skill.arrays import Array
from systems.reports.motion import KEPT, Motion, make_block

TARGET = np.array([0.0, 0.0, 0.004])  # in units of m, in W; the camera looks at it
CAMERA = np.array([0.124, 0.110, 0.070])  # in units of m, in W
FIELD_OF_VIEW = 42.0  # in units of deg, vertical

BLOCK_COLOUR = 0xA9B2BB
EDGE_COLOUR = 0x3A4148
FORCE_COLOUR = 0xC1121F
MOMENT_COLOUR = 0x6A1B9A
ARROW_LENGTH = 0.035  # in units of m, of the largest arrow at most
ARROW_RADIUS = 0.0007  # in units of m
HEAD = 0.004  # in units of m; a shorter arrow shrinks as a whole
MARK_SPACING = 0.005  # in units of m, of the rings on the peg
PEG_EMISSION = 0.25  # of its colour, so that shading does not hide it

OBJECT = "<object>"  # the viewer's name for what hangs on a path


class PageWindow:
    """A window that nobody has opened: it keeps the drawing commands, in order, for a page that stands alone.

    It takes the place of meshcat's own window, which needs a server process and two free ports.
    """

    def __init__(self) -> None:
        self.commands: list[bytes] = []

    def send(self, command: Any) -> None:
        """Keeps one command."""
        self.commands.append(umsgpack.packb(command.lower()))

    def script(self) -> str:
        """JavaScript that draws it all, once ``viewer`` exists."""
        encoded = ",\n".join(f'"{base64.b64encode(c).decode()}"' for c in self.commands)
        return (
            f"for (const command of [\n{encoded}]) {{\n"
            "  viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));\n"
            "}\n"
        )


def viewer_source() -> str:
    """The viewer's JavaScript, as the meshcat package brings it."""
    return (Path(meshcat.viewer_assets_path()) / "dist" / "main.min.js").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Scale:
    """Of the arrows: what a metre of each stands for, in N and N m."""

    force: float
    moment: float


def arrow_scale(motion: Motion) -> Scale:
    """The scale from the series 1, 2, 5, 10, ... (a centimetre's worth) at which the largest arrow fits."""

    def fit(vectors: Array, least: float) -> float:
        largest = max(float(np.linalg.norm(vectors, axis=1).max()), least)
        wanted = 0.01 * largest / ARROW_LENGTH
        decade = 10.0 ** np.floor(np.log10(wanted))
        return 100.0 * float(next(m * decade for m in (1, 2, 5, 10) if m * decade >= wanted * (1 - 1e-9)))

    return Scale(force=fit(motion.force, 1.0), moment=fit(motion.moment, 0.01))


def draw_scene(motion: Motion) -> PageWindow:
    """Draws everything, and hangs the animation on it, in seconds of the motion."""
    window = PageWindow()
    scene = meshcat.Visualizer(window=window)
    _set_stage(scene)
    _draw_block(scene["hole"], motion.geometry)
    _draw_peg(scene["peg"], motion)
    scale = arrow_scale(motion)
    for name, colour, heads in (("force", FORCE_COLOUR, 1), ("moment", MOMENT_COLOUR, 2)):
        _draw_arrow(scene[name], colour, heads)
    animation = Animation(default_framerate=1)  # so that a frame is a second
    times = [float(t) for t in motion.time]
    _animate(animation, scene["hole"], times, motion.p_WH, motion.R_WH)
    _animate(animation, scene["peg"], times, motion.p_WP, motion.R_WP)
    _animate_colour(animation, scene["peg/body"], motion)
    for name, vector_P, per_metre, heads in (
        ("force", motion.force, scale.force, 1),
        ("moment", motion.moment, scale.moment, 2),
    ):
        vector = motion.R_WP.apply(vector_P) / per_metre
        _animate_arrow(animation, scene[name], times, motion.p_WP, vector, heads)
    window.send(SetAnimation(animation, play=True, repetitions=1))
    return window


def _set_stage(scene: meshcat.Visualizer) -> None:
    scene["/Grid"].set_property("visible", False)
    scene["/Axes"].set_property("visible", False)
    scene["/Background"].set_property("top_color", [0.98, 0.985, 0.99])
    scene["/Background"].set_property("bottom_color", [0.77, 0.80, 0.84])
    scene["/Lights/AmbientLight/" + OBJECT].set_property("intensity", 0.62)
    scene["/Lights/FillLight/" + OBJECT].set_property("intensity", 0.25)
    # The orbit's centre is the origin of this path; the camera below it sees y upwards.
    look = np.eye(4)
    look[:3, 3] = TARGET
    scene["/Cameras/default"].set_transform(look)
    camera = scene["/Cameras/default/rotated/" + OBJECT]
    offset = CAMERA - TARGET
    camera.set_property("near", 0.001)  # the viewer's own plane at 10 mm would cut into a zoomed scene
    camera.set_property("far", 10.0)
    camera.set_property("fov", FIELD_OF_VIEW)
    camera.set_property("position", [float(offset[0]), float(offset[2]), float(-offset[1])])


def _draw_block(node: meshcat.Visualizer, size: dict[str, float]) -> None:
    facets = round(size["facets"])
    kept = (round(KEPT[0] * facets), round(KEPT[1] * facets))
    block = make_block(size)
    material = shapes.MeshPhongMaterial(color=BLOCK_COLOUR, shininess=12, flatShading=True, side=2)
    node["body"].set_object(shapes.TriangularMeshGeometry(block.vertices, block.triangles), material)

    angles = 2.0 * np.pi * np.arange(kept[0], kept[1] + 1) / facets
    bottom = -size["hole_depth"] - size["floor"]
    rim = size["hole_radius"] + size["chamfer"]
    for k, (radius, z) in enumerate(
        (
            (rim, 0.0),
            (size["hole_radius"], -size["chamfer"]),
            (size["hole_radius"], -size["hole_depth"]),
            (size["block_radius"], 0.0),
            (size["block_radius"], bottom),
        )
    ):
        _draw_line(node[f"edge{k}"], _circle(radius, angles, z))
    section = [
        *((-size["block_radius"], bottom), (-size["block_radius"], 0.0), (-rim, 0.0)),
        *((-size["hole_radius"], -size["chamfer"]), (-size["hole_radius"], -size["hole_depth"])),
    ]
    outline = np.array(section + [(-r, z) for r, z in reversed(section)] + section[:1])
    across = np.array([np.cos(angles[-1]), np.sin(angles[-1]), 0.0])
    _draw_line(node["section"], outline[:, :1] * across + outline[:, 1:] * np.array([0.0, 0.0, 1.0]))


def _draw_peg(node: meshcat.Visualizer, motion: Motion) -> None:
    length, radius = motion.geometry["peg_length"], motion.geometry["peg_radius"]
    first = int(motion.colours[motion.phase[0]][1:], 16)
    material = shapes.MeshPhongMaterial(color=first, shininess=25)
    upright = np.eye(4)
    upright[:3, :3] = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0]).as_matrix()  # meshcat's cylinders lie along y
    upright[2, 3] = length / 2
    node["body"].set_object(shapes.Cylinder(length, radius), material)
    node["body"].set_transform(upright)
    turn = np.linspace(0.0, 2.0 * np.pi, 97)
    for k, z in enumerate(np.arange(0.0, length, MARK_SPACING)):
        _draw_line(node[f"mark{k}"], _circle(radius * 1.0005, turn, float(z)))


def _draw_arrow(node: meshcat.Visualizer, colour: int, heads: int) -> None:
    # Drawn over everything: the tip, where the wrench acts, is out of sight in the bore.
    material = shapes.MeshPhongMaterial(
        color=colour, emissive=colour, emissiveIntensity=0.45, transparent=True, opacity=0.999, depthTest=False, side=0
    )
    along = np.eye(4)
    along[:3, :3] = Rotation.from_rotvec([np.pi / 2, 0.0, 0.0]).as_matrix()
    middle = along.copy()
    middle[2, 3] = 0.5
    node["shaft/rod"].set_object(shapes.Cylinder(1.0, ARROW_RADIUS), material)
    node["shaft/rod"].set_transform(middle)
    for k in range(heads):
        length = HEAD / heads
        centre = along.copy()
        centre[2, 3] = 0.5 * length + (heads - 1 - k) * length
        node[f"head/cone{k}"].set_object(
            shapes.Cylinder(length, radiusTop=0.0, radiusBottom=2.6 * ARROW_RADIUS), material
        )
        node[f"head/cone{k}"].set_transform(centre)


def _draw_line(node: meshcat.Visualizer, points: Array) -> None:
    geometry = shapes.PointsGeometry(np.asarray(points, dtype=np.float32).T)
    node.set_object(shapes.Line(geometry, shapes.LineBasicMaterial(color=EDGE_COLOUR)))


def _circle(radius: float, angles: Array, z: float) -> Array:
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full_like(angles, z)])


# ---------------------------------------------------------------------- animation


def _track(
    animation: Animation, node: meshcat.Visualizer, name: str, kind: str, times: list[float], values: Any
) -> None:
    clip = animation.clips.setdefault(node.path, AnimationClip(fps=1))
    clip.tracks[name] = AnimationTrack(name, kind, times, np.asarray(values, dtype=float).tolist())


def _animate(
    animation: Animation, node: meshcat.Visualizer, times: list[float], positions: Array, rotations: Rotation
) -> None:
    _track(animation, node, "position", "vector3", times, positions)
    quaternions = rotations.as_quat()
    # The same way round from key to key, else the interpolation goes about the long way.
    flips = np.sign(np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1]))
    quaternions[1:] *= np.cumprod(np.where(flips == 0, 1.0, flips))[:, None]
    _track(animation, node, "quaternion", "quaternion", times, quaternions)


def _animate_colour(animation: Animation, node: meshcat.Visualizer, motion: Motion) -> None:
    colours = np.array([[int(c[i : i + 2], 16) / 255 for i in (1, 3, 5)] for c in motion.colours])
    turns = np.flatnonzero(np.diff(motion.phase)) + 1
    times, values = [0.0], [colours[motion.phase[0]]]
    for k in turns:  # a step: the old colour is held until the new one sets in
        times += [float(motion.time[k]) - 1e-4, float(motion.time[k])]
        values += [colours[motion.phase[k - 1]], colours[motion.phase[k]]]
    if times[-1] < motion.time[-1]:  # all clips end together
        times.append(float(motion.time[-1]))
        values.append(colours[motion.phase[-1]])
    mesh = node[OBJECT]
    _track(animation, mesh, "material.color", "color", times, values)
    _track(animation, mesh, "material.emissive", "color", times, PEG_EMISSION * np.array(values))


def _animate_arrow(
    animation: Animation, node: meshcat.Visualizer, times: list[float], tips: Array, vectors: Array, heads: int
) -> None:
    length = np.linalg.norm(vectors, axis=1)
    whole = np.clip(length / (1.5 * HEAD), 1e-4, 1.0)
    shaft = np.maximum(length, 1.5 * HEAD) - HEAD
    _animate(animation, node, times, tips, _turns_from_z(vectors))
    _track(animation, node, "scale", "vector3", times, np.repeat(whole[:, None], 3, axis=1))
    ones = np.ones_like(shaft)
    _track(animation, node["shaft"], "scale", "vector3", times, np.column_stack([ones, ones, shaft]))
    zeros = np.zeros_like(shaft)
    _track(animation, node["head"], "position", "vector3", times, np.column_stack([zeros, zeros, shaft]))


def _turns_from_z(vectors: Array) -> Rotation:
    """The shortest rotations that turn z into each of ``vectors`` (n, 3); none where a vector vanishes."""
    norm = np.linalg.norm(vectors, axis=1)
    unit = np.where(norm[:, None] > 1e-12, vectors / np.maximum(norm, 1e-12)[:, None], [0.0, 0.0, 1.0])
    quaternion = np.column_stack([-unit[:, 1], unit[:, 0], np.zeros(len(unit)), 1.0 + unit[:, 2]])
    quaternion[unit[:, 2] < -1 + 1e-9] = [1.0, 0.0, 0.0, 0.0]
    return Rotation.from_quat(quaternion)
