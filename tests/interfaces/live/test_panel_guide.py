"""The guide of the first demonstration, in a real browser."""

import time

import pytest
import yaml
from selenium.webdriver.common.keys import Keys

from skill.data.demonstration import read_demonstration
from tests.interfaces.live.live_session import ROOT, live, press, text_of, wait_for_text
from tests.interfaces.live.panel_page import DESKTOP, LIMIT, contact, open_panel, readings

pytestmark = pytest.mark.slow
SCENARIO = ROOT / "models" / "scenarios" / "live.yaml"
CAPS = {"←": Keys.ARROW_LEFT, "→": Keys.ARROW_RIGHT, "↑": Keys.ARROW_UP, "↓": Keys.ARROW_DOWN, "Space": " "}


@pytest.fixture(scope="module")
def panel():
    with open_panel() as panel:
        yield panel
        assert panel.page.errors() == []


def say(panel, *, phase, load=0.0, **options):
    """Feeds readings, a phase and a contact load."""
    panel.display.show_readings(**readings(**options))
    panel.feed(phase=phase, contact=contact(load))


@pytest.mark.browser
def test_the_guide_recognises_each_step_and_says_how_to_keep_the_demonstration(panel):
    panel.screen(*DESKTOP)
    say(panel, phase="ready", depth=-0.002, tilt=(2.0, -1.0))
    assert panel.is_shown("guide")  # at the first visit
    say(panel, phase="busy", depth=-0.002, tilt=(2.0, -1.0))
    assert not panel.is_shown("guide")
    say(panel, phase="ready", depth=-0.002, tilt=(2.0, -1.0))
    assert panel.hints() == ["Space"]
    say(panel, phase="recording", depth=-0.002, tilt=(2.0, -1.0))
    assert panel.hints() == ["W"]
    assert "until the tip of the peg touches" in panel.text("guide-text")
    say(panel, phase="recording", load=2.0, depth=0.0, tilt=(2.0, -1.0))
    assert "Level the peg" in panel.text("guide-text")
    assert panel.hints() == ["←", "↑"]
    say(panel, phase="recording", load=0.0, depth=0.0, tilt=(0.1, -1.0))
    assert panel.hints() == ["↑"]
    say(panel, phase="recording", load=0.0, depth=0.001, tilt=(0.1, 0.2))
    assert panel.text("guide-text") == "Feed in to the full depth: 23.7 mm to go."
    say(panel, phase="recording", load=0.9 * LIMIT, depth=0.01, tilt=(1.0, 0.1))
    assert "level the peg first, or retract a little" in panel.text("guide-text")
    assert panel.hints() == ["←", "S"]
    say(panel, phase="recording", load=0.9 * LIMIT, depth=0.01)
    assert panel.hints() == ["S"]
    say(panel, phase="verdict", depth=0.0247)
    assert panel.text("guide-text").startswith("Inserted. Keep it")
    assert panel.hints() == ["G", "B", "X"]
    say(panel, phase="ready")
    assert not panel.is_shown("guide")


@pytest.mark.nightly
@pytest.mark.browser
def test_whoever_follows_the_guide_inserts_a_tilted_peg_within_two_minutes(tmp_path):
    """A person who only does what the guide of a real session says, one press at a time.

    The two minutes are those of the demonstration: on a busy machine its time runs slower than the wall clock.
    """
    scenario = {**yaml.safe_load(SCENARIO.read_text()), "start": {"tilt": [0.0, 0.035]}}
    hints = "return [...document.getElementById('guide-keys').children].map(e => e.textContent)"
    with live(tmp_path, scenario) as session, session.page() as page:
        wait_for_text(page, "status", "ready: press Space")
        end = time.monotonic() + 500.0
        while not text_of(page, "guide-text").startswith("Inserted"):
            assert time.monotonic() < end, (text_of(page, "guide-text"), text_of(page, "status"))
            for cap in page.run(hints):
                press(page, CAPS.get(cap, cap.lower()))
        assert text_of(page, "status").startswith("inserted")
        assert 0.0 < float(text_of(page, "contact-peak").removesuffix(" N")) < 2 * LIMIT
        press(page, "g")
        session.wait_for("kept 000_good_live.parquet")
        wait_for_text(page, "status", "kept")
        assert page.run("return document.getElementById('guide').hidden")
    assert read_demonstration(tmp_path / "out" / "000_good_live.parquet").duration < 120.0
