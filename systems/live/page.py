"""The page of a live session: Drake's Meshcat page with a panel of instructions and readings."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BufferedIOBase
from pathlib import Path
from string import Template
from typing import Any

from pydrake.common import FindResourceOrThrow
from pydrake.geometry import Meshcat, MeshcatParams

HEAD = Path(__file__).with_name("page_head.html")
PANEL = Path(__file__).with_name("panel.html")
PORTS = range(7100, 7200, 2)  # ports for the page; the port after each serves the scene
KEEP_ALIVE_PERIOD = 1.0  # in units of s; values that do not change are sent again after this time


class LivePage:
    """Serves the page, and sends the values of the panel to every browser that shows it.

    Args:
        port: port of the page.
        scene_port: port of the Meshcat whose scene the page shows.

    Raises:
        OSError: if the port is taken.
    """

    def __init__(self, *, port: int, scene_port: int) -> None:
        self._values: dict[str, Any] = {}
        self._version = 0  # counts the changes of the values
        self._open = True
        self._changed = threading.Condition()
        self._server = ThreadingHTTPServer(("", port), self._handler(page_source(scene_port)))
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        """The address of the page for a browser on this machine."""
        return f"http://localhost:{self._server.server_address[1]}"

    def show(self, **values: Any) -> None:
        """Changes the given values of the panel; panel.html lists their names and units."""
        with self._changed:
            if values.items() <= self._values.items():
                return
            self._values |= values
            self._version += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Stops the server; open pages keep their last values."""
        self.show(over=True)
        with self._changed:
            self._open = False
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()  # waits until all answers are written

    def _handler(self, source: bytes) -> type[BaseHTTPRequestHandler]:
        page = self
        viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_bytes()
        files = {"/": ("text/html; charset=utf-8", source), "/meshcat.js": ("text/javascript; charset=utf-8", viewer)}

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                path = self.path.split("?")[0]
                if path == "/values":
                    self._send_headers("text/event-stream")
                    try:
                        page._send_values(self.wfile)
                    except OSError:
                        return  # the browser has closed the page
                elif path in files:
                    kind, content = files[path]
                    self._send_headers(kind, ("Content-Length", str(len(content))))
                    self.wfile.write(content)
                else:
                    self.send_error(404)

            def _send_headers(self, kind: str, *headers: tuple[str, str]) -> None:
                self.send_response(200)
                for name, value in (("Content-Type", kind), ("Cache-Control", "no-store"), *headers):
                    self.send_header(name, value)
                self.end_headers()

            def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
                """Does not log requests."""

        return Handler

    def _send_values(self, browser: BufferedIOBase) -> None:
        """Writes the values as server-sent events: after every change, every `KEEP_ALIVE_PERIOD`, and at the end."""
        sent = -1
        while True:
            with self._changed:
                if self._version == sent and self._open:
                    self._changed.wait(KEEP_ALIVE_PERIOD)
                sent, values, is_last = self._version, json.dumps(self._values), not self._open
            browser.write(f"data: {values}\n\n".encode())
            browser.flush()
            if is_last:
                return


def page_source(scene_port: int) -> bytes:
    """Returns Drake's Meshcat page with the panel added to it.

    Raises:
        ValueError: if the page of the installed Drake lacks the expected places for the additions.
    """
    path = Path(FindResourceOrThrow("drake/geometry/meshcat.html"))
    text = path.read_text(encoding="utf-8")
    head = Template(HEAD.read_text(encoding="utf-8")).substitute(scene_port=scene_port)
    panel = PANEL.read_text(encoding="utf-8")
    for mark, replacement in (("<head>", f"<head>{head}"), ("</body>", f"{panel}</body>")):
        if text.count(mark) != 1:
            raise ValueError(
                f"{path}: unsupported version of Drake: '{mark}' occurs {text.count(mark)} times, expected 1"
            )
        text = text.replace(mark, replacement)
    return text.encode()


def open_live_page(port: int | None = None) -> tuple[Meshcat, LivePage]:
    """Opens a Meshcat and the page that shows it.

    Args:
        port: port of the page; the Meshcat uses the next one. None takes the first free pair of `PORTS`.

    Raises:
        OSError: if a port is taken.
    """
    candidates: Iterable[int] = PORTS if port is None else (port,)
    for first in candidates:
        try:
            meshcat = Meshcat(MeshcatParams(port=first + 1, show_stats_plot=False))
        except RuntimeError:  # the port is taken
            continue
        try:
            return meshcat, LivePage(port=first, scene_port=first + 1)
        except OSError:
            continue
    if port is None:
        raise OSError(f"no pair of free ports from {PORTS[0]} to {PORTS[-1] + 1}; choose a port with --port")
    raise OSError(f"port {port} or {port + 1} is taken; choose another with --port")
