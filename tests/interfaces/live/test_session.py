"""Live sessions: a real page in a real browser, and the session in a process of its own."""

import os
import re
import resource
import time
from dataclasses import astuple
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import umsgpack
import yaml
from pydrake.math import RigidTransform

import interfaces.live.session
from experiments.outputs.folder_lock import LOCK_NAME
from experiments.served_run import Deadlines
from interfaces.live.controls import LiveControls
from interfaces.live.display import SATURATED, ContactLoad
from interfaces.live.messages import Outbox
from interfaces.live.page import LivePage, open_live_page
from interfaces.live.session import (
    BAD,
    DISCARD,
    GOOD,
    QUIT,
    READY,
    RECORDING,
    START,
    VERDICT,
    LiveSession,
    live_scenario,
    next_number,
)
from interfaces.live.viewer_scene import ViewerScene
from interfaces.terminal import write_json
from models.scenario import dump_scenario, load_scenario
from skill.data.demonstration import COLUMNS, Demonstration, read_demonstration
from skill.data.outcome import Ending, Outcome
from skill.data.tables import TooShortError
from skill.practice.policy_observer import PolicyObserver
from systems.math.rotation import from_rotation_vector
from systems.operators.person_frame import R_HV
from tests.browser import blankness
from tests.interfaces.live.live_session import QUICK, drag, live, press, row, text_of, wait_for_text
from tests.trajectories import make_demonstration

PICTURES = os.environ.get("LIVE_PICTURES")  # folder in which the screenshots are kept, if set
JAMS = {**QUICK, "geometry": {**QUICK["geometry"], "hole_depth": 0.01}, "start": {"height": 5e-4, "tilt": [0.055, 0.0]}}


@pytest.fixture
def session(tmp_path):
    """Makes sessions in this process without an open page; ``messages`` of a session lists what it told."""
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(QUICK))
    page = open_live_page()

    def make(**options):
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


def test_session_without_an_open_page_gives_its_address_and_ends(session, monkeypatch):
    monkeypatch.setattr(interfaces.live.session, "ABSENCE_NOTICE", 0.1)
    dut = session(absence_limit=0.3)
    assert dut.run() == []
    assert any(
        re.match(r"no page is open: open http://127\.0\.0\.1:\d+/[\w-]{32}/ to continue", line) for line in dut.messages
    )
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


@pytest.mark.slow
def test_a_demonstration_with_a_device_is_kept(session, monkeypatch):
    """The loopback device inserts the peg; the verdict is good."""
    dut = session(driver="loopback")
    press_in_turn(monkeypatch, dut, [START, GOOD, QUIT])
    (path,) = dut.run()
    found = read_demonstration(path)
    assert found.good
    assert found.outcome == Outcome.INSERTED
    assert found.metadata["lowest_probe_energy_J"] < 0.0  # of the servo's observer


@pytest.fixture
def wall(monkeypatch):
    """A wall clock that only moves when the test or a sleep moves it; ``sleeps`` lists the sleeps."""
    wall = SimpleNamespace(now=1000.0, sleeps=[])

    def sleep(seconds):
        wall.sleeps.append(seconds)
        wall.now += seconds

    clock = SimpleNamespace(monotonic=lambda: wall.now, sleep=sleep)
    monkeypatch.setattr(interfaces.live.session, "time", clock)
    return wall


class Page:
    """Replaces the page; keeps the values that it shows, and serves nothing."""

    address = "http://localhost:1"

    def __init__(self):
        self.values, self.is_shown, self.refused = {}, True, None
        outbox = Outbox()
        self.scene, self.controls = ViewerScene(outbox), LiveControls(outbox)

    def refusals(self):
        return self.refused

    def show(self, **values):
        self.values |= values


