"""Exports recordings as data sets of LeRobot or logs in MCAP, and imports the data sets again; without Drake."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app
from scripts.options import OptionalSkillFile, parse_path

app, import_app = make_app(no_args_is_help=True), make_app(no_args_is_help=True)
Folder = Annotated[Path, typer.Argument(parser=parse_path, metavar="FOLDER", help="Folder to read.")]
Out = Annotated[Path, typer.Argument(parser=parse_path, metavar="OUT", help="Folder to write.")]
Replace = Annotated[bool, typer.Option("--overwrite", help="Replace a data set that this program wrote into OUT.")]
Run = Annotated[Path, typer.Argument(parser=parse_path, metavar="RUN", help="Demonstration or rig run (.parquet).")]
Log = Annotated[Path | None, typer.Argument(parser=parse_path, metavar="OUT.mcap", show_default="RUN, as .mcap")]


@app.command("lerobot")
@command
def export_lerobot(folder: Folder, out: Out, skill: OptionalSkillFile = None, overwrite: Replace = False) -> None:
    """Writes demonstrations or rig runs, failures too, as a LeRobot data set: `export lerobot out/rig out/dataset`."""
    from scripts.export_session import export_lerobot

    export_lerobot(folder, out, skill=skill, overwrite=overwrite)


@import_app.command("lerobot")
@command
def import_lerobot(folder: Folder, out: Out) -> None:
    """Makes the recordings of an exported data set again, unchanged: `import lerobot out/dataset out/again`."""
    from scripts.export_session import import_lerobot

    import_lerobot(folder, out)


@app.command("mcap")
@command
def export_mcap(run: Run, out: Log = None) -> None:
    """Writes a log for Foxglove and ROS 2: `export mcap out/rig/run_0000.parquet`."""
    from scripts.export_session import export_mcap

    export_mcap(run, out)


if __name__ == "__main__":
    app()
