"""A person at the controls: real pages in a real browser, and a real session process."""

import os
import re
import resource
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from pydrake.math import RigidTransform

import systems.live.session
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstration
from systems.live.display import SATURATED, colour_of
from systems.live.page import LivePage, open_live_page
from systems.live.session import QUIT, SLACK, START, Clock, LiveSession
from systems.math.rotation import from_rotation_vector
from systems.operators.meshcat_operator import R_HV, hand_coordinates, hand_pose
from tests.browser import blankness, open_page

ROOT = Path(__file__).resolve().parents[3]
PICTURES = os.environ.get("LIVE_PICTURES")  # a folder to keep the screenshots in, to be looked at
SIZE = (1100, 760)
QUICK = {
    "geometry": {"hole_depth": 0.004, "peg_length": 0.02, "hole_radius": 0.0102, "facets": 32},
    "start": {"height": 5e-4, "tilt": [0.0, 0.0]},
    "contact": {"time_step": 0.004},
    "coupling": {"peg_inertia": 0.02, "angular_damping": 2.0},
    "recorder": {"time_limit": 60.0, "rough_force": 500.0},
}
JAMS = {**QUICK, "geometry": {**QUICK["geometry"], "hole_depth": 0.01}, "start": {"height": 5e-4, "tilt": [0.055, 0.0]}}


def test_coordinates_and_pose_of_the_hand_are_inverse():
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
def test_the_controls_move_the_hand_as_the_person_before_the_cut_sees_it(coordinates, axis, tip):
    X_HD = hand_pose(np.array(coordinates, dtype=float))
    np.testing.assert_allclose(R_HV.inverse() @ X_HD.rotation().col(2), axis, atol=1e-12)
    np.testing.assert_allclose(R_HV.inverse() @ X_HD.translation(), tip, atol=1e-12)


def test_the_colour_turns_at_half_and_at_all_that_the_device_can_give():
    colours = [colour_of(share) for share in (0.0, 0.5, 0.51, 0.99, 1.0, 3.0)]
    assert colours[0] == colours[1] != colours[2] == colours[3] != colours[4] == colours[5] == SATURATED


def test_a_taken_port_is_named():
    _, page = open_live_page()
    try:
        port = int(page.address.rsplit(":", 1)[1])
        with pytest.raises(OSError, match=f"{port} and {port + 1} are taken"):
            open_live_page(port)
        with pytest.raises(OSError, match="in use"):
            LivePage(port=port, scene_port=port + 1)
    finally:
        page.close()


def test_the_clock_waits_counts_and_makes_up_for_what_is_a_little_late(monkeypatch):
    wall = SimpleNamespace(now=0.0)
    sleep = lambda seconds: setattr(wall, "now", wall.now + seconds)  # noqa: E731
    monkeypatch.setattr(systems.live.session, "time", SimpleNamespace(monotonic=lambda: wall.now, sleep=sleep))
    dut = Clock(period=1e-3, per_step=4, began=0.0)
    for cost in [2.5e-3, 1e-4, 1e-4, 1e-4] * 10:  # a step that is in time delays two ticks
        wall.now += cost
        dut.keep()
    assert dut.missed() == [0, 10, 20, 40]
    assert wall.now == pytest.approx(0.040)
    for cost in [5e-3, 1e-4, 1e-4, 1e-4] + [1e-4] * 4:  # one that is not, and is made up for in the next
        wall.now += cost
        dut.keep()
    assert dut.missed() == [1, 12, 25, 48]
    assert wall.now == pytest.approx(0.048)
    wall.now += 2 * SLACK  # too late to be made up for: the wall's clock is set back
    dut.keep()
    began = wall.now
    for _ in range(10):
        dut.keep()
    assert wall.now == pytest.approx(began + 0.010)


@pytest.fixture
def session(tmp_path):
    """Makes a session in this process, whose page nobody has open; what it tells is collected in ``session.told``."""
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(QUICK))
    meshcat, page = open_live_page()

    def make(**options):
        told = []
        made = LiveSession(
            scenario=load_scenario(str(path)),
            out=tmp_path,
            seed=0,
            meshcat=meshcat,
            page=page,
            tell=told.append,
            **options,
        )
        made.told = told
        return made

    yield make
    page.close()


def test_a_session_without_a_page_says_where_it_is_and_ends(session, monkeypatch):
    monkeypatch.setattr(systems.live.session, "ABSENT_TOLD", 0.1)
    dut = session(absent_limit=0.3)
    assert dut.run() == []
    assert any(re.match(r"no page is open: open http://localhost:\d+ to go on", line) for line in dut.told)
    assert dut.told[-1] == "the page stayed closed: session over"


