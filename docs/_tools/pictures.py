"""Makes pictures of the documentation, each by one command, from what `make demo` leaves in out/.

    python -m docs._tools.pictures wedge.webp jam.webp

A film shows the first recording with what it is to show. Look at a picture before you commit it.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.command_line import run  # noqa: E402
from skill.data.demonstration import read_demonstration  # noqa: E402

PYTHON = shlex.quote(sys.executable)
OUT = ROOT / "out"


def trial(trial_set: str, chosen: Callable[[dict[str, Any]], Any]) -> Path:
    """Returns the first chosen trial of the demo, or of the set "hard", whose trials are performed if need be.

    Raises:
        ValueError: if there is none.
    """
    folder = OUT / ("rig" if trial_set == "usual" else trial_set)
    if not folder.exists() and trial_set == "hard":
        shell(f"{PYTHON} -m haptic_skill rig --trials 20 --trials-of hard --out {shlex.quote(str(folder))}")
    for number, result in enumerate(json.loads((folder / "results.json").read_text())):
        if chosen(result):
            return folder / f"run_{number:04d}.parquet"
    raise ValueError(f"{folder}: no such trial")


def usual() -> Path:
    """A trial without a back-off."""
    return trial("default", lambda result: result["inserted"] and not result["back_offs"])


def jammed() -> Path:
    """The first demonstration that ends jammed."""
    paths = sorted((OUT / "demonstrations").glob("*.parquet"))
    return next(path for path in paths if read_demonstration(path).outcome == "jammed")


def wedged() -> Path:
    """A harder trial in which friction alone could hold the peg for over a second."""
    return trial("hard", lambda result: result["wedged_s"] > 1.0)


def harder() -> Path:
    """A harder trial without a back-off."""
    return trial("hard", lambda result: result["inserted"] and not result["back_offs"])


def asked() -> Path:
    """The first correction."""
    return min((OUT / "corrections").rglob("*.parquet"))


def film(name: str, shown: dict[str, Path], options: str = "") -> str:
    """The command of a film of recordings, by their titles."""
    recordings, titles = shlex.join(map(str, shown.values())), shlex.join(f"--title={title}" for title in shown)
    return f"{PYTHON} -m docs._tools.moving_picture {recordings} --name {name} {titles} {options}"


def curves(name: str, *factors: str, results: str, options: str = "") -> str:
    """The command of a picture of curves."""
    chosen = " ".join(f"--factor {factor}" for factor in factors)
    return f"{PYTHON} docs/_tools/curve_picture.py docs/{results} {name}.png {chosen} {options}"


def shell(command: str) -> None:
    """Performs a command in the folder of the project."""
    subprocess.run(command, shell=True, cwd=ROOT, check=True)


STATES = "--skill out/skill.npz"
VARIED = ("friction", "noise", "rig.pivot_range", "rig.mount_stiffness")
THEORY = f"{PYTHON} -m benchmarks.physics.theory --friction 0.1 --friction 0.2 --friction 0.3 --pictures docs/pictures"
DIAGRAMS = f"{PYTHON} -m haptic_skill diagram --out docs/pictures"
LIVE = f"{PYTHON} docs/_tools/live_picture.py --observer out/skill.npz"
FIRST_HOUR = f"{PYTHON} -m docs._tools.first_hour out/first_hour"
LEARNT = (
    f"{PYTHON} -m benchmarks.rig.reinforcement --skill skill/default_skill.npz --steps 50000 --every 10000 --trials 10"
)

COMMANDS: dict[str, Callable[[], str]] = {
    "insertion.webp": lambda: film("insertion", {"insertion": usual()}),
    "jam.webp": lambda: film("jam", {"a jam: pushed without levelling": jammed()}, f"{STATES} --end 1.8"),
    "wedge.webp": lambda: film("wedge", {"a wedge: two contacts squeeze the peg": wedged()}, "--end 2.4"),
    "stress.webp": lambda: film("hard", {"a usual trial": usual(), "a harder trial": harder()}),
    "correction.webp": lambda: film("correction", {"a correction: shown where the skill was stuck": asked()}, STATES),
    "insertion.png": lambda: "cp out/fig5_insertion.png docs/pictures/insertion.png",
    "demonstrations.png": lambda: "cp out/demonstrations/demonstrations.png docs/pictures/demonstrations.png",
    "learning_curve.png": lambda: curves("learning_curve", "training.size", results="learning"),
    "ladder.png": lambda: curves("ladder", "clearance", results="ladder", options="--engine drake"),
    "curves.png": lambda: curves("curves", *VARIED, results="curves", options="--engine exact"),
    **dict.fromkeys(("two_point_depth.svg", "jamming.svg", "wedging.svg", "force_balance.svg"), lambda: THEORY),
    **dict.fromkeys(("virtual_environment.svg", "rig.svg"), lambda: DIAGRAMS),
    **dict.fromkeys(("live.webp", "live.png", "live_skill.png"), lambda: LIVE),
    **dict.fromkeys((f"first_hour_{part}.webp" for part in ("show", "ask", "rig")), lambda: FIRST_HOUR),
    "gymnasium.png": lambda: f"{PYTHON} -m docs._tools.rendered_picture",
    "reinforcement.svg": lambda: f"{LEARNT} --figure docs/pictures/reinforcement.svg",
}
"""Pictures by name, and what tells their commands."""


def main(names: Annotated[list[str], typer.Argument(help=f"Of {', '.join(COMMANDS)}.")]) -> None:
    """Makes the pictures."""
    for command in dict.fromkeys(COMMANDS[name]() for name in names):
        shell(command)


if __name__ == "__main__":
    run(main)
