"""Makes the moving picture of the documentation from a replay, in headless Chromium.

    python docs/_tools/moving_picture.py [--replay out/replay_insertion.html]

It shows the replay at a third of its speed, and writes docs/pictures/insertion.webp.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from tests.browser import open_page  # noqa: E402

SIZE, WIDTH = (960, 820), 640
RATE = 12  # pictures per second
SLOW = 3  # times slower than it was
PICTURE = ROOT / "docs" / "pictures" / "insertion.webp"


def pictures(replay: Path) -> Iterator[Image.Image]:
    """Yields the pictures of a replay."""
    with open_page(replay, size=SIZE) as page:
        page.wait("window.replay && window.replay.ready")
        end = float(page.run("return window.replay.end"))
        for k in range(int(end * RATE * SLOW) + 1):
            page.run("window.replay.pause(); window.replay.seek(arguments[0])", k / RATE / SLOW)
            time.sleep(0.08)  # until it is drawn
            shown = Image.fromarray(page.screenshot())
            yield shown.resize((WIDTH, round(WIDTH * shown.height / shown.width)), Image.Resampling.LANCZOS)


def main() -> None:
    """Writes an animation that repeats; its last picture stays for two seconds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--replay", type=Path, default=ROOT / "out/replay_insertion.html", metavar="FILE")
    first, *others = pictures(parser.parse_args().replay)
    times = [1000 // RATE] * len(others) + [2000]
    first.save(PICTURE, save_all=True, append_images=others, duration=times, loop=0, quality=45, method=6)
    print(f"{PICTURE}: {len(times)} pictures, {PICTURE.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