@pytest.fixture
def quiet(tmp_path, monkeypatch):
    """A session whose page is open and whose buttons click when ``clicks`` lists them; the session takes the first."""
    (tmp_path / "quick.yaml").write_text(yaml.safe_dump(QUICK))
    messages, page, clicks = [], Page(), []
    dut = LiveSession(
        start_of=lambda number: live_scenario(load_scenario(str(tmp_path / "quick.yaml")), seed=0, number=number),
        out=tmp_path,
        page=page,
        announce=messages.append,
    )
    dut.messages, dut.values, dut.clicks, dut.page = messages, page.values, clicks, page
    monkeypatch.setattr(LiveControls, "clicked", lambda _, label: clicks[:1] == [label] and bool(clicks.pop(0)))
    monkeypatch.setattr(LiveControls, "any_waiting", lambda _, *labels: clicks[:1] != [] and clicks[0] in labels)
    servo = SimpleNamespace(close=lambda: None, move_hand=lambda wanted: None)
    monkeypatch.setattr(interfaces.live.session, "ServoClient", lambda driver: servo)
    monkeypatch.setattr(LiveControls, "forget_clicks", lambda _, *labels: clicks.clear())
    return dut


def test_before_a_demonstration_the_panel_shows_zeros_and_the_depth_of_the_start(quiet, monkeypatch):
    drawn = []
    monkeypatch.setattr(quiet._display, "draw_forces", lambda *args, **options: drawn.append((args, options)))
    quiet.kept = [Path("a"), Path("b")]
    quiet._prepare_next()
    for name in ("force", "moment", "load", "rate", "energy", "min_energy"):
        assert quiet.values[name] == 0.0, name
    assert set(quiet.values["deadlines"].values()) == {0}
    assert quiet.values["depth"]["tip"] == pytest.approx(-5e-4)  # half a millimetre above the mouth
    assert 0.003 < quiet.values["depth"]["full"] < 0.004  # of a hole of 4 mm
    assert quiet.values["kept"] == 2
    ((tip, force), options) = drawn[0]
    np.testing.assert_allclose(tip, [0.0, 0.0, 5e-4], atol=1e-9)
    np.testing.assert_array_equal(force, np.zeros(3))
    assert options == {"load": 0.0, "contact": None}


def test_a_closed_page_is_noticed_after_five_seconds_and_ends_the_session_after_two_minutes(quiet, wall):
    quiet.page.is_shown = False
    start, log = wall.now, {}
    while quiet._has_left() is False:
        wall.now += 0.5
        for message in quiet.messages:
            log.setdefault(message, wall.now - start)
        assert wall.now < start + 200.0
    assert log["no page is open: open http://localhost:1 to continue"] == 6.0  # said at 5.5 s, recorded after it
    assert quiet.messages.count("no page is open: open http://localhost:1 to continue") == 1
    assert quiet.messages[-1] == "the page stayed closed: session over"
    assert wall.now - start == 120.5


def test_an_open_page_ends_the_absence(quiet, wall):
    for is_open, seconds in ((False, 100.0), (True, 0.0), (False, 100.0), (False, 0.0)):
        quiet.page.is_shown = is_open
        assert quiet._has_left() is False
        wall.now += seconds
    assert (
        len([m for m in quiet.messages if m.startswith("no page is open")]) == 1
    )  # the second absence has lasted 100 s
    quiet.clicks.append(QUIT)
    assert quiet._has_left() is True
    assert quiet.messages[-1] == "session over"


@pytest.mark.parametrize("refused", [None, "refused or ignored: junk frame 5"])
def test_what_was_refused_is_told_at_the_end(quiet, refused):
    quiet.page.refused = refused
    quiet.clicks.append(QUIT)
    quiet.run()
    assert quiet.messages[-1] == (refused or "session over")


class Run:
    """Replaces a demonstration of which so many samples are recorded."""

    def __init__(self, *, samples=1):
        self.samples, self.asked = samples, []
        self.simulator = SimpleNamespace(get_context=lambda: "context")

    def demonstration(self, ending, **options):
        self.asked.append(options)
        if self.samples < 1:
            raise TooShortError("demonstration: found 1 samples, expected at least 2")
        return SimpleNamespace(
            reason=ending.outcome.value, good=options.get("good"), metadata={"number": options["number"]}
        )


