"""One self-contained HTML page of a replay: the viewer, the animated scene, readings, tilt dial and timeline.

The layout is in replay.html and replay.css; replay.js moves the time.
"""

from __future__ import annotations

import html
import math
from pathlib import Path

import numpy as np

from interfaces.reports.motion import GUARD, Motion, read_motion
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
from interfaces.reports.series import TICKS, bands, curve, drawing
from skill.arrays import Array
from skill.data.axes import AXES
from skill.data.files import write_atomically

GUARD_COLOURS = ("transparent", "#1d232966", "#1d2329")
"""Marks in the timeline for `GUARD`."""

RINGS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0)
"""Tilts that a ring of the dial may stand for, deg."""


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
    scale, ring = arrow_scale(motion), _ring(motion)
    names, texts = zip(*_readings(motion), strict=True)
    # Up on the dial points away from the first place of the camera.
    azimuth = math.atan2(CAMERA[1], CAMERA[0])
    turn = np.array([[-math.sin(azimuth), math.cos(azimuth)], [math.cos(azimuth), math.sin(azimuth)]])
    lean = motion.lean @ turn / math.radians(3.0 * ring)
    lateral = motion.lateral_force @ turn / max(float(np.linalg.norm(motion.lateral_force, axis=1).max()), 1e-9)
    per_cm = f"{10.0 * scale.moment:g} N mm" if scale.moment < 10.0 else f"{0.01 * scale.moment:g} N m"
    colours = {"force": FORCE_COLOUR, "moment": MOMENT_COLOUR, "contact": CONTACT_COLOUR}
    data = script_value(
        {
            "speed": speed,
            "time": np.round(motion.time, 6).tolist(),
            "readings": texts,
            "phase": motion.phase.tolist(),
            "colours": motion.colours,
            "lean": np.round(lean, 4).tolist(),
            "lateral": np.round(lateral, 4).tolist(),
        }
    )
    return fill_page(
        "replay",
        assets=("replay",),
        style=f":root {{ {'; '.join(f'--{name}: #{colour:06X}' for name, colour in colours.items())} }}\n",
        title=html.escape(title),
        about=html.escape(f"{motion.kind}: {motion.outcome}"),
        readings="".join(f'<tr><td>{name}</td><td class="reading"></td></tr>' for name in names),
        colouring=motion.colouring,
        phases=_legend(motion),
        contacts="" if motion.contact_forces is not None else "hidden",
        force_scale=f"{0.01 * scale.force:g} N",
        moment_scale=per_cm,
        ring=f"{ring:g}",
        axes="".join(
            f'<path d="M0 0L{x:.3f} {y:.3f}"/><text x="{1.12 * x:.3f}" y="{1.12 * y + 0.04:.3f}">{name}</text>'
            for name, (x, y) in zip("xy", turn, strict=True)
        ),
        path=_dial_path(motion, lean),
        timeline=_timeline(motion),
        viewer=viewer_source(),
        script=f"const data = {data};\nconst sceneCommands = {script_value(draw_scene(motion).commands)};\n",
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


def _readings(motion: Motion) -> list[tuple[str, list[str]]]:
    """The name and the text of each sample of everything that the page shows in numbers."""
    found = [
        ("depth of the tip", _texts(1e3 * motion.depth, 2, "mm")),
        ("tilt in the hole", _texts(np.degrees(np.linalg.norm(motion.lean, axis=1)), 2, "°")),
        ("axial force", _texts(motion.force[:, 2], 1, "N")),
        ("lateral force", _texts(np.linalg.norm(motion.lateral_force, axis=1), 1, "N")),
        ("moment", _texts(1e3 * np.linalg.norm(motion.moment, axis=1), 1, "N mm")),
    ]
    if motion.contact_forces is not None:
        forces = np.linalg.norm(motion.contact_forces, axis=2)
        found.append(("mouth, tip, face", [f"{a:.1f}, {b:.1f}, {c:.1f} N" for a, b, c in forces]))
    if motion.steps is not None and motion.guard is not None:
        limit = "" if motion.force_limit is None else f"of {motion.force_limit:.0f} "
        found += [
            ("load", _texts(motion.load, 1, f"{limit}N")),
            ("back-off", [GUARD[k] for k in motion.guard]),
            ("microsteps", [", ".join(map(str, taken)) for taken in motion.steps.tolist()]),
        ]
    return found


def _texts(values: Array, digits: int, unit: str) -> list[str]:
    return [f"{value:.{digits}f} {unit}" for value in np.round(values, digits) + 0.0]  # + 0: no "-0"


def _legend(motion: Motion) -> str:
    """A row for each phase that occurs, with its share of the samples; then the names of the others."""
    counts = np.bincount(motion.phase, minlength=len(motion.phases))
    rows = "".join(
        f'<div data-phase="{k}"><i style="background: {motion.colours[k]}"></i><span>{html.escape(motion.phases[k])}'
        f'</span><span class="share">{max(1, round(100 * counts[k] / len(motion.phase)))} %</span></div>'
        for k in np.flatnonzero(counts).tolist()
    )
    unused = ", ".join(html.escape(motion.phases[k]) for k in np.flatnonzero(counts == 0))
    return f'{rows}<p class="about">{f"never: {unused}" if unused else ""}</p>'


def _ring(motion: Motion) -> float:
    """The tilt of which the dial has three rings, deg."""
    largest = math.degrees(np.linalg.norm(motion.lean, axis=1).max())
    return next((ring for ring in RINGS if largest <= 3.0 * ring), RINGS[-1])


def _dial_path(motion: Motion, lean: Array) -> str:
    """The path of the lean over the dial, in the colours of the phases."""
    starts = [0, *(np.flatnonzero(np.diff(motion.phase)) + 1).tolist()]
    points = [f"{x:.4f},{y:.4f}" for x, y in lean]
    runs = zip(starts, [*starts[1:], None], strict=True)
    return "".join(
        f'<polyline stroke="{motion.colours[motion.phase[k]]}" points="{" ".join(points[max(k - 1, 0) : end])}"/>'
        for k, end in runs
    )


def _timeline(motion: Motion) -> str:
    """Depth and force or load over the phases, and what the rig did."""
    end, depth = float(motion.time[-1]), 1e6 * motion.depth  # um
    force = np.linalg.norm(motion.force, axis=1) if motion.steps is None else motion.load
    limit = motion.force_limit or 0.0
    labels = [f"depth, down to {1e-3 * depth.max():.1f} mm", f'<b class="force">force, up to {force.max():.1f} N</b>']
    marks = ""
    if motion.steps is not None and motion.guard is not None:
        bound = f" (limit {limit:g} N)" if limit else ""
        labels[1] = f'<b class="force">load, up to {force.max():.1f} N{bound}</b>'
        labels += ["▬ backs off, pale: turns reversed", f"❘ steps of {', '.join(AXES[: motion.steps.shape[1]])}"]
        ticks = "".join(
            f"M{TICKS * motion.time[k]:.0f} {axis}v.7"
            for axis, taken in enumerate(motion.steps.T)
            for k in np.flatnonzero(np.diff(taken)) + 1
        )
        marks = f'<div class="guard">{bands(motion.time, motion.guard, GUARD_COLOURS, GUARD)}</div>' + drawing(
            end, -motion.steps.shape[1], 0.0, f'<path d="{ticks}"/>', 'class="steps"'
        )
    bound = f'<path class="limit" d="M0 {-1e3 * limit:.0f}H{TICKS * end:.0f}"/>' if limit else ""
    curves = drawing(
        end, -depth.max(), max(0.0, -depth.min()) + 1.0, f'<path d="{curve(motion.time, -depth)}"/>'
    ) + drawing(
        end,
        0.0,
        1e3 * max(force.max(), limit, 1e-3),
        f'{bound}<path class="force" d="{curve(motion.time, 1e3 * force)}"/>',
    )
    phases = bands(motion.time, motion.phase, motion.colours, motion.phases)
    return (
        f'<div class="labels"><span>{"</span><span>".join(labels)}</span><span>{end:.2f} s</span></div>'
        f'<div id="timeline"><div class="tint">{phases}</div>{curves}<div class="band">{phases}</div>{marks}'
        '<div class="cursor"></div></div>'
    )
