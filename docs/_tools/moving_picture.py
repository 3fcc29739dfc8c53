"""Makes the moving picture of the documentation from a replay, in headless Chromium.

    python docs/_tools/moving_picture.py [--replay out/replay_insertion.html]

It shows the replay at a third of its speed, and writes docs/pictures/insertion.webp.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.browser import Page, open_page  # noqa: E402

SIZE, WIDTH = (960, 820), 640
RATE = 12  # pictures per second
SLOW = 3  # times slower than it was
PICTURES = ROOT / "docs" / "pictures"


def pictures(replay: Path) -> Iterator[Image.Image]:
    """Yields the pictures of a replay."""
    with open_page(replay, size=SIZE) as page:
        page.wait("window.replay && window.replay.ready")
        end = float(page.run("return window.replay.end"))
        for k in range(int(end * RATE * SLOW) + 1):
            page.run("window.replay.pause(); window.replay.seek(arguments[0])", k / RATE / SLOW)
            time.sleep(0.08)  # until it is drawn
            yield reduced(page)


def reduced(page: Page) -> Image.Image:
    """Returns a picture of a page, ``WIDTH`` pixels wide."""
    shown = Image.fromarray(page.screenshot())
    return shown.resize((WIDTH, round(WIDTH * shown.height / shown.width)), Image.Resampling.LANCZOS)


def write(path: Path, shown: Sequence[Image.Image], times: Sequence[int]) -> None:
    """Writes an animation that repeats: pictures and their times, ms; the last one stays for two seconds."""
    first, *others = shown
    first.save(path, save_all=True, append_images=others, duration=[*times[:-1], 2000], loop=0, quality=45, method=6)
    print(f"{path}: {len(times)} pictures, {path.stat().st_size / 1e3:.0f} kB")


def main() -> None:
    """Writes the picture of the replay."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--replay", type=Path, default=ROOT / "out/replay_insertion.html", metavar="FILE")
    shown = list(pictures(parser.parse_args().replay))
    write(PICTURES / "insertion.webp", shown, [1000 // RATE] * len(shown))


if __name__ == "__main__":
    main()
