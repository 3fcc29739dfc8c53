"""The page of a live session: Drake's Meshcat, its controls unfolded, and a panel of what to do and what is felt."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from pydrake.common import FindResourceOrThrow
from pydrake.geometry import Meshcat, MeshcatParams

PANEL = Path(__file__).with_name("panel.html")
PORTS = range(7100, 7200, 2)  # the page's; the scene comes through the port after it
PULSE = 1.0  # in units of s, between two signs of life to a page when nothing changes

# Drake's page takes its scene from the address that it came from; here the scene has a port of its own.
HEAD = """<link rel="icon" href="data:,">
<script>
(function () {
  const Plain = WebSocket;
  window.WebSocket = function () { return new Plain("ws://" + location.hostname + ":SCENE_PORT/"); };
  for (const state of ["CONNECTING", "OPEN", "CLOSING", "CLOSED"]) window.WebSocket[state] = Plain[state];
})();
</script>
"""


class LivePage:
    """Serves the page, and tells every browser that has it open what the panel shows.

    Args:
        port: of the page.
        scene_port: of the Meshcat whose scene it shows.

    Raises:
        OSError: if the port is taken.
    """

    def __init__(self, *, port: int, scene_port: int) -> None:
        self._values: dict[str, Any] = {}
        self._changes = 0
        self._open = True
        self._news = threading.Condition()
        self._server = ThreadingHTTPServer(("", port), self._handler(page_source(scene_port)))
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    @property
    def address(self) -> str:
        """Where a browser on this machine finds the page."""
        return f"http://localhost:{self._server.server_address[1]}"

    def show(self, **values: Any) -> None:
        """Changes what the panel shows under these names (see panel.html); the others stay."""
        with self._news:
            if values.items() <= self._values.items():
                return
            self._values |= values
            self._changes += 1
            self._news.notify_all()

    def close(self) -> None:
        """Ends the service; pages that are open keep what they show."""
        self.show(over=True)
        with self._news:
            self._open = False
            self._news.notify_all()
        self._server.shutdown()
        self._server.server_close()  # waits for what is still being written

    def _handler(self, source: bytes) -> type[BaseHTTPRequestHandler]:
        page = self
        viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_bytes()
        files = {"/": ("text/html; charset=utf-8", source), "/meshcat.js": ("text/javascript; charset=utf-8", viewer)}

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                path = self.path.split("?")[0]
                if path == "/news":
                    self._answer("text/event-stream")
                    try:
                        page._tell(self.wfile)
                    except OSError:
                        return  # the browser has gone
                elif path in files:
                    kind, content = files[path]
                    self._answer(kind, ("Content-Length", str(len(content))))
                    self.wfile.write(content)
                else:
                    self.send_error(404)

            def _answer(self, kind: str, *headers: tuple[str, str]) -> None:
                self.send_response(200)
                for name, value in (("Content-Type", kind), ("Cache-Control", "no-store"), *headers):
                    self.send_header(name, value)
                self.end_headers()

            def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
                """Requests are no news."""

        return Handler

    def _tell(self, browser: Any) -> None:
        """Writes the panel's values, as events, as often as they change, and a last time at the end."""
        told = -1
        while True:
            with self._news:
                if self._changes == told and self._open:
                    self._news.wait(PULSE)
                told, values, last = self._changes, json.dumps(self._values), not self._open
            browser.write(f"data: {values}\n\n".encode())
            browser.flush()
            if last:
                return


def page_source(scene_port: int) -> bytes:
    """Drake's page with the panel in it.

    Raises:
        ValueError: if Drake's page is not made as it was.
    """
    path = Path(FindResourceOrThrow("drake/geometry/meshcat.html"))
    text = path.read_text(encoding="utf-8")
    for mark, before, after in (
        ("<head>", "", HEAD.replace("SCENE_PORT", str(scene_port))),
        ("</body>", PANEL.read_text(encoding="utf-8"), ""),
    ):
        if text.count(mark) != 1:
            raise ValueError(f"{path}: {text.count(mark)} times '{mark}', expected once; another Drake than 1.51?")
        text = text.replace(mark, before + mark + after)
    return text.encode()


def open_live_page(port: int | None = None) -> tuple[Meshcat, LivePage]:
    """A Meshcat and the page that shows it, at ``port`` and the one after it, or at the first such pair that is free.

    Raises:
        OSError: if a port is taken.
    """
    wanted: Iterable[int] = PORTS if port is None else (port,)
    for first in wanted:
        try:
            meshcat = Meshcat(MeshcatParams(port=first + 1, show_stats_plot=False))
        except RuntimeError:  # the port is taken
            continue
        try:
            return meshcat, LivePage(port=first, scene_port=first + 1)
        except OSError:
            continue
    taken = f"ports {port} and {port + 1} are" if port is not None else f"ports {PORTS[0]} to {PORTS[-1] + 1} are all"
    raise OSError(f"{taken} taken, or one of the two; choose another with --port")
