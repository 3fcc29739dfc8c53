"""Makes the moving picture of a live session: a script holds the keys of the page in headless Chromium.

    python docs/_tools/live_picture.py

It shows the session in its own time, and writes docs/pictures/live.webp. The peg starts tilted; the script feeds it
until it touches, levels it, and feeds it to the floor. On a machine that is busy the simulation falls behind.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import yaml
from PIL import Image
from selenium.webdriver.common.keys import Keys

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from docs._tools.moving_picture import PICTURES, ROOT, reduced, write
from tests.browser import Page
from tests.systems.live.live_session import live, press, text_of, wait_for_text

SCENARIO = ROOT / "models" / "scenarios" / "live.yaml"
TILT = 0.035  # of the start, rad
DEGREE = 10  # presses of an arrow
OFFSET = 2  # presses that centre the peg
MAX_PICTURES = 150


def film(page: Page) -> tuple[list[Image.Image], list[int]]:
    """Returns the pictures of a demonstration and how long each is shown, ms."""
    shown, began = [reduced(page)], [time.monotonic()]

    def hold(key: str, presses: int) -> None:
        for _ in range(presses // 2):
            if "inserted" in text_of(page, "status") or len(shown) > MAX_PICTURES:
                return
            press(page, key, times=2)
            began.append(time.monotonic())
            shown.append(reduced(page))

    press(page, " ")
    hold("w", 10)
    for key in (Keys.ARROW_RIGHT, Keys.ARROW_UP):  # the person sees the tilt at 45 degrees
        hold(key, round(math.degrees(TILT) / math.sqrt(2.0) * DEGREE))
    for key in "jk":
        hold(key, OFFSET)
    hold("w", 2 * MAX_PICTURES)
    time.sleep(1.0)
    began.append(time.monotonic())
    shown.append(reduced(page))
    return shown, [round(1000 * (b - a)) for a, b in pairwise([*began, began[-1] + 2.0])]


def main() -> None:
    """Runs the session and writes the picture."""
    scenario = {**yaml.safe_load(SCENARIO.read_text()), "start": {"height": 2e-3, "tilt": [0.0, TILT]}}
    with tempfile.TemporaryDirectory() as folder, live(Path(folder), scenario) as session, session.page() as page:
        wait_for_text(page, "status", "ready: press Space", timeout=60.0)
        write(PICTURES / "live.webp", *film(page))


if __name__ == "__main__":
    main()