class Environment:
    """Replaces a virtual environment in which a peg of 10 mm pushes at a depth of 3 mm."""

    load = 12.0  # N

    def peg_pose(self, context):
        assert context == "context"
        return RigidTransform([0.0, 0.0, -0.003])

    def contact_force(self, context):
        return np.array([0.0, 0.0, -0.001]), np.array([0.0, 0.0, 1.0])

    def last_sample(self, context):
        return dict.fromkeys(COLUMNS, 0.0) | {"fz": self.load}


PROBE = SimpleNamespace(
    X_HD=RigidTransform([0.0, 0.0, -0.004]),
    wrench=np.array([1.0, 2.0, 2.0, 3.0, 4.0, 12.0]),
    load=0.25,
    energy=0.5,
    min_energy=-0.25,
)


class Live:
    """Replaces a served demonstration: it ends after a number of contact steps of 4 ms, which cost wall-clock time."""

    def __init__(self, wall, *, steps=10**9, cost=0.004):
        self.wall, self.number, self.cost, self.steps = wall, steps, cost, 0
        self.run, self.environment, self.probe = Run(), Environment(), PROBE

    @property
    def time(self):
        return 0.004 * self.steps

    @property
    def deadlines(self):
        return Deadlines(1, self.steps, 2, 4 * self.steps)

    def step(self):
        self.steps += 1
        self.wall.now += self.cost
        return Ending(Outcome.INSERTED) if self.steps >= self.number else None


def simulate(session, live):
    resolved = SimpleNamespace(
        contact=SimpleNamespace(time_step=0.004),
        recorder=SimpleNamespace(period=0.02),
        geometry=SimpleNamespace(peg_radius=0.01),
        controller=SimpleNamespace(guard=SimpleNamespace(force_limit=40.0, soft_force=10.0)),
        full_depth=0.02,
    )
    return session._simulate(live, resolved)


def test_pictures_are_drawn_at_most_60_and_readings_10_times_a_second(quiet, wall, monkeypatch):
    drawn, read = [], []
    monkeypatch.setattr(quiet._display, "draw_forces", lambda *args, **options: drawn.append((wall.now, args, options)))
    monkeypatch.setattr(quiet._display, "show_readings", lambda readings: read.append((wall.now, readings)))
    live = Live(wall, steps=251)
    assert simulate(quiet, live) == Ending(Outcome.INSERTED)
    assert wall.now == pytest.approx(1001.004)
    # Both are looked at every 4 ms: drawn every 20 ms, read every 100 or 104 ms, and at the end.
    assert np.diff([now for now, *_ in drawn][:-1]) == pytest.approx(0.02)
    gaps = np.diff([1000.0, *[now for now, _ in read][:-1]])
    assert ((gaps > 0.0999) & (gaps < 0.1041)).all()
    for now, readings in read:
        assert readings.rate == pytest.approx(1.0)
        steps = round((now - 1000.0) * 250)
        assert astuple(readings.deadlines) == (1, steps, 2, 4 * steps)
    assert [drawn[-1][0], read[-1][0]] == pytest.approx([1001.004] * 2)
    _, (tip, force), options = drawn[-1]
    np.testing.assert_array_equal([tip, force], [[0.0, 0.0, -0.003], [3.0, 4.0, 12.0]])
    assert options["load"] == 0.25
    np.testing.assert_array_equal(options["contact"], [[0.0, 0.0, -0.001], [0.0, 0.0, 1.0]])


