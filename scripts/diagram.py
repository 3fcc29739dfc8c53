"""Draws the block diagrams of the virtual environment and the rig."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from scripts.command_line import DefaultSkillFile, OutFolder, find_skill

if TYPE_CHECKING:
    from pydrake.systems.framework import Diagram

DRAWINGS = ("virtual_environment.svg", "rig.svg")


def write_svg(diagram: Diagram, path: Path) -> None:
    """Lays out a diagram with Graphviz and writes it as an SVG file.

    Raises:
        ValueError: if Graphviz is not installed.
    """
    from skill.data.files import write_atomically

    text = diagram.GetGraphvizString(max_depth=1)
    try:
        drawn = subprocess.run(["dot", "-Tsvg"], input=text.encode(), capture_output=True, check=True)
    except FileNotFoundError:
        raise ValueError("Graphviz is not installed: the command 'dot' was not found; install graphviz") from None
    write_atomically(path, drawn.stdout)


def main(skill: DefaultSkillFile = None, out: OutFolder = Path("out")) -> None:
    """Draws the block diagrams of the virtual environment and of the rig.

    Reads a skill, because the ports of the rig depend on it. Writes virtual_environment.svg and rig.svg into the folder
    of `--out`. Needs Graphviz.

    For example:

        haptic-skill diagram --out docs/pictures
    """
    from experiments.outputs.output_checks import check_file
    from interfaces.terminal import say
    from models.scenario import DEMONSTRATION_STREAM, TRIAL_STREAM, load_scenario, resolve_scenario
    from skill.manipulation_skill import ManipulationSkill
    from systems.rig import MakeRig
    from systems.virtual_environment import MakeVirtualEnvironment

    for name in DRAWINGS:
        check_file(out / name, ".svg")
    scenario = load_scenario()
    learnt = ManipulationSkill.load(find_skill(skill))
    environment = MakeVirtualEnvironment(resolve_scenario(scenario, seed=0, stream=DEMONSTRATION_STREAM))
    write_svg(environment.diagram, out / DRAWINGS[0])
    rig = MakeRig(resolve_scenario(scenario, seed=0, stream=TRIAL_STREAM), learnt)
    write_svg(rig.diagram, out / DRAWINGS[1])
    say(f"open {' and '.join(str(out / name) for name in DRAWINGS)}")
