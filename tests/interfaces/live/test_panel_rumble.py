"""A gamepad rumbles with the contact load: the panel in a real browser, with gamepads that note what they are asked."""

import pytest

from tests.interfaces.live.panel_page import LIMIT, contact, open_panel

pytestmark = [pytest.mark.slow, pytest.mark.browser]
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


@pytest.fixture(scope="module")
def panel():
    with open_panel() as panel:
        panel.page.run(PADS)
        yield panel
        assert panel.page.errors() == []


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
