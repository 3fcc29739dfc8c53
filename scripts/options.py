"""Options that several commands share, so that a flag means the same in each of them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SCENARIO = typer.Option("--scenario", help="Name of a scenario in models/scenarios, or path of a YAML file.")
SKILL = typer.Option("--skill", metavar="FILE.npz", help="Skill to read, a file that `haptic-skill train` wrote.")
GOOD_HELP = "Number of good demonstrations: they insert gently."

Seed = Annotated[int, typer.Option("--seed", min=0, help="Seeds the random draws; trial k of the rig uses seed + k.")]
Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Number of processes.")]
ScenarioName = Annotated[str, SCENARIO]
OptionalScenarioName = Annotated[str | None, SCENARIO]
SkillFile = Annotated[Path, SKILL]
OptionalSkillFile = Annotated[Path | None, SKILL]
OutFolder = Annotated[Path, typer.Option("--out", metavar="FOLDER", help="Folder to write into.")]
OutFile = Annotated[Path, typer.Option("--out", metavar="FILE", help="File to write; replaces an existing file.")]
Good = Annotated[int, typer.Option("--good", min=0, help=GOOD_HELP)]
OneOrMoreGood = Annotated[int, typer.Option("--good", min=1, help=GOOD_HELP)]
Bad = Annotated[
    int, typer.Option("--bad", min=0, help="Number of bad demonstrations: they jam, slam, give up or over-correct.")
]
Trials = Annotated[int, typer.Option("--trials", min=1, help="Number of insertions on the rig.")]
