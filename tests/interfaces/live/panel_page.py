"""The live page in a browser, with values that a test feeds; checks of what it shows on a screen."""

import time
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from pydrake.math import RigidTransform

from interfaces.live.display import NO_HAND, LiveDisplay
from interfaces.live.page import LivePage, open_live_page
from interfaces.live.session import KEYS
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.operators.page_hand import PageInput
from systems.operators.person_frame import hand_pose
from tests.browser import Page, open_page
from tests.interfaces.live.live_session import SIZE, text_of

DESKTOP = (1280, 720)  # width, height
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
# Parts of the page that lie over each other, over the peg or outside the window, and readings that are cut off.
FLAWS = """
  const box = e => e.getBoundingClientRect(), shown = e => e.offsetParent !== null || box(e).height > 0;
  const over = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const inside = (a, b) => a.left > b.left - 1 && a.right < b.right + 1 && a.top > b.top - 1 && a.bottom < b.bottom + 1;
  const page = {left: 0, top: 0, right: innerWidth, bottom: innerHeight};
  const found = [], ids = ["status", "slow", "card", "controls", "guide", "strip"];
  const parts = ids.map(id => document.getElementById(id)).filter(shown);
  parts.forEach((a, k) => {
    if (!inside(box(a), page)) found.push(a.id + " is partly outside the window");
    parts.slice(k + 1).forEach(b => over(box(a), box(b)) && found.push(a.id + " over " + b.id));
  });

  const peg = {left: 1e9, right: -1e9, top: 1e9, bottom: -1e9};
  viewer.scene_tree.find(["drake", "plant", "peg"]).object.traverse(mesh => {
    if (!mesh.isMesh) return;
    mesh.updateWorldMatrix(true, false);
    mesh.geometry.computeBoundingBox();
    const {min, max} = mesh.geometry.boundingBox;
    for (let corner = 0; corner < 8; corner += 1) {
      const end = axis => (corner >> "xyz".indexOf(axis) & 1 ? max : min)[axis];
      const point = viewer.camera.position.clone().set(end("x"), end("y"), end("z"));
      point.applyMatrix4(mesh.matrixWorld).project(viewer.camera);
      const x = (1 + point.x) / 2 * innerWidth, y = (1 - point.y) / 2 * innerHeight;
      Object.assign(peg, {left: Math.min(peg.left, x), right: Math.max(peg.right, x)});
      Object.assign(peg, {top: Math.min(peg.top, y), bottom: Math.max(peg.bottom, y)});
    }
  });
  if (peg.left > peg.right) found.push("no peg");
  for (const part of parts)
    if (part.parentElement.id !== "messages" && over(box(part), peg)) found.push(part.id + " over the peg");

  const readings = ["force", "moment", "depth", "gauge-text", "contact-load", "contact-peak", "contact-limit",
    "contact-note", "dial", "skill-state", "skill-feed", "skill-rate", "rate", "pictures", "kept", "status",
    "guide-show", "guide-text", "guide-skip"];
  for (const id of readings) {
    const element = document.getElementById(id), panel = element.closest(".panel");
    if (!shown(element)) continue;
    const text = document.createRange();
    text.selectNodeContents(element);
    if (!inside(box(text), box(panel))) found.push(id + " is cut off");
  }
  for (const element of document.querySelectorAll("#card td, .spread")) {
    const isCut = element.scrollWidth > element.clientWidth + 1;
    if (shown(element) && isCut) found.push(element.textContent + " is cut off");
  }
  return found;
"""


@dataclass
class Panel:
    """An open live page.

    Attributes:
        live: the page's side in Python.
        display: what it shows.
        page: the page in the browser.
        fed: how often values have been fed.
    """

    live: LivePage
    display: LiveDisplay
    page: Page
    fed: int = 0

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
        """The keys or touch controls that the guide shows."""
        return self.page.run("return [...document.getElementById('guide-keys').children].map(e => e.textContent)")

    def screen(self, width, height):
        """Changes the screen."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        self.page.wait(f"innerWidth === {width}")
        time.sleep(0.3)  # the picture follows


def readings(*, depth=0.0, tilt=(0.0, 0.0)):
    """Readings of a peg at a depth (m), with a tilt to the right and away, degrees."""
    X_HP = hand_pose(np.array([depth, *np.radians(tilt), 0.0, 0.0]))
    wrench = np.array([0.012, 0.02, 0.0, 1.0, 2.0, 12.0])
    probe = replace(NO_HAND, wrench=wrench, load=0.8, energy=0.0123, min_energy=-0.0012, late=1234, ticks=54321)
    steps = {"late_steps": 12, "steps": 12345}
    return {"X_HP": X_HP, "depth": depth, "full_depth": 0.0247, "rate": 0.98, "kept": 0, "probe": probe, **steps}


def contact(load, *, peak=None, held=False):
    return {"load": load, "limit": LIMIT, "peak": load if peak is None else peak, "held": held}


@contextmanager
def open_panel(*, flags=()):
    """Opens the page at the start of a demonstration, before any value of it has been sent."""
    live = open_live_page()
    try:
        scenario = resolve_scenario(load_scenario("live"), seed=0, stream=LIVE_STREAM)
        for label, key in KEYS.items():
            live.controls.AddButton(label, key)
        PageInput(live.controls, lambda wanted: None).start(RigidTransform([0.0, 0.0, scenario.start.height]))
        display = LiveDisplay(live)
        display.draw_start(scenario)
        display.draw_forces(np.zeros(3), np.zeros(3), load=0.0, contact=None)
        with open_page(live.address, size=SIZE, flags=flags) as page:
            page.wait("Object.keys(viewer.keydown_callbacks).length > 15 && document.readyState === 'complete'")
            yield Panel(live, display, page)
    finally:
        live.close()