def test_a_device_that_is_lost_is_said_closed_and_opened_again(session, monkeypatch):
    class Handle:
        """Works for a while."""

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
    wanted = {"button": next(presses)}

    def clicked(_, button):
        if button != wanted["button"]:
            return False
        wanted["button"] = next(presses, None)
        return True

    monkeypatch.setattr(LiveSession, "_present", lambda _: True)
    monkeypatch.setattr(LiveSession, "_clicked", clicked)
    monkeypatch.setattr(LiveSession, "_forget_clicks", lambda _: None)
    assert dut.run() == []
    assert dut.told.count("device lost (unplugged): demonstration discarded, Space starts another") == 2
    assert dut.told[-1] == "session over"
    assert [(len(handle.written), handle.closed) for handle in Handle.opened] == [(61, True)] * 2  # one a tick


class Session:
    """The command line in a process of its own; its lines are read as they come."""

    def __init__(self, process, log):
        self.process, self._log = process, log

    def said(self, pattern, timeout=60.0):
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            running = self.process.poll() is None
            found = re.search(pattern, self._log.read_text())
            if found:
                return found
            if not running:
                break
            time.sleep(0.05)
        raise AssertionError(f"'{pattern}' was not said; it said:\n{self._log.read_text()}")

    def page(self):
        return open_page(self.said(r"open (http\S+) in a browser").group(1), size=SIZE)


@contextmanager
def live(tmp_path, scenario=QUICK, file_size=resource.RLIM_INFINITY):
    path, log = tmp_path / "quick.yaml", tmp_path / "log.txt"
    path.write_text(yaml.safe_dump(scenario))
    browser = tmp_path / "browser.sh"  # the desktop's
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
    """The row of the controls that begins with ``label``."""
    return page.run(
        "return [...document.querySelectorAll('li.cr')].find(r => r.textContent.startsWith(arguments[0]))", label
    )


def drag(page, label, share):
    """Takes a slider by the mouse in its middle, and drags it by ``share`` of its width."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    slider = row(page, label).find_element(By.CSS_SELECTOR, ".slider")
    far = round(share * slider.size["width"])
    ActionChains(page.driver).click_and_hold(slider).move_by_offset(far, 0).release().perform()


def shown(page, name):
    return page.run("return document.getElementById(arguments[0]).textContent", name)


def shows(page, name, pattern, timeout=30.0):
    page.wait(f"/{pattern}/.test(document.getElementById('{name}').textContent)", timeout)


def keep_picture(page, name):
    return page.screenshot(Path(PICTURES) / f"{name}.png" if PICTURES else None)


def orange(picture):
    """Share of the picture that has the peg's colour."""
    red, green, blue = (picture[..., k].astype(int) for k in range(3))
    return float(((red > green + 30) & (green > blue + 30)).mean())


def test_a_person_at_mouse_and_keys_ends_with_a_demonstration_on_disk(tmp_path):
    with live(tmp_path) as session, session.page() as page:
        shows(page, "status", "ready: press Space")
        assert (tmp_path / "opened.txt").read_text().strip() + "/" == page.driver.current_url
        page.wait("document.body.innerText.includes('view of the cut (1)')")
        time.sleep(0.5)
        ready = keep_picture(page, "ready")  # before anything is pressed: peg and block, in the middle, large
        assert 0.02 < orange(ready[:, 300:800]) < 0.6
        assert blankness(ready).colours > 20
        assert row(page, "depth").is_displayed()  # nobody had to open the controls
        assert row(page, "start (Space)").is_displayed()
        for words in ("feed, draw back", "lean the peg", "keep as good", "quit"):
            assert words in shown(page, "keys")
        assert shown(page, "depth") == "-0.50 of 3.7 mm"
        pictures = [ready]
        for key in "231":
            press(page, key)
            time.sleep(0.4)
            pictures.append(keep_picture(page, f"view_{key}"))
        for one, other in ((0, 1), (1, 2), (2, 3)):
            assert np.abs(pictures[one].astype(int) - pictures[other]).mean() > 1.0  # the camera has moved
        assert np.abs(pictures[3].astype(int) - ready).mean() < 0.5  # and has come back
        press(page, " ")
        session.said("showing")
        press(page, "w", times=2)
        shows(page, "depth", "^0.[1-9]")  # 0.5 mm a press, from half a millimetre above
        drag(page, "depth", 0.1)  # to 20 mm
        session.said("inserted: G keep as good")
        shows(page, "depth", "^3.[7-9]")
        keep_picture(page, "inserted")
        late_steps, steps, late_ticks, ticks = map(int, re.findall(r"\d+", shown(page, "missed")))
        assert 0 <= late_steps <= steps == ticks // 4 > 0
        assert late_steps <= late_ticks <= ticks
        assert float(shown(page, "rate").split()[0]) > 0
        assert float(shown(page, "energy").split()[0]) > 0
        assert float(shown(page, "lowest").split()[0]) <= 0
        press(page, "g")
        session.said("kept 000_good_live.parquet")
        shows(page, "kept", "^1$")
        shows(page, "depth", "^-0.50")  # the next start
        press(page, " ")
        session.said("kept.*[\\s\\S]*showing")
        press(page, "x")
        session.said("discarded|too short")
        press(page, "x", "q")
        shows(page, "status", "session over")
        assert session.process.wait(30) == 0
        assert page.errors() == [] or all("WebSocket" in e for e in page.errors())  # the scene's server has gone
    session.said("1 demonstrations kept")
    example = read_demonstration(tmp_path / "out" / "000_good_live.parquet")
    assert example.good
    assert example.outcome == "inserted"
    assert example.samples["z"].iloc[-1] < -0.003
    assert example.metadata["habit"] == "live"
    assert example.metadata["lowest_probe_energy_J"] <= 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000_good_live.parquet"]


