"""Live sessions: a real page in a real browser, and the session in a process of its own."""

import re
import resource
import time

import numpy as np
import pytest
import yaml

from experiments.outputs.folder_lock import LOCK_NAME
from interfaces.live.controls import LiveControls
from interfaces.live.display import SATURATED, LiveDisplay
from interfaces.live.page import LivePage, open_live_page
from interfaces.live.session import (
    GOOD,
    QUIT,
    START,
    LiveSession,
    live_scenario,
    next_number,
)
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstration
from skill.data.outcome import Outcome
from skill.features.measurement import MEASURED
from skill.policy.policy_observer import PolicyObserver
from systems.math.rotation import from_rotation_vector
from systems.operators.person_frame import R_HV
from tests.browser import blankness
from tests.interfaces.live.live_session import QUICK, drag, live, press, row, text_of, wait_for_text

JAMS = {
    **QUICK,
    "geometry": {**QUICK["geometry"], "hole_radius": 0.01005, "hole_depth": 0.01},
    "start": {"height": 5e-4, "tilt": [0.055, 0.0]},
}


@pytest.fixture
def session(tmp_path):
    """Makes sessions in this process without an open page; ``messages`` of a session lists what it told."""
    path = tmp_path / "quick.yaml"
    page = open_live_page()

    def make(scenario=QUICK, **options):
        path.write_text(yaml.safe_dump(scenario))
        messages = []
        session = LiveSession(
            start_of=lambda number: live_scenario(load_scenario(str(path)), seed=0, number=number),
            out=tmp_path,
            page=page,
            announce=messages.append,
            **options,
        )
        session.messages = messages
        return session

    yield make
    page.close()


def press_in_turn(monkeypatch, session, buttons, wait=60.0):
    """A person with an open page, who presses a button when the session asks for it.

    An AssertionError ends a session that asks for another button for too long.
    """
    waiting, end = list(buttons), time.monotonic() + wait

    def clicked(_, button):
        if time.monotonic() > end:
            raise AssertionError(f"{waiting} were not asked for after: {session.messages}")
        return waiting[:1] == [button] and bool(waiting.pop(0))

    monkeypatch.setattr(LivePage, "is_shown", True)
    monkeypatch.setattr(LiveControls, "clicked", clicked)
    monkeypatch.setattr(LiveControls, "any_waiting", lambda _, *labels: False)
    monkeypatch.setattr(LiveControls, "forget_clicks", lambda _, *labels: None)


def test_session_without_an_open_page_ends(session):
    dut = session(absence_limit=0.3)
    assert dut.run() == []
    assert dut.messages[-1] == "the page stayed closed: session over"


def test_lost_device_is_reported_closed_and_opened_again(session, monkeypatch, tmp_path):
    monkeypatch.setenv("CLOSED", str(tmp_path / "closed.txt"))
    driver = "tests.systems.servo.drivers:Raising"
    dut = session(driver=driver)
    press_in_turn(monkeypatch, dut, [START, START, QUIT])
    assert dut.run() == []
    lost = f"device lost (device driver '{driver}': unplugged): demonstration discarded, Space starts another"
    assert dut.messages.count(lost) == 2
    assert dut.messages.count(f"opening the device '{driver}'") == 2
    assert dut.messages[-1] == "session over"


PINS = {"mates": [[-0.0095, 0.0, 0.004, 0.0, 0.0], [0.0095, 0.0, 0.004, 0.0, 0.0]]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shape", "engine"),
    [({}, "drake"), ({}, "exact"), ({"section": "square"}, "drake"), ({"section": "square"}, "exact"), (PINS, "exact")],
)
def test_a_demonstration_with_a_device_is_kept(session, monkeypatch, shape, engine):
    """The loopback device inserts the peg; the verdict is good."""
    geometry, contact = {**QUICK["geometry"], **shape}, {**QUICK["contact"], "engine": engine}
    if "mates" in shape:
        geometry["peg_radius"], geometry["hole_radius"] = 0.004, 0.0042
    dut = session({**QUICK, "geometry": geometry, "contact": contact}, driver="loopback")
    press_in_turn(monkeypatch, dut, [START, GOOD, QUIT])
    (path,) = dut.run()
    found = read_demonstration(path)
    assert found.good
    assert found.outcome == Outcome.INSERTED
    assert found.metadata["lowest_probe_energy_J"] < 0.0  # of the servo's observer


def test_recordings_are_numbered_after_the_largest_number(tmp_path):
    assert next_number(tmp_path) == 0
    for name in ("004_good_live.parquet", "017_bad_live.parquet", "099_note.txt", "1_x.parquet", "20_x.parquet"):
        (tmp_path / name).touch()
    assert next_number(tmp_path) == 18
    (tmp_path / "1000_good_live.parquet").touch()
    assert next_number(tmp_path) == 1001  # not 100, which would replace a recording later


def orange(picture):
    """Fraction of the pixels that have the colour of the peg."""
    red, green, blue = (picture[..., k].astype(int) for k in range(3))
    return float(((red > green + 30) & (green > blue + 30)).mean())


