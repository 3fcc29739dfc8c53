"""Goes through docs/first_hour.md as a person would: runs its commands, and presses the keys of its pages in Chromium.

    python -m tests.docs.first_hour FOLDER

It works in the folder, which must be new, at 1280 x 720 pixels, and writes the films of the page: first_hour_show,
first_hour_ask and first_hour_rig. A page that hides or cuts off something ends it. It leaves the time of each command
and what it printed. On a busy machine the simulation falls behind the keys.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

from PIL import Image
from selenium.webdriver.common.keys import Keys

from docs._tools.pictures import PICTURES, ROOT, reduced, write
from tests.browser import Page
from tests.interfaces.live.live_session import FLAWS, Session, press, served, text_of, wait_for_text
from tests.interfaces.live.people import insert_by_feel, push

SCREEN = (1280, 720)
PAGE = ROOT / "docs" / "first_hour.md"
BAD = 5
"""Every so many demonstrations the person pushes a tilted peg, up to `ROUGH` N."""
ROUGH = 25.0
FRAME, MAX_FRAMES = 0.25, 160  # s between two pictures of a film
ASKED = 600.0  # s until a skill has practised, or learnt


class Film:
    """Pictures of a page, each shown as long as it was."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._shown: list[Image.Image] = []
        self._times: list[float] = []

    def take(self) -> None:
        """Takes a picture, if the last one is old enough."""
        now = time.monotonic()
        if len(self._times) < MAX_FRAMES and (not self._times or now - self._times[-1] > FRAME):
            self._times.append(now)
            self._shown.append(reduced(Image.fromarray(self._page.screenshot())))

    def write(self, path: Path) -> None:
        """Writes the film into a file."""
        write(path, self._shown, [round(1000 * (b - a)) for a, b in pairwise([*self._times, self._times[-1] + 2.0])])


def commands() -> list[list[str]]:
    """Returns the commands of the page, in its order."""
    return [shlex.split(line) for line in re.findall(r"^    haptic-skill (.*)$", PAGE.read_text(), flags=re.M)]


def look(page: Page) -> None:
    """Ends where the page hides or cuts off something."""
    flaws = page.run(FLAWS)
    if flaws:
        raise AssertionError(f"at {SCREEN}, '{text_of(page, 'status')}': {'; '.join(flaws)}")


def record(session: Session, pictures: Path, number: int) -> None:
    """Gives demonstrations; each fifth one is bad."""
    with session.page(SCREEN) as page:
        wait_for_text(page, "status", "ready: press Space")
        screen(page)
        press(page, Keys.ESCAPE)  # no guide
        for k in range(1, number + 1):
            film = Film(page)
            look(page)
            if k % BAD:
                insert_by_feel(page, film.take if k == 1 else lambda: None)
                wait_for_text(page, "status", "inserted.*: G keep as good")
            else:
                push(page, ROUGH)
            film.take()
            look(page)
            if k == 1:
                film.write(pictures / "first_hour_show.webp")
            press(page, "g" if k % BAD else "b")
            session.wait_for(rf"kept {k - 1:03d}_")
        press(page, "q")
        session.process.wait(30)


def correct(session: Session, pictures: Path) -> None:
    """Shows what the skill asks for, and sees it perform."""
    with session.page(SCREEN) as page:
        wait_for_text(page, "status", "the skill practises|show me", timeout=60.0)
        screen(page)
        press(page, Keys.ESCAPE)
        film = Film(page)
        look(page)
        while True:
            wait_for_text(page, "status", "show me: [0-9]|learns|rig [0-9]|session over|never stuck", timeout=ASKED)
            asked = text_of(page, "status")
            if "show me" not in asked:
                break
            look(page)
            insert_by_feel(page, film.take)
            wait_for_text(page, "status", "inserted.*: G keep as good")
            press(page, "g")
            page.wait(f"document.getElementById('status').textContent !== {asked!r}")
            wait_for_text(page, "status", "show me: [0-9]|learns|rig [0-9]", timeout=ASKED)
        film.write(pictures / "first_hour_ask.webp")
        wait_for_text(page, "status", "rig 1 of [0-9]", timeout=ASKED)
        film = Film(page)
        while "Space:" not in text_of(page, "status"):
            film.take()
            time.sleep(0.05)
        film.take()
        look(page)
        film.write(pictures / "first_hour_rig.webp")
        press(page, "q")
        session.process.wait(30)


def screen(page: Page) -> None:
    """Makes the page as large as the screen, whatever the frame of the window takes."""
    metrics = {"width": SCREEN[0], "height": SCREEN[1], "deviceScaleFactor": 1, "mobile": False}
    page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    page.wait(f"innerHeight === {SCREEN[1]}")
    time.sleep(0.5)  # the picture follows


def follow(folder: Path, pictures: Path, demonstrations: int = 10) -> None:
    """Runs the commands of the page in a new folder, one after another, and writes its films."""
    folder.mkdir(parents=True)
    for command in commands():
        began = time.monotonic()
        print("haptic-skill", *command, flush=True)
        if "--live" in command:
            with (
                tempfile.TemporaryDirectory() as log,
                served(Path(log), "haptic_skill", *command, cwd=folder) as session,
            ):
                if command[0] == "record":
                    record(session, pictures, demonstrations)
                else:
                    correct(session, pictures)
                print(session.wait_for(r"[\s\S]*").group())
        else:
            subprocess.run([sys.executable, "-m", "haptic_skill", *command], cwd=folder, check=True)
        print(f"{(time.monotonic() - began) / 60:.1f} min", flush=True)


if __name__ == "__main__":
    follow(Path(sys.argv[1]), PICTURES)
