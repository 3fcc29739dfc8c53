"""Makes the pictures of the documentation, each by one command, from what `make demo` leaves in out/.

    python -m docs._tools.pictures                        # lists them, with their commands
    python -m docs._tools.pictures wedge.webp jam.webp    # makes these

A film shows the first recording of the demo with what it is to show. Look at a picture before you commit it.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.command_line import run  # noqa: E402
from interfaces.terminal import console  # noqa: E402
from skill.data.demonstration import read_demonstration  # noqa: E402

PYTHON = shlex.quote(sys.executable)
PICTURES = ROOT / "docs" / "pictures"
OUT = ROOT / "out"


def trial(folder: str, chosen: Callable[[dict[str, Any]], Any]) -> Path:
    """Returns the first run in ``out/FOLDER`` whose result is chosen.

    Raises:
        ValueError: if there is none.
    """
    for number, result in enumerate(json.loads((OUT / folder / "results.json").read_text())):
        if chosen(result):
            return OUT / folder / f"run_{number:04d}.parquet"
    raise ValueError(f"{OUT / folder}: no such trial")


def usual() -> Path:
    """A trial without a wedge and a back-off."""
    return trial("rig", lambda result: result["inserted"] and not result["wedged_s"] and not result["back_offs"])


def jammed() -> Path:
    """The first demonstration that ends jammed."""
    paths: Iterator[Path] = iter(sorted((OUT / "demonstrations").glob("*.parquet")))
    return next(path for path in paths if read_demonstration(path).outcome == "jammed")


def film(name: str, recordings: str, options: str = "") -> str:
    """The command of a film."""
    return f"{PYTHON} -m docs._tools.moving_picture {recordings} --name {name} {options}".strip()


def curves(name: str, results: str, *factors: str, options: str = "") -> str:
    """The command of a picture of curves."""
    chosen = " ".join(f"--factor {factor}" for factor in factors)
    return f"{PYTHON} docs/_tools/curve_picture.py docs/{results} {name} {chosen} {options}".strip()


THEORY = f"{PYTHON} -m benchmarks.physics.theory --friction 0.1 --friction 0.2 --friction 0.3 --pictures docs/pictures"
DIAGRAMS = f"{PYTHON} -m haptic_skill diagram --out docs/pictures"
LIVE = f"{PYTHON} docs/_tools/live_picture.py --observer out/skill.npz"
STRESS = f"{PYTHON} -m haptic_skill rig --trials 4 --arm stress --out out/stress --overwrite"
TITLES = "--title 'usual trial' --title 'harder trial'"

COMMANDS: dict[str, Callable[[], str]] = {
    "insertion.webp": lambda: film("insertion", str(usual())),
    "jam.webp": lambda: film("jam", str(jammed()), "--skill out/skill.npz"),
    "wedge.webp": lambda: film("wedge", str(trial("stress", lambda result: result["wedged_s"] > 0.1))),
    "stress.webp": lambda: film("stress", f"{usual()} {trial('stress', lambda result: result['inserted'])}", TITLES),
    "correction.webp": lambda: film(
        "correction", str(min((OUT / "corrections").rglob("*.parquet"))), "--skill out/skill.npz"
    ),
    "insertion.png": lambda: "cp out/fig5_insertion.png docs/pictures/insertion.png",
    "demonstrations.png": lambda: "cp out/demonstrations/demonstrations.png docs/pictures/demonstrations.png",
    "learning_curve.png": lambda: curves("learning_curve.png", "learning", "number of demonstrations"),
    "ladder.png": lambda: curves("ladder.png", "ladder", "clearance", options="--engine drake"),
    "curves.png": lambda: curves(
        "curves.png", "curves", "friction", "noise", "pivot range", "mount stiffness", options="--engine exact"
    ),
    **dict.fromkeys(("two_point_depth.svg", "jamming.svg", "wedging.svg", "force_balance.svg"), lambda: THEORY),
    **dict.fromkeys(("virtual_environment.svg", "rig.svg"), lambda: DIAGRAMS),
    **dict.fromkeys(("live.webp", "live.png", "live_skill.png"), lambda: LIVE),
    "reinforcement.svg": lambda: (
        f"{PYTHON} -m benchmarks.rig.reinforcement --skill skill/default_skill.npz --steps 50000 --every 10000"
        " --trials 10 --figure docs/pictures/reinforcement.svg"
    ),
}
"""Pictures by name, and what tells their commands."""


def main(names: Annotated[list[str] | None, typer.Argument(help="Of pictures; without any: a list.")] = None) -> None:
    """Makes the pictures, or lists them with their commands."""
    if not (OUT / "rig" / "results.json").is_file():
        raise ValueError("out/rig/results.json: no such file; run make demo first")
    if not (OUT / "stress" / "results.json").is_file():
        subprocess.run(STRESS, shell=True, cwd=ROOT, check=True)
    for command in dict.fromkeys(COMMANDS[name]() for name in names or ()):
        subprocess.run(command, shell=True, cwd=ROOT, check=True)
    for name in COMMANDS if not names else ():
        console.print(f"{name}: {COMMANDS[name]()}".replace(f"{ROOT}/", "").replace(PYTHON, "python"), highlight=False)


if __name__ == "__main__":
    run(main)
