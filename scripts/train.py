"""Trains a skill from recorded demonstrations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scripts.command_line import command, make_app
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
            help="Folder of recordings by `haptic-skill record` or `correct`; may be given several times.",
        ),
    ] = [Path("out/demonstrations")],  # noqa: B006
    out: OutFile = Path("out/skill.npz"),
    seed: Seed = 0,
    contexts: Annotated[
        int, typer.Option(min=1, max=10, help="Largest number of contexts to discover; 1 learns without contexts.")
    ] = 3,
    policy: Annotated[
        Literal["imitate", "plan"],
        typer.Option(help="Act as the good demonstrations do, or plan the way to the desired next contact state."),
    ] = "imitate",
) -> None:
    """Learns a manipulation skill from recorded demonstrations.

    Reads the recordings that the index of each folder lists, or all of a folder without an index. Discovers the contact
    states in all of them, and the contexts in the good ones: what stays the same during a demonstration and shows only
    in how the forces answer to the motion. Fits the local regressions to the actions of the good ones. Writes the skill
    to the file of `--out`. Prints one row per state: how often and how long it was visited, and the probability that it
    leads to insertion. The seed is that of the random draws of the learner.

    With `--policy plan` the skill also learns how the forces answer to each motion, and which forces the good
    demonstrations keep to in each state. It then chooses the motion that leads to the desired next state.

    For example:

        haptic-skill train --demonstrations out/few --out out/few.npz
    """
    from scripts.train_session import train

    train(demonstrations=demonstrations, out=out, seed=seed, max_contexts=contexts, policy=policy)


if __name__ == "__main__":
    app()
