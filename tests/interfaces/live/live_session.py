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
