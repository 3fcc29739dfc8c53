"""Replays a stored demonstration or rig run as one HTML page, without Drake and without a simulation."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from scripts import rig
from scripts.command_line import OptionalSkillFile, parse_path, path_option

TRIAL = Path("out/replay")
"""Folder of the trial that is performed if no recording is named."""


def main(
    file: Annotated[
        Path | None,
        typer.Argument(
            parser=parse_path,
            metavar="[FILE]",
            help="A demonstration or a rig run (.parquet); the file itself says which.",
            show_default=f"performs a trial into {TRIAL}",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        path_option("FILE", "HTML page to write; replaces an existing file.", shown="FILE, ending in .html"),
    ] = None,
    skill: OptionalSkillFile = None,
    speed: Annotated[
        float, typer.Option(help="Speed of the replay; 1 is the speed of the motion, 0.25 slow motion.")
    ] = 1.0,
    open_page: Annotated[
        bool | None,
        typer.Option("--open/--no-open", help="Show the page in the web browser.", show_default="open at a terminal"),
    ] = None,
) -> None:
    """Turns a stored demonstration or rig run into one HTML page, and shows it.

    Reads the recording. The colour of the peg shows the contact state: a rig run contains its states, a demonstration
    needs a skill. Without one the colour shows the contact force. Writes one page with the scene, its motion and the
    viewer, which needs neither a network nor this program. Without a recording, a trial of the skill is performed.

    The page shows the block cut open, the peg, contact force and moment as arrows at the tip, and beside them the
    readings, a dial that magnifies the tilt, and a timeline. Drag in the view to turn it, scroll to zoom, drag on the
    timeline to move in time; the space bar plays and pauses. `page.html#t=1.5` opens it, paused, at 1.5 seconds.

    For example:

        haptic-skill replay out/demonstrations/000_good_expert.parquet --skill out/skill.npz

        haptic-skill replay out/rig/run_0003.parquet --speed 0.25 --out slow.html
    """
    from experiments.outputs.output_checks import check_file, named_errors
    from interfaces.reports.replay_page import write_replay
    from interfaces.terminal import busy, say

    if file is None:
        rig.main(skill, trials=1, out=TRIAL, jobs=1, overwrite=True)
        file, skill = TRIAL / rig.RUN.format(0), None
    page = file.with_suffix(".html") if out is None else out
    if page.resolve() == file.resolve():
        raise ValueError(f"{file} is the recording; choose another file for the page with --out")
    check_file(page, ".html")
    with busy(f"drawing {file.name}"), named_errors(page, "the recording is unchanged"):
        motion = write_replay(file, page, skill=skill, speed=speed)
    say(f"{page}: {motion.kind}, {motion.time[-1]:.2f} s, {motion.outcome} ({page.stat().st_size / 1e6:.1f} MB)")
    if open_page is None:
        open_page = sys.stdout.isatty()
    if open_page and not webbrowser.open(page.resolve().as_uri()):
        say("No web browser could be started; open the page yourself.")
