"""One self-contained HTML page of a replay: the viewer, the animated scene and the overlay.

The overlay (legend, readings, tilt dial and timeline) is in replay.html, replay.css and replay.js.
"""

from __future__ import annotations

import html
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from interfaces.reports.motion import Motion, read_motion
from interfaces.reports.page_template import fill_page, script_value
from interfaces.reports.replay_scene import (
    CAMERA,
    CONTACT_COLOUR,
    FORCE_COLOUR,
    MOMENT_COLOUR,
    arrow_scale,
    draw_scene,
    viewer_source,
)
from skill.data.files import write_atomically


def replay_page(motion: Motion, *, title: str, speed: float = 1.0) -> str:
    """Returns the page as HTML text.

    Args:
        motion: motion to replay.
        title: heading of the page, usually the name of the file.
        speed: playback speed; 1 is real time.

    Raises:
        ValueError: if the speed is not a finite number above 0.
    """
    if not (math.isfinite(speed) and speed > 0):
        raise ValueError(f"speed is {speed}, expected a finite number above 0 (1 is real time)")
    return fill_page(
        "replay",
        title=html.escape(title),
        viewer=viewer_source(),
        scene_commands=script_value(draw_scene(motion).commands_base64()),
        data=script_value(_overlay_data(motion, title, speed)),
    )


def write_replay(
    file: Path, page: Path, *, title: str | None = None, skill: Path | None = None, speed: float = 1.0
) -> Motion:
    """Writes the replay of a stored demonstration or rig run, and returns its motion.

    Args:
        file: demonstration or rig run (.parquet).
        page: HTML file to write.
        title: heading of the page; None takes the name of the file.
        skill: skill file that names the contact states of a demonstration.
        speed: speed of the replay; 1 is the speed of the motion.

    Raises:
        ValueError: if a file is not valid, or the speed is not positive.
        OSError: if the page cannot be written.
    """
    motion = read_motion(file, skill)
    html = replay_page(motion, title=file.stem if title is None else title, speed=speed)
    write_atomically(page, html.encode())
    return motion


def _overlay_data(motion: Motion, title: str, speed: float) -> dict[str, Any]:
    """The constant `data` of replay.js."""
    scale = arrow_scale(motion)
    newton_metres = scale.moment  # per metre of arrow; the legend gives a centimetre
    return {
        "title": title,
        "about": f"{motion.kind}: {motion.outcome}",
        "speed": speed,
        "time": _rounded(motion.time, 6),
        "depth": _rounded(motion.depth, 7),
        "lean": _rounded(motion.lean, 7),
        "lateral": _rounded(motion.lateral_force, 4),
        "axial": _rounded(motion.force[:, 2], 4),
        "force": _rounded(np.linalg.norm(motion.force, axis=1), 4),
        "moment": _rounded(np.linalg.norm(motion.moment, axis=1), 7),
        "phase": motion.phase.tolist(),
        "phases": motion.phases,
        "colours": motion.colours,
        "colouring": motion.colouring,
        "back_off": None if motion.back_off is None else motion.back_off.tolist(),
        "reversed": None if motion.reversed is None else motion.reversed.tolist(),
        "load": _rounded(motion.load, 4),
        "limit": motion.force_limit,
        "steps": None if motion.steps is None else motion.steps.T.tolist(),
        "force_colour": f"#{FORCE_COLOUR:06X}",
        "contacts": None
        if motion.contact_forces is None
        else _rounded(np.linalg.norm(motion.contact_forces, axis=2), 3),
        "contact_colour": f"#{CONTACT_COLOUR:06X}",
        "moment_colour": f"#{MOMENT_COLOUR:06X}",
        "force_scale": f"{0.01 * scale.force:g} N",
        "moment_scale": f"{10.0 * newton_metres:g} N mm" if newton_metres < 10 else f"{0.01 * newton_metres:g} N m",
        "azimuth": math.atan2(CAMERA[1], CAMERA[0]),
    }


def _rounded(values: ArrayLike, digits: int) -> Any:
    return np.round(np.asarray(values, dtype=float), digits).tolist()
