"""Replays a stored demonstration or rig run as one HTML page, without Drake and without a simulation."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from skill.data.tables import write_atomically
from systems.reports.motion import read_motion
from systems.reports.replay_page import replay_page

app = typer.Typer(add_completion=False, rich_markup_mode="markdown")


@app.command()
def replay(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A demonstration or a rig run (.parquet); the file itself says which.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="The page to write.", metavar="FILE.html", show_default="FILE, ending in .html"),
    ] = None,
    skill: Annotated[
        Path | None,
        typer.Option(
            help="A trained skill, which tells the contact states of a demonstration; without one the peg is coloured"
            " by the contact force. A rig run holds its own states.",
            metavar="FILE.npz",
            show_default=False,
        ),
    ] = None,
    speed: Annotated[float, typer.Option(help="Of the replay: 0.25 is slow motion, 1 the speed of the motion.")] = 1.0,
    open_page: Annotated[
        bool | None,
        typer.Option(
            "--open/--no-open", help="Show the page in the web browser.", show_default="open, when run at a terminal"
        ),
    ] = None,
) -> None:
    """Turns a stored demonstration or rig run into one HTML page, and shows it.

    The page needs neither network nor this program: it carries the scene, its motion and the viewer. It shows the block
    cut open, the peg in the colour of its contact state, contact force and moment as arrows at the tip, and beside them
    the read-outs, a dial that magnifies the tilt, and a timeline. Drag in the view to turn it, scroll to zoom, drag on
    the timeline to move in time; the space bar plays and pauses. Opened as `page.html#t=1.5` it stands still
    at 1.5 seconds.

    For instance:

        python -m scripts.replay out/demonstrations/00.parquet --skill out/skill.npz

        python -m scripts.replay out/runs/03.parquet --speed 0.25 --out jam.html
    """
    console = Console(stderr=True)
    target = file.with_suffix(".html") if out is None else out
    try:
        if target.resolve() == file.resolve():
            raise ValueError(f"{file}: is also the page to write; name another with --out")
        with console.status(f"drawing {file.name}"):
            motion = read_motion(file, skill)
            page = replay_page(motion, title=file.stem, speed=speed)
            write_atomically(target, page.encode())
    except (ValueError, OSError) as error:
        console.print(f"[bold red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        raise typer.Exit(1) from None
    size = target.stat().st_size / 1e6
    summary = f"{target}: {motion.kind}, {motion.time[-1]:.2f} s, {motion.outcome} ({size:.1f} MB)"
    console.print(escape(summary), soft_wrap=True)
    if skill is not None and motion.kind == "rig run":
        console.print("The rig run holds its own contact states; --skill was not needed.")
    wanted = sys.stdout.isatty() if open_page is None else open_page
    if wanted and not webbrowser.open(target.resolve().as_uri()):
        console.print("No web browser could be started; open the page by hand.")


def main() -> None:
    """The command line."""
    app()


if __name__ == "__main__":
    main()
