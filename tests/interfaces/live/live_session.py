"""Runs a live session in a process of its own, for tests that open its page in a browser."""

import os
import re
import resource
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import yaml

from tests.browser import open_page

ROOT = Path(__file__).resolve().parents[3]
SIZE = (1100, 760)
QUICK = {
    "geometry": {"hole_depth": 0.004, "peg_length": 0.02, "hole_radius": 0.0102, "facets": 32},
    "start": {"height": 5e-4, "tilt": [0.0, 0.0]},
    "contact": {"time_step": 0.004},
    "coupling": {"peg_inertia": 0.02, "angular_damping": 2.0},
    "recorder": {"time_limit": 60.0, "rough_force": 500.0},
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
    "contact-note", "dial", "skill-state", "skill-feed", "skill-rate", "rate", "kept", "status",
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

    def address(self):
        return self.wait_for(r"open (http\S+) in a browser").group(1)

    def page(self, size=SIZE):
        return open_page(self.address(), size=size, flags=())


@contextmanager
def live(tmp_path, scenario=QUICK, file_size=resource.RLIM_INFINITY, options=()):
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(scenario))
    command = ("haptic_skill", "record", "--live", "--out", tmp_path / "out", "--scenario", path, *options)
    with served(tmp_path, *command, file_size=file_size) as session:
        yield session


@contextmanager
def served(tmp_path, *command, file_size=resource.RLIM_INFINITY, cwd=ROOT):
    """Runs a command that opens a live page; its output is in the folder ``tmp_path``."""
    log = tmp_path / "log.txt"
    browser = tmp_path / "browser.sh"  # stands for the desktop's
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path / "opened.txt"}\n')
    browser.chmod(0o755)
    with log.open("w") as stream:
        process = subprocess.Popen(
            [sys.executable, "-m", *map(str, command)],
            cwd=cwd,
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