def test_the_panel_shows_the_depth_and_the_energy_and_half_speed_as_one_half(quiet, wall):
    """Steps of 4 ms that cost 8 ms run at half the speed."""
    simulate(quiet, Live(wall, steps=75, cost=0.008))
    assert quiet.values["rate"] == pytest.approx(0.5)
    assert quiet.values["deadlines"] == {"late_steps": 1, "steps": 75, "late_ticks": 2, "ticks": 300}
    assert quiet.values["depth"] == {"tip": 0.003, "full": 0.02}
    assert [quiet.values[k] for k in ("force", "moment", "load")] == pytest.approx([13.0, 3.0, 0.25])
    assert [quiet.values[k] for k in ("energy", "min_energy", "kept")] == [0.5, -0.25, 0]


def test_the_contact_load_is_shown_for_every_sample(quiet, wall, monkeypatch):
    shown = []
    monkeypatch.setattr(quiet._display, "show_contact_load", lambda load: shown.append((wall.now, load.values())))
    simulate(quiet, Live(wall, steps=50))
    assert np.diff([now for now, _ in shown]) == pytest.approx(0.02)
    assert shown[-1][1] == {"load": 12.0, "limit": 40.0, "peak": 12.0, "held": True}


def test_the_phases_of_a_demonstration_are_shown(quiet, wall):
    quiet._say("ready", READY)
    assert quiet.values["phase"] == READY
    simulate(quiet, Live(wall, steps=5))
    assert quiet.values["phase"] == RECORDING
    quiet.clicks[:] = [QUIT]
    quiet._judge(Run(), Ending(Outcome.INSERTED), 3)
    assert quiet.values["phase"] == VERDICT
    verdict(quiet, DISCARD)
    assert quiet.values["phase"] == READY


def test_a_button_or_a_closed_page_ends_a_demonstration(quiet, wall):
    quiet.clicks.append(START)  # has no meaning now
    assert simulate(quiet, Live(wall, steps=30)) == Ending(Outcome.INSERTED)
    quiet.clicks[:] = [GOOD]
    live = Live(wall)
    assert simulate(quiet, live) == Ending(Outcome.STOPPED)
    assert live.steps == 1
    assert quiet.clicks == [GOOD]  # it is also the verdict
    quiet.clicks.clear()
    quiet.page.is_shown = False
    assert simulate(quiet, Live(wall)) is None
    assert wall.now < 1000.5


def verdict(session, *clicks, samples=1):
    """Whether the person quits, and the demonstrations that are asked for."""
    run = Run(samples=samples)
    session.clicks[:] = clicks
    return session._judge(run, Ending(Outcome.INSERTED), 3), [options.get("good") for options in run.asked[1:]]


def test_the_person_judges_a_demonstration(quiet, wall, monkeypatch):
    written = []
    monkeypatch.setattr(
        interfaces.live.session, "write_demonstration", lambda d, path: written.append((d.good, path.name))
    )
    assert verdict(quiet, GOOD) == (False, [True])
    assert verdict(quiet, BAD) == (False, [False])
    assert written == [(True, "003_good_live.parquet"), (False, "003_bad_live.parquet")]
    assert [path.name for path in quiet.kept] == [name for _, name in written]
    assert verdict(quiet, DISCARD) == (False, [])
    assert quiet.messages[-1] == "discarded: Space starts another"
    assert verdict(quiet, QUIT) == (True, [])
    quiet.page.is_shown = False
    assert verdict(quiet) == (False, [])
    assert quiet.messages[-1] == "the page was closed before a verdict: demonstration discarded"
    assert verdict(quiet, GOOD, samples=0) == (False, [])
    assert quiet.messages[-1] == "too short to keep; Space starts another"
    assert quiet.clicks == []
    assert len(written) == 2


def test_a_demonstration_that_is_refused_is_discarded_with_its_reason(quiet, wall):
    class Refused(Run):
        def demonstration(self, ending, **options):
            return Demonstration(make_demonstration().samples * 1e3, True, "inserted")

    quiet.clicks[:] = [GOOD]
    assert quiet._judge(Refused(), Ending(Outcome.INSERTED), 3) is False
    assert quiet.messages[-1].startswith("discarded: demonstration: column")
    assert quiet.messages[-1].endswith("; Space starts another")
    assert (quiet.clicks, quiet.kept) == ([], [])


