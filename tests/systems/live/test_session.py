"""Live sessions: a real page in a real browser, and the session in a process of its own."""

import os
import re
import resource
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.math import RigidTransform

import systems.live.session
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstration
from systems.live.buttons import QUIT, START, Buttons
from systems.live.display import SATURATED
from systems.live.page import open_live_page
from systems.live.session import LiveSession
from systems.math.rotation import from_rotation_vector
from systems.operators.meshcat_operator import R_HV, hand_coordinates, hand_pose
from tests.browser import blankness, open_page

ROOT = Path(__file__).resolve().parents[3]
PICTURES = os.environ.get("LIVE_PICTURES")  # folder in which the screenshots are kept, if set
SIZE = (1100, 760)
QUICK = {
    "geometry": {"hole_depth": 0.004, "peg_length": 0.02, "hole_radius": 0.0102, "facets": 32},
    "start": {"height": 5e-4, "tilt": [0.0, 0.0]},
    "contact": {"time_step": 0.004},
    "coupling": {"peg_inertia": 0.02, "angular_damping": 2.0},
    "recorder": {"time_limit": 60.0, "rough_force": 500.0},
}
JAMS = {**QUICK, "geometry": {**QUICK["geometry"], "hole_depth": 0.01}, "start": {"height": 5e-4, "tilt": [0.055, 0.0]}}


def test_hand_coordinates_inverts_hand_pose():
    rng = np.random.default_rng(0)
    for _ in range(20):
        coordinates = rng.uniform(-1, 1, 5) * [0.02, 0.08, 0.08, 0.003, 0.003]
        np.testing.assert_allclose(hand_coordinates(hand_pose(coordinates)), coordinates, atol=1e-12)


@pytest.mark.parametrize(
    ("coordinates", "axis", "tip"),
    [
        ([0.01, 0, 0, 0, 0], [0, 0, 1], [0, 0, -0.01]),
        ([0, 0.05, 0, 0, 0], [np.sin(0.05), 0, np.cos(0.05)], [0, 0, 0]),  # to the right
        ([0, 0, 0.05, 0, 0], [0, np.sin(0.05), np.cos(0.05)], [0, 0, 0]),  # away
        ([0, 0, 0, 0.002, 0.001], [0, 0, 1], [0.002, 0.001, 0]),
    ],
)
def test_hand_moves_in_the_directions_that_the_person_sees(coordinates, axis, tip):
    X_HD = hand_pose(np.array(coordinates, dtype=float))
    np.testing.assert_allclose(R_HV.inverse() @ X_HD.rotation().col(2), axis, atol=1e-12)
    np.testing.assert_allclose(R_HV.inverse() @ X_HD.translation(), tip, atol=1e-12)


@pytest.fixture
def session(tmp_path):
    """Makes sessions in this process without an open page; ``messages`` of a session lists what it told."""
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(QUICK))
    meshcat, page = open_live_page()

    def make(**options):
        messages = []
        session = LiveSession(
            scenario=load_scenario(str(path)),
            out=tmp_path,
            seed=0,
            meshcat=meshcat,
            page=page,
            tell=messages.append,
            **options,
        )
        session.messages = messages
        return session

    yield make
    page.close()


def test_session_without_an_open_page_gives_its_address_and_ends(session, monkeypatch):
    monkeypatch.setattr(systems.live.session, "ABSENCE_NOTICE", 0.1)
    dut = session(absence_limit=0.3)
    assert dut.run() == []
    assert any(re.match(r"no page is open: open http://localhost:\d+ to continue", line) for line in dut.messages)
    assert dut.messages[-1] == "the page stayed closed: session over"


def test_lost_device_is_reported_closed_and_opened_again(session, monkeypatch):
    class Handle:
        """A device that fails after 61 servo ticks."""

        opened = []

        def __init__(self):
            self.written, self.closed = [], False
            self.opened.append(self)

        def read_pose(self):
            if len(self.written) > 60:
                raise OSError("unplugged")
            return RigidTransform([0.0, 0.0, -1e-5 * len(self.written)])

        def write_wrench(self, wrench):
            self.written.append(wrench)

        def close(self):
            self.closed = True

    dut = session(open_device=Handle)
    presses = iter([START, START, QUIT])
    next_press = {"button": next(presses)}

    def clicked(_, button):
        if button != next_press["button"]:
            return False
        next_press["button"] = next(presses, None)
        return True

    monkeypatch.setattr(LiveSession, "_page_is_open", lambda _: True)
    monkeypatch.setattr(Buttons, "clicked", clicked)
    monkeypatch.setattr(Buttons, "forget_clicks", lambda _: None)
    assert dut.run() == []
    assert dut.messages.count("device lost (unplugged): demonstration discarded, Space starts another") == 2
    assert dut.messages[-1] == "session over"
    assert [(len(handle.written), handle.closed) for handle in Handle.opened] == [(61, True)] * 2  # one per tick


