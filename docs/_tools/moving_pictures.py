"""Makes the moving pictures of the documentation, in headless Chromium.

    python docs/_tools/moving_pictures.py insertion [--replay out/replay_insertion.html]
    python docs/_tools/moving_pictures.py live

The first shows a replay at a third of its speed; the second a live session in which the keys are pressed by this
script. Both write docs/pictures/NAME.webp.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.browser import Page, open_page  # noqa: E402
from tests.systems.live.live_session import live, press, text_of, wait_for_text  # noqa: E402

SIZE, WIDTH = (960, 820), 640
RATE = 12  # pictures per second
SLOW = 3  # times slower than it was
LIVE_SECONDS = 40.0


def insertion(replay: Path) -> Iterator[Image.Image]:
    """Yields the pictures of a replay."""
    with open_page(replay, size=SIZE) as page:
        page.wait("window.replay && window.replay.ready")
        end = float(page.run("return window.replay.end"))
        for k in range(int(end * RATE * SLOW) + 1):
            page.run("window.replay.pause(); window.replay.seek(arguments[0])", k / RATE / SLOW)
            time.sleep(0.08)  # until it is drawn
            yield shot(page)


def live_session() -> Iterator[Image.Image]:
    """Yields the pictures of a demonstration from a small tilt; this script presses the keys."""
    scenario = {"start": {"tilt": [0.006, -0.004]}}
    with tempfile.TemporaryDirectory() as folder, live(Path(folder), scenario=scenario) as session:
        with session.page() as page:
            wait_for_text(page, "status", "ready")
            press(page, " ")
            begun = time.monotonic()
            while time.monotonic() - begun < LIVE_SECONDS and "inserted" not in text_of(page, "status"):
                press(page, "w")
                yield shot(page)
            yield shot(page)


def shot(page: Page) -> Image.Image:
    """A picture of the page, made smaller."""
    picture = Image.fromarray(page.screenshot())
    return picture.resize((WIDTH, round(WIDTH * picture.height / picture.width)), Image.Resampling.LANCZOS)


def write(pictures: list[Image.Image], path: Path) -> None:
    """Writes an animation that repeats; the last picture stays for two seconds."""
    times = [1000 // RATE] * (len(pictures) - 1) + [2000]
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=times, loop=0, quality=55, method=6)
    print(f"{path}: {len(pictures)} pictures, {path.stat().st_size / 1e3:.0f} kB")


def main() -> None:
    """Makes one picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=["insertion", "live"])
    parser.add_argument("--replay", type=Path, default=ROOT / "out/replay_insertion.html", metavar="FILE")
    arguments = parser.parse_args()
    pictures = insertion(arguments.replay) if arguments.name == "insertion" else live_session()
    write(list(pictures), ROOT / "docs/pictures" / f"{arguments.name}.webp")


if __name__ == "__main__":
    main()
