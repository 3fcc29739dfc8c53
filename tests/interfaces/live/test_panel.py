"""The panel of the live page in a real browser, with values that the tests feed."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from selenium.webdriver.common.keys import Keys

from interfaces.live.display import NO_HAND, LiveDisplay
from interfaces.live.page import open_live_page
from interfaces.live.session import KEYS
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.operators.page_hand import PageInput
from systems.operators.person_frame import hand_pose
from tests.browser import open_page
from tests.interfaces.live.live_session import FLAWS, press, text_of

pytestmark = [pytest.mark.slow, pytest.mark.browser]
LIMIT = 40.0  # of the force guard, N
SKILL = {
    "state": "two-point contact",
    "colour": "#E69F00",
    "known": False,
    "feed": -0.01,
    "turn": 0.05,
    "tilt": {"right": 1.0, "away": 1.0},
    "turned": {"right": 0.2, "away": 0.1},
}
# Gamepads by their place in the browser's list; `effects` has [place, what it was asked].
PADS = """
  window.effects = [];
  const answer = place => place === 3 ? Promise.reject(new Error("disconnected")) : Promise.resolve();
  const pad = place => ({index: place, connected: true, axes: [0, 0, 0, 0], buttons: [], vibrationActuator: {
    playEffect: (kind, effect) => (effects.push([place, {kind, ...effect}]), answer(place)),
    reset: () => (effects.push([place, "reset"]), answer(place)),
  }});
  navigator.getGamepads = () => places.map(place => place === null ? null : pads[place] ??= pad(place));
  window.pads = {};
  window.places = [];