class Session:
    """The command line in a process of its own."""

    def __init__(self, process, log):
        self.process, self._log = process, log

    def wait_for(self, pattern, timeout=60.0):
        """Waits until the output matches a pattern, and returns the match."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            running = self.process.poll() is None
            match = re.search(pattern, self._log.read_text())
            if match:
                return match
            if not running:
                break
            time.sleep(0.05)
        raise AssertionError(f"'{pattern}' is not in the output:\n{self._log.read_text()}")

    def page(self):
        return open_page(self.wait_for(r"open (http\S+) in a browser").group(1), size=SIZE)


@contextmanager
def live(tmp_path, scenario=QUICK, file_size=resource.RLIM_INFINITY):
    path, log = tmp_path / "quick.yaml", tmp_path / "log.txt"
    path.write_text(yaml.safe_dump(scenario))
    browser = tmp_path / "browser.sh"  # stands for the desktop's
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path / "opened.txt"}\n')
    browser.chmod(0o755)
    command = [sys.executable, "-m", "scripts.record_demonstrations", "--live", "--out", str(tmp_path / "out")]
    with log.open("w") as stream:
        process = subprocess.Popen(
            [*command, "--scenario", str(path)],
            cwd=ROOT,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env={**os.environ, "COLUMNS": "200", "PYTHONUNBUFFERED": "1", "DISPLAY": ":9", "BROWSER": f"{browser} %s"},
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, resource.RLIM_INFINITY)),
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


def row(page, label):
    """The row of the controls whose text starts with ``label``."""
    return page.run(
        "return [...document.querySelectorAll('li.cr')].find(r => r.textContent.startsWith(arguments[0]))", label
    )


def drag(page, label, share):
    """Presses the mouse in the middle of a slider and drags it by ``share`` of its width."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    slider = row(page, label).find_element(By.CSS_SELECTOR, ".slider")
    pixels = round(share * slider.size["width"])
    ActionChains(page.driver).click_and_hold(slider).move_by_offset(pixels, 0).release().perform()


def text_of(page, name):
    return page.run("return document.getElementById(arguments[0]).textContent", name)


def wait_for_text(page, name, pattern, timeout=30.0):
    page.wait(f"/{pattern}/.test(document.getElementById('{name}').textContent)", timeout)


def keep_picture(page, name):
    return page.screenshot(Path(PICTURES) / f"{name}.png" if PICTURES else None)


def orange(picture):
    """Fraction of the pixels that have the colour of the peg."""
    red, green, blue = (picture[..., k].astype(int) for k in range(3))
    return float(((red > green + 30) & (green > blue + 30)).mean())


@pytest.mark.slow
def test_person_with_mouse_and_keys_records_a_demonstration(tmp_path):
    with live(tmp_path) as session, session.page() as page:
        wait_for_text(page, "status", "ready: press Space")
        assert (tmp_path / "opened.txt").read_text().strip() + "/" == page.driver.current_url
        page.wait("document.body.innerText.includes('view of the cut (1)')")
        time.sleep(0.5)
        ready = keep_picture(page, "ready")  # before anything is pressed: a large peg and block in the middle
        assert 0.02 < orange(ready[:, 300:800]) < 0.6
        assert blankness(ready).colours > 20
        assert row(page, "depth").is_displayed()  # the controls are open from the start
        assert row(page, "start (Space)").is_displayed()
        for words in ("feed, retract", "tilt the peg", "keep as good", "quit"):
            assert words in text_of(page, "keys")
        assert text_of(page, "depth") == "-0.50 of 3.7 mm"
        pictures = [ready]
        for key in "231":
            press(page, key)
            time.sleep(0.4)
            pictures.append(keep_picture(page, f"view_{key}"))
        for one, other in ((0, 1), (1, 2), (2, 3)):
            assert np.abs(pictures[one].astype(int) - pictures[other]).mean() > 1.0  # the camera moved
        assert np.abs(pictures[3].astype(int) - ready).mean() < 0.5  # and came back
        press(page, " ")
        session.wait_for("recording:")
        press(page, "w", times=2)
        wait_for_text(page, "depth", "^0.[1-9]")  # 0.5 mm a press, from half a millimetre above
        drag(page, "depth", 0.1)  # to 20 mm
        session.wait_for("inserted: G keep as good")
        wait_for_text(page, "depth", "^3.[7-9]")
        keep_picture(page, "inserted")
        late_steps, steps, late_ticks, ticks = map(int, re.findall(r"\d+", text_of(page, "deadlines")))
        assert 0 <= late_steps <= steps == ticks // 4 > 0
        assert late_steps <= late_ticks <= ticks
        assert float(text_of(page, "rate").split()[0]) > 0
        assert float(text_of(page, "energy").split()[0]) > 0
        assert float(text_of(page, "min_energy").split()[0]) <= 0
        press(page, "g")
        session.wait_for("kept 000_good_live.parquet")
        wait_for_text(page, "kept", "^1$")
        wait_for_text(page, "depth", "^-0.50")  # the next start
        press(page, " ")
        session.wait_for("kept.*[\\s\\S]*recording:")
        press(page, "x")
        session.wait_for("discarded|too short")
        press(page, "x", "q")
        wait_for_text(page, "status", "session over")
        assert session.process.wait(30) == 0
        assert page.errors() == [] or all("WebSocket" in e for e in page.errors())  # the scene's server has gone
    session.wait_for("1 demonstrations kept")
    example = read_demonstration(tmp_path / "out" / "000_good_live.parquet")
    assert example.good
    assert example.outcome == "inserted"
    assert example.samples["z"].iloc[-1] < -0.003
    assert example.metadata["habit"] == "live"
    assert example.metadata["lowest_probe_energy_J"] <= 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000_good_live.parquet"]


