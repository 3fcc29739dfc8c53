"""Opens a page in a headless Chromium, which draws without a graphics card."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-gpu",  # as Chromium does without a graphics card: only the scene needs OpenGL, which is emulated
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-default-apps",
    "--disable-extensions",
    "--hide-scrollbars",
    "--force-device-scale-factor=1",
)
LOGS = {"browser": "ALL", "performance": "ALL"}


@contextmanager
def headless_browser(
    address: str, *, size: tuple[int, int] = (1280, 720), flags: tuple[str, ...] = ()
) -> Iterator[Any]:
    """Yields selenium's driver of a browser that shows a page; it keeps console messages and requests.

    Args:
        address: of the page.
        size: width and height of the window, pixels.
        flags: more flags of the browser's command line.

    Raises:
        ModuleNotFoundError: if selenium is not installed.
        OSError: if Chromium or its driver is not installed.
    """
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    chromedriver = shutil.which("chromedriver")
    if chromium is None or chromedriver is None:
        missing = "chromium" if chromium is None else "chromedriver"
        raise OSError(f"'{missing}' is not on the PATH; on Debian and Ubuntu: apt-get install chromium chromium-driver")
    with tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True) as profile:
        options = webdriver.ChromeOptions()
        options.binary_location = chromium
        for flag in (*FLAGS, *flags, f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", LOGS)
        driver = webdriver.Chrome(options=options, service=Service(chromedriver))
        try:
            driver.set_page_load_timeout(60)
            driver.set_script_timeout(30)
            driver.get(address)
            yield driver
        finally:
            driver.quit()