def test_saturation_is_red_a_full_disk_is_said_and_a_killed_session_loses_nothing(tmp_path):
    out = tmp_path / "out"
    with live(tmp_path, JAMS, file_size=8192) as session, session.page() as page:
        shows(page, "status", "ready")
        page.wait("document.body.innerText.includes('view of the cut (1)')")
        press(page, " ")
        session.said("showing")
        drag(page, "depth", 0.45)  # a jammed peg is pushed
        page.wait("document.getElementById('gauge-text').textContent.startsWith('saturated')")
        time.sleep(0.3)
        picture = keep_picture(page, "saturated").astype(int)
        red = [round(255 * c) for c in (SATURATED.r(), SATURATED.g(), SATURATED.b())]
        style = "return getComputedStyle(document.getElementById('gauge-fill')).backgroundColor"
        assert [int(c) for c in re.findall(r"\d+", page.run(style))] == red
        scene = picture[100:500, 300:760]  # the arrow, apart from the bar
        assert ((scene[..., 0] > 170) & (scene[..., 1] < 60) & (scene[..., 2] < 60)).sum() > 20
        press(page, "b")  # ends it, and is the verdict
        session.said("stopped: G keep as good, B keep as bad")
        session.said("not kept, File too large: make room and press again")
        shows(page, "status", "make room and press again")
        assert list(out.iterdir()) == []
        resource.prlimit(session.process.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
        press(page, "b")
        session.said("kept 000_bad_live.parquet")
        press(page, " ")
        session.said("kept.*[\\s\\S]*showing")
        page.wait("Number(document.getElementById('missed').textContent.match(/[0-9]+/g)[3]) > 200")  # ticks
        press(page, "g")
        session.said("kept.*[\\s\\S]*stopped")
        session.process.kill()  # while it writes, or just before or after
        session.process.wait()
        shows(page, "status", "no connection to the session")
    whole = sorted(out.glob("*.parquet"))
    assert whole[0].name == "000_bad_live.parquet"
    assert [read_demonstration(path).good for path in whole] == [False, True][: len(whole)]


def test_a_closed_page_and_a_vanished_gamepad_are_said_and_the_session_goes_on(tmp_path):
    """The browser's own gamepad interface, answered by the page as a browser with one plugged in would."""
    pad = "{index: 0, connected: true, mapping: 'standard', buttons: [], axes: [%s, 0, 0, 0]}"
    with live(tmp_path) as session:
        with session.page() as page:
            shows(page, "status", "ready")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            press(page, " ")
            session.said("showing")
        session.said("the page was closed: the demonstration is discarded")
        assert session.process.poll() is None
        assert list((tmp_path / "out").iterdir()) == []
        with session.page() as page:
            shows(page, "status", "the page was closed")
            page.wait("document.body.innerText.includes('view of the cut (1)')")
            page.run("navigator.getGamepads = () => [" + pad % "0.0" + "]")
            press(page, " ")
            session.said("gamepad: left stick leans, right stick feeds")
            page.run("navigator.getGamepads = () => [" + pad % "0.2" + "]")  # finer than a slider's step
            slider = row(page, "lean right").find_element("css selector", "input")
            end = time.monotonic() + 30
            while float(slider.get_property("value")) < 1.0:
                assert time.monotonic() < end
            page.run("navigator.getGamepads = () => []")
            session.said("the gamepad is gone: sliders and keys go on")
            press(page, "b")
            session.said("kept 000_bad_live.parquet")
            press(page, "q")
            assert session.process.wait(30) == 0
    example = read_demonstration(tmp_path / "out" / "000_bad_live.parquet")
    assert not example.good
    last = example.samples.iloc[-1]
    lean = R_HV.inverse() @ from_rotation_vector(last["angle"] * last[["ax", "ay", "az"]].to_numpy(dtype=float)).col(2)
    assert lean[0] > np.sin(np.radians(0.8))  # to the right
    assert abs(lean[1]) < 0.1 * lean[0]