@pytest.mark.slow
def test_saturation_is_red_a_full_disk_is_reported_and_a_killed_session_keeps_its_recordings(tmp_path):
    out = tmp_path / "out"
    with live(tmp_path, JAMS, file_size=8192) as session, session.page() as page:
        wait_for_text(page, "status", "ready")
        page.wait("document.body.innerText.includes('view of the cut (1)')")
        press(page, " ")
        session.wait_for("recording:")
        drag(page, "depth", 0.45)  # pushes the jammed peg
        page.wait("document.getElementById('gauge-text').textContent.startsWith('saturated')")
        time.sleep(0.3)
        picture = keep_picture(page, "saturated").astype(int)
        red = [round(255 * c) for c in (SATURATED.r(), SATURATED.g(), SATURATED.b())]
        style = "return getComputedStyle(document.getElementById('gauge-fill')).backgroundColor"
        assert [int(c) for c in re.findall(r"\d+", page.run(style))] == red
        scene = picture[100:500, 300:760]  # contains the arrow, but not the bar
        assert ((scene[..., 0] > 170) & (scene[..., 1] < 60) & (scene[..., 2] < 60)).sum() > 20
        press(page, "b")  # ends the demonstration and is the verdict
        session.wait_for("stopped: G keep as good, B keep as bad")
        session.wait_for("not kept, File too large: make room and press again")
        wait_for_text(page, "status", "make room and press again")
        assert list(out.iterdir()) == []
        resource.prlimit(session.process.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
        press(page, "b")
        session.wait_for("kept 000_bad_live.parquet")
        press(page, " ")
        session.wait_for("kept.*[\\s\\S]*recording:")
        page.wait("Number(document.getElementById('deadlines').textContent.match(/[0-9]+/g)[3]) > 200")  # ticks
        press(page, "g")
        session.wait_for("kept.*[\\s\\S]*stopped")
        session.process.kill()  # while it writes, or shortly before or after
        session.process.wait()
        wait_for_text(page, "status", "no connection to the session")
    whole = sorted(out.glob("*.parquet"))
    assert whole[0].name == "000_bad_live.parquet"
    assert [read_demonstration(path).good for path in whole] == [False, True][: len(whole)]


@pytest.mark.slow
def test_session_continues_after_a_closed_page_and_a_disconnected_gamepad(tmp_path):
    """The page replaces the browser's gamepad interface by one that reports a gamepad."""
    pad = "{index: 0, connected: true, mapping: 'standard', buttons: [], axes: [%s, 0, 0, 0]}"
    with live(tmp_path) as session:
        with session.page() as page:
            wait_for_text(page, "status", "ready")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            press(page, " ")
            session.wait_for("recording:")
        session.wait_for("the page was closed: demonstration discarded")
        assert session.process.poll() is None
        assert list((tmp_path / "out").iterdir()) == []
        with session.page() as page:
            wait_for_text(page, "status", "the page was closed")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            page.run("navigator.getGamepads = () => [" + pad % "0.0" + "]")
            press(page, " ")
            session.wait_for("gamepad: left stick tilts, right stick feeds")
            page.run("navigator.getGamepads = () => [" + pad % "0.2" + "]")  # moves less than a step of the slider
            slider = row(page, "tilt right").find_element("css selector", "input")
            end = time.monotonic() + 30
            while float(slider.get_property("value")) < 1.0:
                assert time.monotonic() < end
            page.run("navigator.getGamepads = () => []")
            session.wait_for("gamepad disconnected: use sliders and keys")
            press(page, "b")
            session.wait_for("kept 000_bad_live.parquet")
            press(page, "q")
            assert session.process.wait(30) == 0
    example = read_demonstration(tmp_path / "out" / "000_bad_live.parquet")
    assert not example.good
    last = example.samples.iloc[-1]
    lean = R_HV.inverse() @ from_rotation_vector(last["angle"] * last[["ax", "ay", "az"]].to_numpy(dtype=float)).col(2)
    assert lean[0] > np.sin(np.radians(0.8))  # to the right
    assert abs(lean[1]) < 0.1 * lean[0]
