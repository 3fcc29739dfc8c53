"""Opens a page in a headless Chromium, which draws without a graphics card."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--force-device-scale-factor=1",
)


@contextmanager
def headless_browser(address: str, *, size: tuple[int, int] = (1280, 720)) -> Iterator[Any]:
    """Yields selenium's driver of a browser that shows a page.

    Args:
        address: of the page.
        size: width and height of the window, pixels.

    Raises:
        ModuleNotFoundError: if selenium is not installed.
    """
    from selenium import webdriver

    with tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True) as profile:
        options = webdriver.ChromeOptions()
        for flag in (*FLAGS, f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}"):
            options.add_argument(flag)
        driver = webdriver.Chrome(options=options)
        try:
            driver.get(address)
            yield driver
        finally:
            driver.quit()
