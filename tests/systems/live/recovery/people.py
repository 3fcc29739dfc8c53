"""A person of the tests, who shows with the keys of a live page what a skill asks for."""

import time

from selenium.webdriver.common.keys import Keys

from tests.systems.live.live_session import press, text_of

UPRIGHT = 0.15  # tilt that the person leaves, degrees
STEP = 0.1  # of a press of an arrow, degrees
DEADLINE = 40.0  # in units of s, for a demonstration


def tilt(page):
    """The tilt of the peg as the dial shows it, degrees to the right and away from the person."""
    shown = page.run("const t = document.getElementById('tilt'); return [t.getAttribute('x2'), t.getAttribute('y2')]")
    return float(shown[0]) / 10.0, -float(shown[1]) / 10.0


def insert(page):
    """Starts a demonstration, draws the peg back a little, levels it, and feeds it to the floor."""
    press(page, " ", "s")
    end = time.monotonic() + DEADLINE
    while "recording" in text_of(page, "status") or "show me" in text_of(page, "status"):
        assert time.monotonic() < end, text_of(page, "status")
        right, away = tilt(page)
        if abs(right) < UPRIGHT and abs(away) < UPRIGHT:
            press(page, "w", times=2)
            continue
        for angle, less, more in ((right, Keys.ARROW_RIGHT, Keys.ARROW_LEFT), (away, Keys.ARROW_UP, Keys.ARROW_DOWN)):
            press(page, less if angle < 0 else more, times=min(5, int(abs(angle) / STEP)))
        time.sleep(0.1)
