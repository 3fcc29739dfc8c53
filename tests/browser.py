"""Opens a page in headless Chromium for tests, with access to console, screenshots, requests and scripts."""

from __future__ import annotations

import io
import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tests.headless_browser import headless_browser


@dataclass
class Page:
    """An open page.

    Attributes:
        driver: selenium's driver of the browser.
        severe: text of the console messages of level SEVERE so far.
    """

    driver: Any
    severe: list[str] = field(default_factory=list)

    def run(self, script: str, *arguments: Any) -> Any:
        """Runs the body of a JavaScript function in the page, and returns its result."""
        return self.driver.execute_script(script, *arguments)

    def wait(self, condition: str, timeout: float = 20.0) -> None:
        """Waits until a JavaScript expression is true.

        Raises:
            AssertionError: after ``timeout`` s; the message contains the errors of the console.
        """
        end = time.monotonic() + timeout
        while not self.run(f"return Boolean({condition})"):
            if time.monotonic() > end:
                raise AssertionError(f"'{condition}' is not true after {timeout} s; console: {self.errors()}")
            time.sleep(0.05)

    def errors(self) -> list[str]:
        """Returns the console messages of level SEVERE since the page was opened."""
        self.severe += [e["message"] for e in self.driver.get_log("browser") if e["level"] == "SEVERE"]
        return list(self.severe)

    def requests(self) -> list[str]:
        """Returns the addresses that the page has requested from outside itself; embedded data do not count."""
        addresses = []
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                addresses.append(message["params"]["request"]["url"])
        own = self.driver.current_url.split("#")[0]
        embedded = ("data:", "blob:", "chrome:", "about:")  # a starting browser loads chrome: and about: pages
        return [a for a in addresses if not a.startswith(embedded) and a.split("#")[0] != own]

    def screenshot(self, path: Path | None = None) -> NDArray[np.uint8]:
        """Returns a picture of the page (height, width, 3); also writes it to ``path`` if given."""
        png = self.driver.get_screenshot_as_png()
        if path is not None:
            Path(path).write_bytes(png)
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


shared = ExitStack()
"""Closes the browser that the pages of this process share, if one was started; see tests/conftest.py."""


@cache
def shared_browser() -> Any:
    """Starts the browser in which each page is a tab."""
    return shared.enter_context(headless_browser("about:blank"))


@contextmanager
def open_page(
    path: Path | str, *, size: tuple[int, int] = (1100, 720), fragment: str = "", flags: tuple[str, ...] | None = None
) -> Iterator[Page]:
    """Opens a file or an address: in a new tab of the shared browser, or in a browser of its own.

    Args:
        path: file, or address.
        size: width and height of the window, pixels.
        fragment: appended to the address, beginning with ``#``.
        flags: of the command line of a browser of its own, which a page needs that must draw at full speed; None
            takes the shared one.
    """
    address = (path if isinstance(path, str) else Path(path).resolve().as_uri()) + fragment
    if flags is not None:
        with headless_browser(address, size=size, flags=flags) as driver:
            yield Page(driver)
        return
    driver = shared_browser()
    first = driver.current_window_handle
    driver.switch_to.new_window("tab")
    try:
        for name in ("browser", "performance"):
            driver.get_log(name)  # those of the pages before
        driver.set_window_size(*size)
        driver.get(address)
        yield Page(driver)
    finally:
        driver.close()
        driver.switch_to.window(first)


@dataclass(frozen=True)
class Blankness:
    """How much content a picture has.

    Attributes:
        colours: number of distinct colours, with four bits per channel to suppress noise.
        drawn: fraction of the pixels that differ visibly from the most common colour of their row; 0 for a plain or
            vertically shaded background.
    """

    colours: int
    drawn: float


def blankness(picture: NDArray[np.uint8]) -> Blankness:
    """Measures the content of a picture (height, width, 3)."""
    coarse = (picture >> 4).astype(np.int64)
    code = (coarse[..., 0] << 8) | (coarse[..., 1] << 4) | coarse[..., 2]
    drawn = 0
    for row, codes in zip(picture.astype(int), code, strict=True):
        common = row[codes == np.bincount(codes).argmax()][0]
        drawn += int((np.abs(row - common).max(axis=1) > 24).sum())
    return Blankness(colours=int(np.unique(code).size), drawn=drawn / code.size)
