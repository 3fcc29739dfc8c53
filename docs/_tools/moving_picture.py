"""Makes a moving picture of the documentation from recordings, in headless Chromium.

    python -m docs._tools.moving_picture out/rig/run_0007.parquet --name insertion

It shows the replays of one or two recordings, two side by side, at a third of their speed, and writes
docs/pictures/NAME.webp, 640 pixels wide and smaller than 400 kB.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from interfaces.reports.replay_page import write_replay  # noqa: E402
from tests.browser import Page, open_page  # noqa: E402

SIZE, WIDTH = (960, 820), 640
RATE = 6  # pictures per second
SLOW = 3  # times slower than it was
PICTURES = ROOT / "docs" / "pictures"
LARGEST = 400_000  # in units of bytes
# Two replays side by side are narrow: only the scene, the readings and the timeline have a place there.
PLAIN = "for (const id of ['dial-box', 'arrows']) document.getElementById(id).style.display = 'none'"


def pictures(replays: Sequence[Path], *, start: float = 0.0, end: float | None = None) -> Iterator[Image.Image]:
    """Yields the pictures of replays that are shown side by side, from ``start`` to ``end``, s."""
    with ExitStack() as stack:
        size = (SIZE[0] // len(replays), SIZE[1])
        pages = [stack.enter_context(open_page(replay, size=size)) for replay in replays]
        for page in pages:
            page.wait("window.replay && window.replay.ready")
            if len(pages) > 1:
                page.run(PLAIN)
        last = max(float(page.run("return window.replay.end")) for page in pages) if end is None else end
        for k in range(int((last - start) * RATE * SLOW) + 1):
            for page in pages:
                page.run("window.replay.pause(); window.replay.seek(arguments[0])", start + k / RATE / SLOW)
            time.sleep(0.1)  # until it is drawn
            yield reduced(*pages)


def reduced(*pages: Page) -> Image.Image:
    """Returns a picture of pages side by side, ``WIDTH`` pixels wide."""
    shown = [Image.fromarray(page.screenshot()) for page in pages]
    together = Image.new("RGB", (sum(picture.width for picture in shown), shown[0].height))
    for k, picture in enumerate(shown):
        together.paste(picture, (k * shown[0].width, 0))
    return together.resize((WIDTH, round(WIDTH * together.height / together.width)), Image.Resampling.LANCZOS)


def write(path: Path, shown: Sequence[Image.Image], times: Sequence[int]) -> None:
    """Writes an animation that repeats: pictures and their times, ms; the last one stays for two seconds."""
    first, *others = shown
    durations = [*times[:-1], 2000]
    for quality in (45, 35, 25, 15):
        first.save(path, save_all=True, append_images=others, duration=durations, loop=0, quality=quality, method=6)
        if path.stat().st_size < LARGEST:
            break
    print(f"{path}: {len(times)} pictures, {path.stat().st_size / 1e3:.0f} kB")


def main() -> None:
    """Writes the moving picture of the replays."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+", metavar="FILE", help="demonstrations or rig runs")
    parser.add_argument("--name", required=True, help="of the picture, and its title if there is one recording")
    parser.add_argument("--title", action="append", default=[], help="of each replay, in their order")
    parser.add_argument("--skill", type=Path, metavar="FILE", help="names the contact states of a demonstration")
    parser.add_argument("--start", type=float, default=0.0, help="s", metavar="TIME")
    parser.add_argument("--end", type=float, default=None, help="s", metavar="TIME")
    options = parser.parse_args()
    titles = options.title or [options.name] * len(options.recordings)
    with tempfile.TemporaryDirectory() as folder:
        replays = []
        for recording, title in zip(options.recordings, titles, strict=True):
            replays.append(Path(folder) / f"{len(replays)}.html")
            write_replay(recording, replays[-1], title=title, skill=options.skill)
        shown = list(pictures(replays, start=options.start, end=options.end))
    write(PICTURES / f"{options.name}.webp", shown, [1000 // RATE] * len(shown))


if __name__ == "__main__":
    main()
