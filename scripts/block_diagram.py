"""Draws the block diagrams of the virtual environment and the rig."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Annotated

import typer
from pydrake.systems.framework import Diagram

from models.scenario import DEMONSTRATION_STREAM, TRIAL_STREAM, load_scenario, resolve_scenario
from skill.data.tables import write_atomically
from skill.manipulation_skill import ManipulationSkill
from systems.reports.terminal import console, report_errors
from systems.rig import MakeRig
from systems.virtual_environment import MakeVirtualEnvironment

app = typer.Typer(add_completion=False)


def write_svg(diagram: Diagram, path: Path) -> None:
    """Lays the diagram out with Graphviz and writes an SVG.

    Raises:
        ValueError: if Graphviz is not installed.
    """
    text = diagram.GetGraphvizString(max_depth=1)
    try:
        drawn = subprocess.run(["dot", "-Tsvg"], input=text.encode(), capture_output=True, check=True)
    except FileNotFoundError:
        raise ValueError("Graphviz is not installed: the command 'dot' was not found; install graphviz") from None
    write_atomically(path, drawn.stdout)


@app.command()
@report_errors
def main(
    skill: Annotated[Path, typer.Option(help="A skill file of train_skill: the rig's ports depend on it.")] = Path(
        "out/skill.npz"
    ),
    out: Annotated[Path, typer.Option(help="Folder for the two SVG files.")] = Path("out"),
) -> None:
    """Draw the block diagrams of the virtual environment and of the rig as SVG files.

    Example: python -m scripts.block_diagram --out docs/pictures
    """
    scenario = load_scenario()
    environment = MakeVirtualEnvironment(resolve_scenario(scenario, seed=0, stream=DEMONSTRATION_STREAM))
    write_svg(environment.diagram, out / "virtual_environment.svg")
    rig = MakeRig(resolve_scenario(scenario, seed=0, stream=TRIAL_STREAM), ManipulationSkill.load(skill))
    write_svg(rig.diagram, out / "rig.svg")
    console.print(f"virtual_environment.svg and rig.svg in {out}")


if __name__ == "__main__":
    app()
