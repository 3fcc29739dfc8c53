"""Draws the plant, cut open at millimetre scale, and its contact forces into Meshcat."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams, MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.systems.framework import DiagramBuilder

from skill.arrays import Array
from skill.data.tables import write_atomically
from systems.plant.contact_plant import ContactPlant

logging.getLogger("drake").setLevel(logging.WARNING)  # hides the address that every Meshcat logs

CAMERA = np.array([0.062, 0.055, 0.030])  # in units of m, in W; it looks at TARGET
TARGET = np.array([0.0, 0.0, -0.004])  # in units of m, in W
LOCAL_HOST = "127.0.0.1"  # Meshcat checks nobody: only this machine may reach it
FRAME = 1 / 32  # in units of s, between two pictures
NEWTONS_PER_METRE = 600.0  # scale of the arrows of contact forces


def AddVisualization(*, builder: DiagramBuilder, contact: ContactPlant, meshcat: Meshcat) -> None:
    """Adds visualizers of a plant to a diagram.

    Args:
        builder: builder of the diagram.
        contact: the plant.
        meshcat: Meshcat to draw into; its camera is not moved.
    """
    MeshcatVisualizer.AddToBuilder(
        builder,
        contact.scene_graph,
        meshcat,
        MeshcatVisualizerParams(role=Role.kIllustration, prefix="visualizer", publish_period=FRAME),
    )
    ContactVisualizer.AddToBuilder(
        builder,
        contact.plant,
        meshcat,
        ContactVisualizerParams(
            publish_period=FRAME,
            newtons_per_meter=NEWTONS_PER_METRE,
            newton_meters_per_meter=50.0,
            radius=0.0006,
            force_threshold=0.2,
        ),
    )


@contextmanager
def recorded(path: Path) -> Iterator[Meshcat]:
    """Yields a Meshcat that records; at the end of the context the recording is written as an HTML page.

    Args:
        path: file of the page. It is not written if the context ends with an exception.
    """
    meshcat = Meshcat(MeshcatParams(host=LOCAL_HOST))
    aim_camera(meshcat)
    meshcat.StartRecording(frames_per_second=1 / FRAME, set_visualizations_while_recording=False)
    yield meshcat
    meshcat.StopRecording()
    meshcat.PublishRecording()
    write_atomically(path, meshcat.StaticHtml().encode())


def aim_camera(meshcat: Meshcat, *, camera: Array = CAMERA, target: Array = TARGET) -> None:
    """Points the camera at the scene and hides the grid and the axes, which are metres wide.

    Args:
        meshcat: Meshcat to change.
        camera: (3,), position of the camera in W, m.
        target: (3,), point that the camera looks at, in W, m.
    """
    meshcat.SetCameraPose(camera_in_world=camera, target_in_world=target)
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