"""


class Panel:
    """An open live page."""

    def __init__(self, live, display, page):
        self.live, self.display, self.page, self.fed = live, display, page, 0

    def feed(self, **values):
        """Changes values, and waits until the browser has received them."""
        self.fed += 1
        self.live.show(**values, kept=self.fed)  # a value that changes every time
        self.page.wait(f"document.getElementById('kept').textContent === '{self.fed}'")

    def text(self, name):
        return text_of(self.page, name)

    def is_shown(self, name):
        return self.page.run("return document.getElementById(arguments[0]).getClientRects().length > 0", name)

    def hints(self):
        """The keys that the guide shows."""
        return self.page.run("return [...document.getElementById('guide-keys').children].map(e => e.textContent)")

    def read(self, *, depth=0.0, tilt=(0.0, 0.0)):
        """Shows readings of a peg at a depth (m), with a tilt to the right and away, degrees."""
        X_HP = hand_pose(np.array([depth, *np.radians(tilt), 0.0, 0.0]))
        wrench = np.array([0.012, 0.02, 0.0, 1.0, 2.0, 12.0])
        probe = replace(NO_HAND, wrench=wrench, load=0.8, energy=0.0123, min_energy=-0.0012, late=1234, ticks=54321)
        counts = {"kept": 0, "late_steps": 12, "steps": 12345}
        self.display.show_readings(X_HP, depth=depth, full_depth=0.0247, rate=0.98, probe=probe, **counts)


def contact(load, *, peak=None, held=False):
    return {"load": load, "limit": LIMIT, "peak": load if peak is None else peak, "held": held}


@pytest.fixture(scope="module")
def panel():
    """The page at the start of a demonstration."""
    live = open_live_page()
    try:
        scenario = resolve_scenario(load_scenario("live"), seed=0, stream=LIVE_STREAM)
        for label, key in KEYS.items():
            live.controls.AddButton(label, key)
        PageInput(live.controls, lambda wanted: None).start(RigidTransform([0.0, 0.0, scenario.start.height]))
        display = LiveDisplay(live)
        display.draw_start(scenario)
        with open_page(live.address, size=(1280, 860), flags=()) as page:
            metrics = {"width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": False}
            page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
            page.wait("Object.keys(viewer.keydown_callbacks).length > 15 && document.readyState === 'complete'")
            page.run(PADS)
            panel = Panel(live, display, page)
            panel.read(depth=0.012, tilt=(1.5, 1.0))
            assert panel.is_shown("guide")  # at the first visit
            panel.feed(status="recording: G keep as good, B keep as bad, X discard", phase="recording")
            yield panel
            assert page.errors() == []
    finally:
        live.close()


def say(panel, *, phase, load=0.0, **options):
    """Feeds readings, a phase and a contact load."""
    panel.read(**options)
    panel.feed(phase=phase, contact=contact(load))


def test_the_guide_recognises_each_step_and_says_how_to_keep_the_demonstration(panel):
    panel.page.run("document.getElementById('guide-show').click()")
    say(panel, phase="ready", depth=-0.002, tilt=(2.0, -1.0))
    assert panel.is_shown("guide")
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


def test_the_contact_load_is_shown_beside_the_limit_of_the_rig(panel):
    panel.feed(contact=contact(10.0, peak=25.0))
    assert [panel.text(f"contact-{name}") for name in ("load", "peak", "limit")] == ["10.0 N", "25.0 N", "40 N"]
    assert "as the rig's guard sees it" in panel.text("contact")
    left = "return parseFloat(document.getElementById(arguments[0]).style[arguments[1]])"
    fill, peak, limit = (
        panel.page.run(left, f"contact-{name}", side)
        for name, side in (("fill", "width"), ("peak-mark", "left"), ("limit-mark", "left"))
    )
    assert fill / limit == pytest.approx(10 / 40)
    assert peak / limit == pytest.approx(25 / 40)
    assert limit == pytest.approx(80.0)
    assert panel.text("contact-note").strip() == ""
    panel.feed(contact=contact(16.0, held=True))
    assert panel.text("contact-note") == "the rig would slow the feed"
    panel.feed(contact=contact(40.1, held=True))
    assert panel.text("contact-note") == "the rig would stop here"
    colour = "return getComputedStyle(document.getElementById(arguments[0])).color"
    for name in ("contact-load", "contact-peak"):
        assert panel.page.run(colour, name) == "rgb(197, 20, 27)"
    panel.feed(contact=contact(500.0, held=True))
    assert panel.page.run(left, "contact-fill", "width") == 100.0
    panel.feed(contact=None)
    assert not panel.is_shown("contact")


def test_no_part_lies_over_another_and_no_reading_is_cut_off(panel):
    press(panel.page, "h")
    for guided in (True, False):
        for values in (
            {"skill": None, "contact": None},
            {"skill": None, "contact": contact(123.4, peak=234.5)},
            {"skill": SKILL, "contact": contact(31.2, held=True)},
        ):
            panel.feed(**values)
            assert panel.is_shown("guide") is guided
            assert panel.page.run(FLAWS) == [], (guided, values)
        press(panel.page, Keys.ESCAPE)
    panel.feed(skill=None, contact=None)


@pytest.mark.parametrize(("rate", "percent"), [(0.06, 6), (0.62, 62), (0.93, 93)])
def test_the_page_warns_in_large_letters_while_it_is_slower_than_real_time(panel, rate, percent):
    for phase, values, warns in (
        ("recording", {"rate": rate}, True),
        ("recording", {"rate": 0.97}, False),  # it has recovered
        ("verdict", {"rate": rate}, False),
        ("ready", {"rate": 0.0, "pace": 1.3}, False),
        ("ready", {"rate": 0.0, "pace": rate}, True),  # before it begins
    ):
        panel.feed(phase=phase, **values)
        assert panel.is_shown("slow") is warns
        assert not warns or panel.text("slow").startswith(f"SLOW: {percent} % of real time")
        assert not warns or panel.page.run(FLAWS) == []
    size = "return Number.parseFloat(getComputedStyle(document.querySelector(arguments[0])).fontSize)"
    assert panel.page.run(size, "#slow b") >= 1.5 * panel.page.run(size, "#status")
    panel.feed(phase="ready", rate=1.0, pace=1.3)


@pytest.mark.nightly
def test_without_a_graphics_card_pictures_are_coarser(panel):
    panel.page.run("""
      const render = viewer.render;
      viewer.render = () => {
        const end = performance.now() + 40;
        while (performance.now() < end);
        render.call(viewer);
      };
      const moving = setInterval(() => viewer.set_dirty(), 5);
      window.rest = () => { clearInterval(moving); viewer.render = render; };
    """)
    panel.page.wait("viewer.renderer.getPixelRatio() < 0.9", timeout=40.0)
    ratio, width = panel.page.run("rest(); return [viewer.renderer.getPixelRatio(), viewer.renderer.domElement.width]")
    assert width == pytest.approx(1280 * ratio, abs=1.0)


def test_a_trial_on_the_rig_shows_nothing_of_a_hand(panel):
    parts = "[...document.querySelectorAll('.of-hand, #controls .cr.number')]"
    shown = f"return {parts}.filter(e => e.getClientRects().length).length"
    panel.feed(contact=contact(16.0, held=True), skill=SKILL)
    assert panel.page.run(shown) == panel.page.run(f"return {parts}.length") >= 11  # five are sliders
    title = "return document.querySelector('#skill h2').innerText"
    assert panel.page.run(title) == "the skill sees, and would do"
    panel.feed(hand=False)
    assert panel.page.run(shown) == 0
    assert panel.page.run(title) == "the skill sees, and does"
    assert panel.text("contact-note") == "the rig slows the feed"
    panel.feed(hand=True)
    assert panel.page.run(shown) >= 11


def effects(panel, places, *loads, **values):
    """What the gamepads are asked while the contact loads, N, follow each other."""
    panel.feed(contact=None, phase="recording", motion=True, hand=True)
    panel.page.run("[window.places, window.effects] = [arguments[0], []]", places)
    for load in loads:
        panel.feed(contact=contact(load), **values)
        panel.page.run("const end = performance.now() + 60; while (performance.now() < end);")
    return panel.page.run("return effects")


def test_the_rumble_follows_the_share_of_the_limit_and_ends_without_contact_or_demonstration(panel):
    found = effects(panel, [None, 1], 0.4, 0.25 * LIMIT, LIMIT, 3 * LIMIT, 0.0)
    assert [place for place, _ in found] == [1, 1, 1, 1]
    assert found[-1] == [1, "reset"]
    asked = [effect for _, effect in found[:-1]]
    assert {(effect["kind"], effect["duration"]) for effect in asked} == {("dual-rumble", 200)}
    assert [effect["strongMagnitude"] for effect in asked] == pytest.approx([0.25, 1.0, 1.0])
    assert [effect["weakMagnitude"] for effect in asked] == pytest.approx([0.325, 1.0, 1.0])
    for values in ({"phase": "verdict"}, {"motion": False}, {"hand": False}):
        assert effects(panel, [0], LIMIT, LIMIT, **values) == []
    assert effects(panel, [3], LIMIT, LIMIT, 0.0)[-1] == [3, "reset"]  # disconnected while it rumbles
