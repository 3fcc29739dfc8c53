"""Makes a picture of the documentation from the curves of a folder of results.

    python docs/_tools/curve_picture.py docs/ladder ladder.png --factor clearance --engine drake

It writes docs/pictures/ladder.png: the curves over the factors, one below the other, each with its heading. With
--engine only those of one engine.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from benchmarks.command_line import run  # noqa: E402
from docs._tools.moving_picture import PICTURES  # noqa: E402
from experiments.scoreboard.result_store import read_trials  # noqa: E402
from experiments.scoreboard.summary import make_scoreboard  # noqa: E402
from interfaces.reports.scoreboard_curves import curve_figure, curves_of, styles_of  # noqa: E402

PIXELS = 120  # for an inch of a figure


def curve_pictures(results: Path, factors: Sequence[str], engine: str) -> list[Image.Image]:
    """Returns the pictures of the curves over the factors, in their order, whose heading names the engine.

    Raises:
        ValueError: if there is none over a factor.
    """
    curves = [curve for curve in curves_of(make_scoreboard(read_trials(results))) if engine in curve.title]
    chosen = [[curve for curve in curves if curve.factor == factor] for factor in factors]
    if not all(chosen):
        found = ", ".join(sorted({curve.factor for curve in curves})) or "none"
        raise ValueError(f"{results}: no curve over one of {', '.join(factors)}; found: {found}")
    wanted = [curve for group in chosen for curve in group]
    styles = styles_of(sorted({policy for curve in wanted for policy in curve.summaries}))
    pictures = []
    for curve in wanted:
        file = io.BytesIO()
        curve_figure(curve, styles).savefig(file, dpi=PIXELS)
        pictures.append(Image.open(file).convert("RGB"))
    return pictures


def stacked(pictures: Sequence[Image.Image]) -> Image.Image:
    """Returns pictures of the same width, one below the other."""
    whole = Image.new("RGB", (pictures[0].width, sum(picture.height for picture in pictures)))
    height = 0
    for picture in pictures:
        whole.paste(picture, (0, height))
        height += picture.height
    return whole


def main(
    results: Annotated[Path, typer.Argument(help="Folder that `haptic-skill sweep` wrote.")],
    name: Annotated[str, typer.Argument(help="Name of the picture.")],
    factor: Annotated[list[str], typer.Option(metavar="NAME", help="Factor of a curve; repeatable.")],
    engine: Annotated[str, typer.Option(help="drake or exact; both by default.")] = "",
) -> None:
    """Writes the picture."""
    picture = stacked(curve_pictures(results, factor, engine))
    path = PICTURES / name
    picture.quantize(128).save(path, optimize=True)
    print(f"{path}: {picture.width} x {picture.height}, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    run(main)