def test_a_demonstration_that_cannot_be_written_can_be_kept_again_or_discarded(quiet, wall, monkeypatch):
    fails = iter([True, False, True])

    def write(demonstration, path):
        if next(fails):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(interfaces.live.session, "write_demonstration", write)
    assert verdict(quiet, GOOD, BAD) == (False, [True, False])
    assert [path.name for path in quiet.kept] == ["003_bad_live.parquet"]
    assert verdict(quiet, GOOD, DISCARD) == (False, [True])
    assert "not kept, No space left on device: make room and press again, or X to discard" in quiet.messages
    assert len(quiet.kept) == 1


def test_a_gamepad_is_announced_once_when_it_comes_and_once_when_it_goes(quiet):
    quiet.messages.clear()
    for axes in ([], [0.0], [0.0, 0.0], [], []):
        pad = {"index": 0, "axes": axes} if axes else {}
        assert quiet.page.controls.receive(umsgpack.packb({"type": "gamepad", "name": "", "gamepad": pad}), browser=1)
        quiet._watch_gamepad()
    assert quiet.messages == [
        "gamepad: left stick tilts, right stick feeds",
        "gamepad disconnected: use sliders and keys",
    ]


def test_recordings_are_numbered_after_the_largest_number(tmp_path):
    assert next_number(tmp_path) == 0
    for name in ("004_good_live.parquet", "017_bad_live.parquet", "099_note.txt", "1_x.parquet", "20_x.parquet"):
        (tmp_path / name).touch()
    assert next_number(tmp_path) == 18
    (tmp_path / "1000_good_live.parquet").touch()
    assert next_number(tmp_path) == 1001  # not 100, which would replace a recording later


def keep_picture(page, name):
    return page.screenshot(Path(PICTURES) / f"{name}.png" if PICTURES else None)


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
        ready = keep_picture(page, "ready")  # before anything is pressed: a large peg and block in the middle
        assert 0.02 < orange(ready[:, 300:800]) < 0.6
        assert blankness(ready).colours > 20
        assert row(page, "depth").is_displayed()  # the controls are open from the start
        assert row(page, "start (Space)").is_displayed()
        for name in ("depth mm", "tilt right", "keep as good (G)", "quit (Q)"):
            assert page.run("return document.body.innerText").count(name) == 1  # each action stands once
        assert text_of(page, "depth") == "-0.50 of 3.7 mm"
        pictures = [ready]
        for key in "231":
            press(page, key)
            time.sleep(1.0)  # a scene that stands still is drawn with all pixels
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
        assert 0 <= late_steps <= steps
        assert 0 <= late_ticks <= ticks
        # the last step waited for the end of tick 4 (steps - 1); neither the first tick nor that one counts
        assert ticks >= 4 * (steps - 1) - 2 > 0
        assert float(text_of(page, "rate").split()[0]) > 0
        assert float(text_of(page, "energy").split()[0]) > 0
        assert float(text_of(page, "min_energy").split()[0]) <= 0
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
        assert page.errors() == [] or all("WebSocket" in e for e in page.errors())  # the scene's server has gone
    session.wait_for("1 demonstrations kept")
    example = read_demonstration(tmp_path / "out" / "000_good_live.parquet")
    assert example.good
    assert example.outcome == "inserted"
    assert example.samples["z"].iloc[-1] < -0.003
    assert example.metadata["habit"] == "live"
    assert example.metadata["lowest_probe_energy_J"] <= 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["000_good_live.parquet", "index.json"]


