"""A person at the controls: real pages in a real browser, and a real session process."""

import os
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yaml
from browser import blankness, open_page

from skill.demonstration import read_demonstration
from systems.meshcat_operator import hand_coordinates, hand_pose

ROOT = Path(__file__).resolve().parents[2]
PICTURES = os.environ.get("LIVE_PICTURES")  # a folder to keep the screenshots in, to be looked at


def test_coordinates_and_pose_of_the_hand_are_inverse():
    rng = np.random.default_rng(0)
    for _ in range(20):
        coordinates = rng.uniform(-1, 1, 5) * [0.02, 0.08, 0.08, 0.003, 0.003]
        np.testing.assert_allclose(hand_coordinates(hand_pose(coordinates)), coordinates, atol=1e-12)


class Session:
    """The command line in a process of its own; its lines are read as they come."""

    def __init__(self, process, log):
        self.process, self._log = process, log

    def said(self, pattern, timeout=60.0):
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            text = self._log.read_text()
            if re.search(pattern, text):
                return re.search(pattern, text)
            if self.process.poll() is not None and not re.search(pattern, self._log.read_text()):
                break
            time.sleep(0.1)
        raise AssertionError(f"'{pattern}' was not said; it said:\n{self._log.read_text()}")


@contextmanager
def live(tmp_path, *options, **environment):
    quick = {
        "geometry": {"hole_depth": 0.004, "peg_length": 0.02},
        "start": {"height": 5e-4, "tilt": [0.0, 0.0]},
        "contact": {"time_step": 0.004},
        "coupling": {"peg_inertia": 0.02, "angular_damping": 2.0},
        "recorder": {"time_limit": 60.0, "rough_force": 500.0},
    }
    scenario, log = tmp_path / "quick.yaml", tmp_path / "log.txt"
    scenario.write_text(yaml.safe_dump(quick))
    command = [sys.executable, "-m", "scripts.record_demonstrations", "--live", "--out", str(tmp_path / "out")]
    with log.open("w") as stream:
        process = subprocess.Popen(
            [*command, "--scenario", str(scenario), *options],
            cwd=ROOT,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env={**os.environ, "COLUMNS": "200", "PYTHONUNBUFFERED": "1", **environment},
        )
    try:
        yield Session(process, log)
    finally:
        process.kill()
        process.wait()


def press(page, *keys, times=1, pause=0.0):
    from selenium.webdriver.common.action_chains import ActionChains

    for _ in range(times):
        for key in keys:
            ActionChains(page.driver).send_keys(key).perform()
        time.sleep(pause)


def open_controls(page):
    """A person's click on the bar at the top right; without it the sliders are folded away."""
    found = page.run("return [...document.querySelectorAll('*')].filter(e => e.textContent.trim() == 'Open Controls')")
    found[-1].click()
    page.wait("document.body.innerText.includes('Close Controls')")
    time.sleep(0.7)


def keep_picture(page, name):
    picture = page.screenshot(Path(PICTURES) / f"{name}.png" if PICTURES else None)
    assert blankness(picture).colours > 20
    return picture


def test_a_person_at_the_keys_ends_with_a_demonstration_on_disk(tmp_path):
    with live(tmp_path) as session:
        url = session.said(r"open (http\S+) in a browser").group(1)
        with open_page(url, size=(1280, 800)) as page:
            session.said("ready: press Space to start")
            page.wait("document.body.innerText.includes('quit (Q)')")
            time.sleep(1.0)
            open_controls(page)
            keep_picture(page, "ready")
            press(page, " ")
            session.said("showing")
            press(page, "w", times=14, pause=0.15)
            keep_picture(page, "showing")
            session.said("inserted: G keep as good", timeout=90)
            press(page, "2")
            time.sleep(0.7)
            above = keep_picture(page, "above")
            press(page, "1")
            time.sleep(0.7)
            assert np.abs(above.astype(int) - page.screenshot()).mean() > 2.0  # the camera has moved
            press(page, "g")
            session.said("kept 000_good_live.parquet")
            press(page, " ")
            session.said("kept.*[\\s\\S]*showing")
            press(page, "x")
            session.said("discarded")
            press(page, "q")
            assert session.process.wait(30) == 0
    session.said("1 demonstrations kept")
    shown = read_demonstration(tmp_path / "out" / "000_good_live.parquet")
    assert shown.good
    assert shown.outcome == "inserted"
    assert shown.samples["z"].iloc[-1] < -0.003
    assert shown.metadata["habit"] == "live"
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000_good_live.parquet"]


def test_a_closed_page_is_said_and_the_session_goes_on_with_the_next_page(tmp_path):
    with live(tmp_path) as session:
        url = session.said(r"open (http\S+) in a browser").group(1)
        with open_page(url) as page:
            session.said("ready")
            page.wait("document.body.innerText.includes('quit (Q)')")
            time.sleep(1.0)
            press(page, " ")
            session.said("showing")
        session.said("the page was closed: the demonstration is discarded")
        session.said("no page is open")
        assert session.process.poll() is None
        with open_page(url) as page:
            page.wait("document.body.innerText.includes('quit (Q)')")
            time.sleep(1.0)
            press(page, "q")
            assert session.process.wait(30) == 0
    assert list((tmp_path / "out").iterdir()) == []


def test_a_gamepad_feeds_and_when_it_vanishes_the_session_goes_on(tmp_path):
    """The browser's own gamepad interface, answered by the page as a browser with one plugged in would."""
    pad = "{index: 0, connected: true, mapping: 'standard', buttons: [], axes: [0, 0, 0, %s]}"
    with live(tmp_path) as session:
        url = session.said(r"open (http\S+) in a browser").group(1)
        with open_page(url) as page:
            session.said("ready")
            page.wait("document.body.innerText.includes('quit (Q)')")
            time.sleep(1.0)
            page.run("navigator.getGamepads = () => [" + pad % "0.0" + "]")
            press(page, " ")
            session.said("gamepad: left stick tilts, right stick feeds")
            page.run("navigator.getGamepads = () => [" + pad % "0.15" + "]")
            time.sleep(0.5)
            page.run("navigator.getGamepads = () => []")
            session.said("the gamepad is gone: sliders and keys go on")
            press(page, "w", times=12, pause=0.1)
            session.said("inserted: G keep as good", timeout=90)
            press(page, "b")
            session.said("kept 000_bad_live.parquet")
            press(page, "q")
            assert session.process.wait(30) == 0
    assert not read_demonstration(tmp_path / "out" / "000_bad_live.parquet").good
