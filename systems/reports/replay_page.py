"""One self-contained HTML page of a replay: the viewer, the scene with its animation, and the overlay."""

from __future__ import annotations

import html
import json
import math
from typing import Any

import numpy as np

from systems.reports.motion import Motion
from systems.reports.overlay import BODY, SCRIPT, STYLE
from systems.reports.scene import CAMERA, FORCE_COLOUR, MOMENT_COLOUR, arrow_scale, draw_scene, viewer_source

PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title><link rel="icon" href="data:,"><style>{style}</style></head>
<body>
<div id="meshcat-pane"></div>
{body}
<script>{viewer}</script>
<script>
var viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
{scene}
const data = {data};
{script}
</script>
</body>
</html>
"""


def replay_page(motion: Motion, *, title: str, speed: float = 1.0) -> str:
    """The page as text.

    Args:
        motion: to show.
        title: of the page, mostly the file's name.
        speed: of the replay, over that of the motion.

    Raises:
        ValueError: if the speed is not above 0.
    """
    if not (math.isfinite(speed) and speed > 0):
        raise ValueError(f"speed {speed}, expected a number above 0 (1 is the speed of the motion)")
    body = BODY.replace("FORCE", f"#{FORCE_COLOUR:06X}").replace("MOMENT", f"#{MOMENT_COLOUR:06X}")
    # "</" would end the script that carries the text, wherever a name holds it.
    data = json.dumps(_overlay_data(motion, title, speed), separators=(",", ":")).replace("</", "<\\/")
    return PAGE.format(
        title=html.escape(title),
        style=STYLE.replace("FORCE", f"#{FORCE_COLOUR:06X}"),
        body=body,
        viewer=viewer_source(),
        scene=draw_scene(motion).script(),
        data=data,
        script=SCRIPT,
    )


def _overlay_data(motion: Motion, title: str, speed: float) -> dict[str, Any]:
    scale = arrow_scale(motion)

    def rounded(values: Any, digits: int) -> Any:
        return np.round(np.asarray(values, dtype=float), digits).tolist()

    return {
        "title": title,
        "about": f"{motion.kind}: {motion.outcome}",
        "speed": speed,
        "time": rounded(motion.time, 6),
        "depth": rounded(motion.depth, 7),
        "lean": rounded(motion.lean, 7),
        "lateral": rounded(motion.lateral_force, 4),
        "axial": rounded(motion.force[:, 2], 4),
        "force": rounded(np.linalg.norm(motion.force, axis=1), 4),
        "moment": rounded(np.linalg.norm(motion.moment, axis=1), 7),
        "phase": motion.phase.tolist(),
        "phases": motion.phases,
        "colours": motion.colours,
        "colouring": motion.colouring,
        "guard": None if motion.guard is None else motion.guard.tolist(),
        "load": rounded(motion.load, 4),
        "limit": motion.force_limit,
        "steps": None if motion.steps is None else motion.steps.T.tolist(),
        "force_colour": f"#{FORCE_COLOUR:06X}",
        "force_scale": f"{0.01 * scale.force:g} N",
        "moment_scale": f"{10.0 * scale.moment:g} N mm" if scale.moment < 10 else f"{0.01 * scale.moment:g} N m",
        "azimuth": math.atan2(CAMERA[1], CAMERA[0]),
    }
