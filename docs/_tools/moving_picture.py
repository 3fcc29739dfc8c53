"""Makes a moving picture of the documentation from recordings, in headless Chromium.

    python -m docs._tools.moving_picture out/rig/run_0007.parquet --name insertion

It shows the replays of one or two recordings, two side by side, at a third of their speed, and writes
docs/pictures/NAME.webp, 640 pixels wide and smaller than 400 kB.
"""

from __future__ import annotations

import argparse
import io
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from interfaces.reports.replay_page import write_replay  # noqa: E402
from tests.browser import open_page  # noqa: E402

SIZE, WIDTH = (960, 820), 640
RATE = 6  # pictures per second
SLOW = 3  # times slower than it was
PICTURES = ROOT / "docs" / "pictures"
LARGEST = 400_000  # in units of bytes
UNUSED = ".dg.main"
"""The viewer's own controls."""
NARROW = "#dial-box, #arrows"
"""What has no place where two replays stand side by side."""
HIDE = "for (const part of document.querySelectorAll(arguments[0])) part.style.display = 'none'"


def film(replay: Path, times: Sequence[float], *, narrow: bool) -> list[Image.Image]:
    """Returns pictures of a replay at times, s; ``narrow`` leaves the place of a second one beside it."""
    shown = []
    with open_page(replay, size=(SIZE[0] // 2, SIZE[1]) if narrow else SIZE) as page:
        page.wait("window.replay && window.replay.ready")
        page.run(HIDE, f"{UNUSED}, {NARROW}" if narrow else UNUSED)
        for time_shown in times:
            page.run("window.replay.pause(); window.replay.seek(arguments[0])", time_shown)
            time.sleep(0.1)  # until it is drawn
            shown.append(Image.fromarray(page.screenshot()))
    return shown


def reduced(*pictures: Image.Image) -> Image.Image:
    """Returns pictures side by side as one, ``WIDTH`` pixels wide."""
    together = Image.new("RGB", (sum(picture.width for picture in pictures), pictures[0].height))
    for k, picture in enumerate(pictures):
        together.paste(picture, (k * pictures[0].width, 0))
    return together.resize((WIDTH, round(WIDTH * together.height / together.width)), Image.Resampling.LANCZOS)


def write(path: Path, shown: Sequence[Image.Image], times: Sequence[int]) -> None:
    """Writes an animation that repeats: pictures and their times, ms; the last one stays for two seconds."""
    first, *others = shown
    durations = [*times[:-1], 2000]
    for quality in (40, 25, 15):
        file = io.BytesIO()  # the encoder takes long: whoever stops it keeps the picture before
        first.save(file, "webp", save_all=True, append_images=others, duration=durations, loop=0, quality=quality)
        if file.tell() < LARGEST:
            break
    path.write_bytes(file.getvalue())
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
        replays, ends = [], []
        for recording, title in zip(options.recordings, titles, strict=True):
            replays.append(Path(folder) / f"{len(replays)}.html")
            ends.append(write_replay(recording, replays[-1], title=title, skill=options.skill).time[-1])
        times = np.arange(options.start, options.end or max(ends), 1 / RATE / SLOW).tolist()
        films = [film(replay, times, narrow=len(replays) > 1) for replay in replays]
    shown = [reduced(*pictures) for pictures in zip(*films, strict=True)]
    write(PICTURES / f"{options.name}.webp", shown, [1000 // RATE] * len(shown))


if __name__ == "__main__":
    main()
