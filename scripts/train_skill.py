"""Trains a skill from recorded demonstrations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import OutFile, Seed, parse_path

app = make_app()


@app.command()
@command
def main(
    demonstrations: Annotated[
        list[Path],
        typer.Option(
            parser=parse_path,
            metavar="FOLDER",
            help="Folder of recordings by `haptic-skill record` or `recover`; may be given several times.",
        ),
    ] = [Path("out/demonstrations")],  # noqa: B006
    out: OutFile = Path("out/skill.npz"),
    seed: Seed = 0,
) -> None:
    """Learns a manipulation skill from recorded demonstrations.

    Reads the recordings that the index of each folder lists, or all of a folder without an index. Discovers the contact
    states in all of them, and fits the local regressions to the actions of the good ones. Writes the skill to the file
    of `--out`. Prints one row per state: how often and how long it was visited, and the probability that it leads to
    insertion. The seed is that of the clustering.

    For example:

        haptic-skill train --demonstrations out/few --out out/few.npz
    """
    from systems.sessions.train_session import train

    train(demonstrations=demonstrations, out=out, seed=seed)


if __name__ == "__main__":
    run_app(app)
