"""Makes the pictures of a live session: a script holds the keys of the page in headless Chromium.

    python docs/_tools/live_picture.py [--observer out/skill.npz]

It writes docs/pictures/live.webp, which shows a session in its own time: the peg starts tilted; the script feeds it
until it touches, levels it, and feeds it to the floor. live.png shows a peg that is pushed without being levelled. With
--observer a skill watches, and live_skill.png shows what it would do. On a busy machine the simulation falls behind.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import yaml
from PIL import Image
from selenium.webdriver.common.keys import Keys

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from docs._tools.moving_picture import PICTURES, ROOT, reduced, write
from tests.browser import Page
from tests.interfaces.live.live_session import live, press, text_of, wait_for_text

SCENARIO = ROOT / "models" / "scenarios" / "live.yaml"
TILT = 0.035  # of the start, rad
DEGREE = 10  # presses of an arrow
OFFSET = 2  # presses that centre the peg
MAX_PICTURES = 150
HIGH_LOAD = 14.0  # N, of a peg that is pushed
SIZE = (1280, 860)
HOLD = """  // a key that is held repeats
  const [code, presses] = arguments;
  window.held = presses;
  const repeat = setInterval(() => {
    livePanel.press(code);
    if (--held <= 0) clearInterval(repeat);
  }, 150);
"""


def film(page: Page) -> tuple[list[Image.Image], list[int]]:
    """Returns the pictures of a demonstration and how long each is shown, ms."""
    shown, began = [reduced(Image.fromarray(page.screenshot()))], [time.monotonic()]

    def hold(code: str, presses: int) -> None:
        page.run(HOLD, code, presses)
        while page.run("return held > 0"):
            if "inserted" in text_of(page, "status") or len(shown) > MAX_PICTURES:
                return
            began.append(time.monotonic())
            shown.append(reduced(Image.fromarray(page.screenshot())))

    press(page, " ")
    hold("KeyW", 7)
    for key in ("ArrowRight", "ArrowUp"):  # the person sees the tilt at 45 degrees
        hold(key, round(math.degrees(TILT) / math.sqrt(2.0) * DEGREE))
    for key in ("KeyJ", "KeyK"):
        hold(key, OFFSET)
    hold("KeyW", 2 * MAX_PICTURES)
    time.sleep(1.0)
    began.append(time.monotonic())
    shown.append(reduced(Image.fromarray(page.screenshot())))
    return shown, [round(1000 * (b - a)) for a, b in pairwise([*began, began[-1] + 2.0])]


def push(page: Page, path: Path) -> None:
    """Feeds the tilted peg until the contact load is high, and writes a picture."""
    press(page, " ")
    wait_for_text(page, "status", "recording")
    for _ in range(MAX_PICTURES):
        press(page, "w")
        time.sleep(0.05)
        if float(text_of(page, "contact-load").removesuffix(" N")) > HIGH_LOAD:
            break
    time.sleep(0.5)  # the picture follows
    page.screenshot(path)
    print(path)


def main() -> None:
    """Runs the sessions and writes the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observer", type=Path, default=None, metavar="FILE", help="a skill that watches")
    observer = parser.parse_args().observer
    scenario = {**yaml.safe_load(SCENARIO.read_text()), "start": {"height": 2e-3, "tilt": [0.0, TILT]}}
    sessions: list[tuple[Callable[[Page], None], list[object]]] = [
        (lambda page: write(PICTURES / "live.webp", *film(page)), []),
        (lambda page: push(page, PICTURES / "live.png"), []),
    ]
    if observer is not None:
        sessions.append((lambda page: push(page, PICTURES / "live_skill.png"), ["--observer", observer.resolve()]))
    for picture, options in sessions:
        with (
            tempfile.TemporaryDirectory() as folder,
            live(Path(folder), scenario, options=options) as session,
            session.page() as page,
        ):
            wait_for_text(page, "status", "ready: press Space", timeout=60.0)
            press(page, Keys.ESCAPE)  # no guide
            page.driver.set_window_size(*SIZE)
            picture(page)


if __name__ == "__main__":
    main()
