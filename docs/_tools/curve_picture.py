"""Makes a picture of the documentation from the curves of a scoreboard, in headless Chromium.

    haptic-skill scoreboard docs/ladder --out out/ladder.html
    python docs/_tools/curve_picture.py out/ladder.html ladder.png --factor clearance --engine drake

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
from tests.browser import open_page  # noqa: E402

WIDTH = 1100  # pixels of the page
MARGIN = 12  # pixels around a picture
SECTIONS = "return [...document.querySelectorAll('section')].filter(e => e.querySelector('.curve'))"
LEGIBLE = "for (const e of document.querySelectorAll('section h2')) e.style.marginTop = '6px'"


def curve_pictures(scoreboard: Path, factors: Sequence[str], engine: str) -> list[Image.Image]:
    """Returns the pictures of the curves over the factors, in their order, in which the heading names the engine.

    Raises:
        ValueError: if there is none over a factor.
    """
    with open_page(scoreboard, size=(WIDTH, 900)) as page:
        page.run(LEGIBLE)
        page.driver.set_window_size(WIDTH, page.run("return document.documentElement.scrollHeight") + 200)
        found = {}
        for section in page.run(SECTIONS):
            factor, about = section.text.splitlines()[:2]
            if engine in about:
                picture = Image.open(io.BytesIO(section.screenshot_as_png)).convert("RGB")
                found.setdefault(factor, []).append(picture)
    missing = [factor for factor in factors if factor not in found]
    if missing:
        raise ValueError(f"{scoreboard}: no curve over {missing[0]!r}; found: {', '.join(found) or 'none'}")
    return [picture for factor in factors for picture in found[factor]]


def stacked(pictures: Sequence[Image.Image]) -> Image.Image:
    """Returns pictures of the same width, one below the other, on their own background."""
    size = (pictures[0].width + 2 * MARGIN, sum(picture.height + MARGIN for picture in pictures) + MARGIN)
    whole = Image.new("RGB", size, pictures[0].getpixel((0, 0)))
    height = MARGIN
    for picture in pictures:
        whole.paste(picture, (MARGIN, height))
        height += picture.height + MARGIN
    return whole


def main(
    scoreboard: Annotated[Path, typer.Argument(help="Page that `haptic-skill scoreboard` wrote.")],
    name: Annotated[str, typer.Argument(help="Name of the picture.")],
    factor: Annotated[list[str], typer.Option(metavar="NAME", help="Factor of a curve; repeatable.")],
    engine: Annotated[str, typer.Option(help="drake or mujoco; both by default.")] = "",
) -> None:
    """Writes the picture."""
    picture = stacked(curve_pictures(scoreboard, factor, engine))
    path = PICTURES / name
    picture.quantize(128).save(path, optimize=True)
    print(f"{path}: {picture.width} x {picture.height}, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    run(main)
