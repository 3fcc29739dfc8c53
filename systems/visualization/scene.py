"""What a person sees: the millimetre scene, cut open, with its contact forces."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.systems.framework import DiagramBuilder

from skill.data.tables import write_atomically
from systems.plant.contact_plant import ContactPlant

CAMERA = np.array([0.062, 0.055, 0.030])  # in units of m, in W; it looks at TARGET
TARGET = np.array([0.0, 0.0, -0.004])
FRAME = 1 / 32  # in units of s, between two pictures
NEWTONS_PER_METRE = 600.0  # of a contact arrow


def AddVisualization(
    *, builder: DiagramBuilder, contact: ContactPlant, meshcat: Meshcat, contact_forces: bool = True
) -> None:
    """Draws the bodies of a plant and, if wanted, its contact forces into ``meshcat``; the camera stays where it is."""
    MeshcatVisualizer.AddToBuilder(
        builder,
        contact.scene_graph,
        meshcat,
        MeshcatVisualizerParams(role=Role.kIllustration, prefix="visualizer", publish_period=FRAME),
    )
    if not contact_forces:
        return
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
    """A Meshcat that records what is simulated within the context, and leaves it at ``path`` as one HTML page."""
    meshcat = Meshcat()
    aim_camera(meshcat)
    meshcat.StartRecording(frames_per_second=1 / FRAME, set_visualizations_while_recording=False)
    yield meshcat
    meshcat.StopRecording()
    meshcat.PublishRecording()
    write_atomically(path, meshcat.StaticHtml().encode())


def aim_camera(meshcat: Meshcat, *, camera: NDArray[np.float64] = CAMERA, target: NDArray[np.float64] = TARGET) -> None:
    """Puts the camera (m, in W) where the cut of the block opens, and takes the metre-sized grid away."""
    meshcat.SetCameraPose(camera_in_world=camera, target_in_world=target)
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
