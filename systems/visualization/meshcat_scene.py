"""Aims Meshcat at millimetre scale, and records its scene as one HTML page with a legend."""

from __future__ import annotations

import html
import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from string import Template

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from skill.arrays import Array
from skill.data.files import write_atomically
from skill.states.state_style import state_colours
from systems.visualization.plant_display import FORCE_COLOUR, NEWTONS_PER_CENTIMETRE
from systems.visualization.state_display import PATH

logging.getLogger("drake").setLevel(logging.WARNING)  # hides the address that every Meshcat logs

CAMERA = np.array([0.062, 0.055, 0.030])  # in units of m, in W; it looks at TARGET
TARGET = np.array([0.0, 0.0, -0.004])  # in units of m, in W
RECORDING_CAMERA = np.array([0.124, 0.110, 0.070])  # in units of m, in W; the whole peg is in the picture
RECORDING_TARGET = np.array([0.0, 0.0, 0.004])  # in units of m, in W
RECORDING_FIELD = 42.0  # in units of deg, vertical field of view
LOCAL_HOST = "127.0.0.1"  # Meshcat checks nobody: only this machine may reach it
FRAME = 1 / 32  # in units of s, between two pictures
LEGEND = Path(__file__).with_name("legend.html")


@contextmanager
def recorded(path: Path, *, states: Sequence[str] = ()) -> Iterator[Meshcat]:
    """Yields a Meshcat that records; at the end of the context the recording is written as an HTML page.

    Args:
        path: file of the page. It is not written if the context ends with an exception.
        states: names of the contact states that `StateDisplay` shows, for the legend.
    """
    meshcat = Meshcat(MeshcatParams(host=LOCAL_HOST))
    aim_camera(meshcat, camera=RECORDING_CAMERA, target=RECORDING_TARGET)
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", RECORDING_FIELD)
    meshcat.SetProperty("/Background", "top_color", [0.98, 0.985, 0.99])
    meshcat.SetProperty("/Background", "bottom_color", [0.77, 0.80, 0.84])
    meshcat.StartRecording(frames_per_second=1 / FRAME, set_visualizations_while_recording=False)
    yield meshcat
    meshcat.StopRecording()
    meshcat.PublishRecording()
    page, _, end = meshcat.StaticHtml().rpartition("</body>")
    write_atomically(path, f"{page}{legend(states)}</body>{end}".encode())


def legend(states: Sequence[str]) -> str:
    """Returns the HTML that says what the arrow is, and which colour of the peg is which contact state."""
    colours = state_colours(len(states)) if states else []
    rows = "".join(
        f'<div class="state"><i style="background: {colour}"></i>{html.escape(name)}</div>'
        for name, colour in zip(states, colours, strict=True)
    )
    values = {
        "force_colour": FORCE_COLOUR,
        "force_scale": f"{NEWTONS_PER_CENTIMETRE:g} N",
        "states": f"<h2>colour of the peg: contact state</h2>{rows}" if states else "",
        "path": PATH,
    }
    return Template(LEGEND.read_text(encoding="utf-8")).substitute(values)


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
