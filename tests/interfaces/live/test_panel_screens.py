"""The panel in a real browser: its gauges, its legibility on a screen, and pictures a second."""

import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

from systems.operators.person_frame import hand_pose
from tests.interfaces.live.live_session import press
from tests.interfaces.live.panel_page import DESKTOP, FLAWS, SKILL, contact, open_panel, readings

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def panel():
    with open_panel() as panel:
        panel.display.show_readings(**readings(depth=0.012, tilt=(1.5, 1.0)))
        panel.feed(status="recording: G keep as good, B keep as bad, X discard", phase="recording")
        yield panel
        assert panel.page.errors() == []


def style(panel, name, property_):
    return panel.page.run(
        "return getComputedStyle(document.getElementById(arguments[0]))[arguments[1]]", name, property_
    )


@pytest.mark.browser
def test_the_contact_load_is_shown_beside_the_limit_of_the_rig(panel):
    panel.screen(*DESKTOP)
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
    assert style(panel, "contact-load", "color") == style(panel, "contact-peak", "color") == "rgb(197, 20, 27)"
    panel.feed(contact=contact(500.0, held=True))
    assert panel.page.run(left, "contact-fill", "width") == 100.0
    panel.feed(contact=None)
    assert not panel.is_shown("contact")


@pytest.mark.browser
def test_no_part_lies_over_another_and_no_reading_is_cut_off(panel):
    panel.screen(*DESKTOP)
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


@pytest.mark.browser
@pytest.mark.parametrize(("rate", "percent"), [(0.06, 6), (0.62, 62), (0.93, 93)])
def test_the_page_warns_in_large_letters_while_it_is_slower_than_real_time(panel, rate, percent):
    panel.screen(*DESKTOP)
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


@contextmanager
def moving_peg(panel):
    """Moves the peg and the arrows 60 times a second."""
    stop = threading.Event()

    def move():
        start = due = time.monotonic()
        while not stop.is_set():
            t = time.monotonic() - start
            X = hand_pose(np.array([0.005 + 0.005 * np.sin(t), 0.03 * np.sin(2 * t), 0.02 * np.cos(3 * t), 0.0, 0.0]))
            panel.display.move_peg(X)
            panel.display.move_hand(X)
            tip = X.translation()
            force = np.array([0.0, 0.0, 4.0 + 3.0 * np.sin(t)])
            panel.display.draw_forces(tip, force, load=0.2, contact=(tip, 3.0 * force))
            due += 1 / 60
            time.sleep(max(0.0, due - time.monotonic()))

    thread = threading.Thread(target=move)
    thread.start()
    yield
    stop.set()
    thread.join()


@pytest.mark.nightly
@pytest.mark.browser
def test_without_a_graphics_card_pictures_are_coarser(panel):
    panel.screen(*DESKTOP)
    with moving_peg(panel):
        panel.page.wait("viewer.renderer.getPixelRatio() < 0.9", timeout=40.0)
        assert 0 < int(panel.text("pictures")) < 70
        ratio, width = panel.page.run("return [viewer.renderer.getPixelRatio(), viewer.renderer.domElement.width]")
    assert width == pytest.approx(1280 * ratio, abs=1.0)


@pytest.mark.browser
def test_a_trial_on_the_rig_shows_nothing_of_a_hand(panel):
    panel.screen(*DESKTOP)
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