@pytest.mark.browser
@pytest.mark.slow
def test_person_with_mouse_and_keys_records_a_demonstration(tmp_path):
    with live(tmp_path) as session, session.page() as page:
        wait_for_text(page, "status", "ready: press Space")
        assert (tmp_path / "opened.txt").read_text().strip() == page.driver.current_url
        page.wait("document.body.innerText.includes('view of the cut (1)')")
        time.sleep(0.5)
        ready = page.screenshot()  # before anything is pressed: a large peg and block in the middle
        assert 0.02 < orange(ready[:, 300:800]) < 0.6
        assert blankness(ready).colours > 20
        assert row(page, "start (Space)").is_displayed()  # the controls are open from the start
        for name in ("depth mm", "tilt right", "keep as good (G)", "quit (Q)"):
            assert page.run("return document.body.innerText").count(name) == 1  # each action stands once
        assert text_of(page, "depth") == "-0.50 of 2.9 mm"
        press(page, "2")
        time.sleep(1.0)
        assert np.abs(page.screenshot().astype(int) - ready).mean() > 1.0  # the camera moved
        press(page, " ")
        session.wait_for("recording:")
        press(page, "w", times=2)
        wait_for_text(page, "depth", "^0.[1-9]")  # 0.5 mm a press, from half a millimetre above
        drag(page, "depth", 0.1)  # to 20 mm
        session.wait_for("inserted: G keep as good")
        wait_for_text(page, "depth", "^(2.9|3|4.0)")  # the floor is at 4 mm
        late_steps, steps, late_ticks, ticks = map(int, re.findall(r"\d+", text_of(page, "deadlines")))
        assert 0 <= late_steps <= steps
        # the last step waited for the end of tick 4 (steps - 1); neither the first tick nor that one counts
        assert ticks >= max(4 * (steps - 1) - 2, late_ticks)
        for name in ("rate", "energy"):
            assert float(text_of(page, name).split()[0]) > 0
        press(page, "g")
        session.wait_for("kept 000_good_live.parquet")
        wait_for_text(page, "kept", "^1$")
        wait_for_text(page, "depth", "^-0.50")  # the next start
        press(page, " ")
        session.wait_for("kept.*[\\s\\S]*recording:")
        press(page, " ", "x")  # a second press of Space starts nothing
        session.wait_for("discarded|too short")
        time.sleep(0.5)
        assert not text_of(page, "status").startswith("recording")
        press(page, "x", "q")
        wait_for_text(page, "status", "session over")
        assert session.process.wait(30) == 0
        assert all("WebSocket" in e for e in page.errors())  # the scene's server has gone
    session.wait_for("1 demonstration kept")
    example = read_demonstration(tmp_path / "out" / "000_good_live.parquet")
    assert (example.good, example.outcome, example.metadata["habit"]) == (True, "inserted", "live")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000_good_live.parquet", "index.json"]


@pytest.mark.slow
def test_a_skill_names_the_contact_states_and_shows_what_it_would_do(session, monkeypatch, skill):
    seen = []
    monkeypatch.setattr(LiveDisplay, "show_judgement", lambda _, found, **given: seen.append((found, given)))
    dut = session(driver="loopback", policy=skill)
    press_in_turn(monkeypatch, dut, [START, GOOD, QUIT])
    (path,) = dut.run()
    samples = read_demonstration(path).samples
    observer = PolicyObserver(skill)
    for (found, given), sample in zip(seen, samples.iloc[1:].to_dict("records"), strict=True):
        expected = observer.watch([sample[name] for name in MEASURED], [sample["rx"], sample["ry"]])
        assert (found.state, found.known, found.action.feed) == (expected.state, expected.known, expected.action.feed)
        assert -given["X_HP"].translation()[2] == pytest.approx(-sample["z"])
    assert len({found.action.feed for found, _ in seen}) > 1
    assert given["names"] == skill.state_names()


@pytest.mark.browser
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
        picture = page.screenshot().astype(int)
        red = [round(255 * c) for c in (SATURATED.r(), SATURATED.g(), SATURATED.b())]
        style = "return getComputedStyle(document.getElementById('gauge-fill')).backgroundColor"
        assert [int(c) for c in re.findall(r"\d+", page.run(style))] == red
        scene = picture[100:500, 300:760]  # contains the arrow, but not the bar
        assert ((scene[..., 0] > 170) & (scene[..., 1] < 60) & (scene[..., 2] < 60)).sum() > 20
        press(page, "b")  # ends the demonstration and is the verdict
        session.wait_for("stopped: G keep as good, B keep as bad")
        session.wait_for("not kept, File too large: make room and press again")
        wait_for_text(page, "status", "make room and press again")
        assert [path.name for path in out.iterdir()] == [LOCK_NAME]
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


@pytest.mark.browser
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
        assert [path.name for path in (tmp_path / "out").iterdir()] == [LOCK_NAME]
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
    last = read_demonstration(tmp_path / "out" / "000_bad_live.parquet").samples.iloc[-1]
    lean = R_HV.inverse() @ from_rotation_vector(last["angle"] * last[["ax", "ay", "az"]].to_numpy(dtype=float)).col(2)
    assert lean[0] > np.sin(np.radians(0.8))  # to the right
    assert abs(lean[1]) < 0.1 * lean[0]