@pytest.mark.browser
@pytest.mark.slow
def test_a_person_begins_in_the_pose_that_a_skill_asked_to_be_shown(tmp_path):
    asked = {"trial": 5, "time": 1.0, "depth": 0.0018, "tilt": [0.02, 0.0], "load": 12.0, "state": "two-point contact"}
    write_json(tmp_path / "asked.json", [asked | {"pivot_height": -0.001, "friction": 0.2}])
    with live(tmp_path, options=("--asked", str(tmp_path / "asked.json"))) as session, session.page() as page:
        wait_for_text(page, "status", "ready: press Space")
        assert text_of(page, "depth") == "1.50 of 3.7 mm"  # 0.3 mm above
        press(page, " ")
        session.wait_for("recording:")
        time.sleep(0.5)
        press(page, "b")
        session.wait_for("keep as good")
        press(page, "b")
        session.wait_for("kept 000_bad_live.parquet")
        press(page, "q")
    first = read_demonstration(tmp_path / "out" / "000_bad_live.parquet").samples.iloc[0]
    assert first["z"] == pytest.approx(-0.0015, abs=1e-4)
    assert first["angle"] == pytest.approx(0.02, abs=2e-3)


def test_a_sample_of_a_run_that_has_diverged_is_not_judged(quiet, skill):
    sample = dict.fromkeys(COLUMNS, 0.0)
    environment = SimpleNamespace(last_sample=lambda _: sample, peg_pose=lambda _: RigidTransform())
    run = SimpleNamespace(simulator=SimpleNamespace(get_context=lambda: "context"))
    live_run = SimpleNamespace(environment=environment, run=run)
    observer, load = PolicyObserver(skill), ContactLoad(load_scenario("live"))
    sample["fz"] = np.nan
    quiet._show_sample(live_run, load, observer)
    assert "skill" not in quiet.values
    sample["fz"] = 0.0
    quiet._show_sample(live_run, load, observer)
    assert quiet.values["skill"]["state"] in skill.state_names()


@pytest.mark.browser
@pytest.mark.slow
def test_a_skill_names_the_contact_states_and_shows_what_it_would_do(tmp_path, quick_scenario, skill, skill_file):
    """The script pushes a tilted peg onto the chamfer: the skill sees another contact state than in free motion."""
    quick_scenario.start.tilt = [0.035, 0.0]
    scenario = yaml.safe_load(dump_scenario(quick_scenario)) | {"recorder": {"time_limit": 60.0}}
    with live(tmp_path, scenario, options=("--observer", str(skill_file))) as session, session.page() as page:
        wait_for_text(page, "status", "ready: press Space")
        assert page.run("return document.getElementById('skill').hidden")
        press(page, " ")
        session.wait_for("recording:")
        seen, turns = set(), []
        for _ in range(15):
            press(page, "w", times=2, pause=0.1)
            seen.add(text_of(page, "skill-state").removesuffix(" (unlike any demonstration)"))
            turns.append(float(text_of(page, "skill-rate").removesuffix(" °/s")))
        keep_picture(page, "skill")
        assert not page.run("return document.getElementById('skill').hidden")
        assert page.run("return document.getElementById('skill-turn').getAttribute('visibility')") == "visible"
        press(page, "x")
        session.wait_for("discarded: Space starts another")
        wait_for_text(page, "status", "discarded")
        assert page.run("return document.getElementById('skill').hidden")
        press(page, "q")
    assert seen <= set(skill.state_names())
    assert len(seen) > 1
    assert max(turns) > 1.0  # it would level the peg


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
        assert session.process.poll() is None
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
    example = read_demonstration(tmp_path / "out" / "000_bad_live.parquet")
    assert not example.good
    last = example.samples.iloc[-1]
    lean = R_HV.inverse() @ from_rotation_vector(last["angle"] * last[["ax", "ay", "az"]].to_numpy(dtype=float)).col(2)
    assert lean[0] > np.sin(np.radians(0.8))  # to the right
    assert abs(lean[1]) < 0.1 * lean[0]
