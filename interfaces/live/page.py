"""The page of a live session: Drake's Meshcat page with a panel of instructions and readings, behind one address."""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import threading
from errno import EADDRINUSE
from itertools import count
from pathlib import Path
from typing import Any

from pydrake.common import FindResourceOrThrow
from tornado.httpserver import HTTPServer
from tornado.iostream import StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from interfaces.live.access import LOCAL_HOST, GuardedHandler, exposure_warning, page_host
from interfaces.live.controls import LiveControls
from interfaces.live.messages import Outbox
from interfaces.live.viewer_scene import ViewerScene

PANEL = Path(__file__).with_name("panel")
# The first one serves the others.
SCRIPTS = ("panel.js", "readings.js", "pictures.js", "rumble.js", "guide.js")
HEAD = '<link rel="icon" href="data:,">'  # without it a browser asks for one, at an address without the token
PORTS = range(7100, 7200)  # tried one after another if no port is given
MAX_HEADERS = 8192  # in units of bytes
MAX_BODY = 1  # in units of bytes; no request of the page has a body, and 0 means no limit
MAX_INPUT = 4096  # in units of bytes; the largest event, of a gamepad, has a few hundred. A larger one closes the page
REQUEST_TIME = 10.0  # in units of s, for a whole request
PING_PERIOD, PING_TIME = 10.0, 10.0  # in units of s; a page that does not answer is closed
SCENE_PERIOD, PANEL_PERIOD = 0.008, 0.05  # in units of s, between two looks for changes; 60 pictures a second pass


class LivePage:
    """Serves the page, in a thread of its own: the scene, its controls, and the values of the panel, for every browser.

    Args:
        host: host name or address at which the page listens.
        port: port of the page.

    Attributes:
        host: as given.
        token: random text that every address of the page contains.
        files: content type and content of each file; the page has the name "".
        messages: for the viewer.
        panel: values of the panel, as JSON.
        scene: what the viewer shows.
        controls: buttons, sliders and gamepad of the page.
        browsers: numbers of the browsers that show the scene.
        is_open: false while the server closes: the last values are sent, and no more.

    Raises:
        OSError: if there is no such host, or the port is taken.
    """

    def __init__(self, *, host: str, port: int) -> None:
        self._warning = exposure_warning(host)
        self.host, self._port, self.token = host, port, secrets.token_urlsafe(24)
        viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_bytes()
        self.files = {"": ("text/html; charset=utf-8", page_source()), "meshcat.js": ("text/javascript", viewer)}
        self._values: dict[str, Any] = {}
        self.messages, self.panel = Outbox(), Outbox()
        self.scene, self.controls = ViewerScene(self.messages), LiveControls(self.messages)
        self.browsers: set[int] = set()
        self.is_open = True
        sockets = bind_sockets(port, address=host)
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve(sockets)), daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """The address of the page for a browser on this machine. Anyone who knows it controls the session."""
        return f"http://{page_host(self.host)}:{self._port}/{self.token}/"

    @property
    def is_shown(self) -> bool:
        """Whether a browser shows the page."""
        return bool(self.browsers)

    def announcement(self) -> list[str]:
        """Returns lines for the console: the address, and a warning if others can reach the page."""
        return [f"open {self.address} in a browser", *([self._warning] if self._warning else [])]

    def show(self, **values: Any) -> None:
        """Changes the given values of the panel.

        They are in SI units, except tilts, which are in degrees as the person sees them:

        - status: a line of text; phase: "ready", "recording", "verdict", "busy" or "over"; over: the session has ended.
        - force N, moment N m, load (of the device, 1 is its limit) and colour (of the force).
        - depth {tip, full} m, tilt {right, away}, kept (a count), energy J, min_energy J.
        - rate: simulated over wall-clock time; pace: the rate of the self-test; deadlines {late_steps, steps,
          late_ticks, ticks}.
        - contact {load N, limit N, peak N, held} or null: the load that the rig's guard would see, its limit, the
          largest of this demonstration, and whether the guard would already slow the feed.
        - hand: whether a hand moves the peg; on the rig none does, and what belongs to one is not shown. motion:
          whether the controls of the page move it.
        - skill {state, colour, known, feed m/s, turn rad/s, tilt, turned} or null.
        """
        if not values.items() <= self._values.items():
            self._values |= values
            self.panel.put("values", json.dumps(self._values))

    def close(self) -> None:
        """Sends the last values and stops the server; open pages keep them."""
        self.show(over=True)
        self.is_open = False
        self._thread.join()

    async def _serve(self, sockets: list[socket.socket]) -> None:
        handlers = (("/([^/]*)/values", ValuesHandler), ("/([^/]*)/?(.*)", PageHandler))
        application = Application(
            [(pattern, handler, {"page": self}) for pattern, handler in handlers],
            log_function=lambda handler: None,  # a refused request is answered, and not mentioned on the console
            websocket_max_message_size=MAX_INPUT,
            websocket_ping_interval=PING_PERIOD,
            websocket_ping_timeout=PING_TIME,
        )
        server = HTTPServer(
            application,
            max_header_size=MAX_HEADERS,
            max_body_size=MAX_BODY,
            body_timeout=REQUEST_TIME,
            idle_connection_timeout=REQUEST_TIME,
        )
        server.add_sockets(sockets)
        while self.is_open:
            await asyncio.sleep(PANEL_PERIOD)
        server.stop()
        await asyncio.sleep(2 * PANEL_PERIOD)  # the handlers send the last values


class ValuesHandler(GuardedHandler):
    """Sends the values of the panel as server-sent events, after every change."""

    async def get(self, token: str) -> None:
        """Sends until the browser or the session closes."""
        serial, is_last = 0, False
        self.set_header("Content-Type", "text/event-stream")
        try:
            while not is_last:
                is_last = not self._page.is_open  # before the values are read, so that the last ones are sent
                serial, messages = self._page.panel.since(serial)
                self.write("".join(f"data: {message!s}\n\n" for message in messages))
                await self.flush()
                await asyncio.sleep(PANEL_PERIOD)
        except StreamClosedError:
            return  # the browser has closed the page


class PageHandler(GuardedHandler, WebSocketHandler):
    """Serves the page and its files, and at the same address the WebSocket of its viewer, as Drake's Meshcat does."""

    _numbers = count(1)

    async def get(self, token: str, name: str) -> None:
        """Answers with a file, or begins a WebSocket.

        Raises:
            HTTPError: if there is no such file.
        """
        if self.is_handshake():
            await super().get(token, name)
        elif name in self._page.files:
            kind, content = self._page.files[name]
            self.set_header("Content-Type", kind)
            self.finish(content)
        else:
            raise HTTPError(404)

    def open(self, token: str, name: str) -> None:
        """Begins to send the scene."""
        self._number = next(self._numbers)
        self._page.browsers.add(self._number)
        self._sending = asyncio.create_task(self._send_scene())

    def on_message(self, message: str | bytes) -> None:
        """Handles a frame."""
        self._page.controls.receive(message, self._number)

    def on_close(self) -> None:
        """Forgets the browser."""
        self._page.browsers.discard(self._number)
        self._page.controls.forget(self._number)

    async def _send_scene(self) -> None:
        """Sends the scene and its changes. It waits for a slow browser, and then skips what is out of date."""
        serial = 0
        try:
            while self._number in self._page.browsers and self._page.is_open:
                serial, messages = self._page.messages.since(serial, reader=self._number)
                for message in messages:
                    await self.write_message(message, binary=True)
                await asyncio.sleep(SCENE_PERIOD)
            self.close()
        except WebSocketClosedError:
            return  # the browser has closed the page


def page_source() -> bytes:
    """Returns Drake's Meshcat page with the panel added to it.

    Raises:
        ValueError: if the page of the installed Drake lacks the expected places for the additions.
    """
    panel = (PANEL / "panel.html").read_text(encoding="utf-8")
    for mark, names in (("{{styles}}", ("panel.css",)), ("{{scripts}}", SCRIPTS)):
        panel = panel.replace(mark, "\n".join((PANEL / name).read_text(encoding="utf-8") for name in names))
    path = Path(FindResourceOrThrow("drake/geometry/meshcat.html"))
    text = path.read_text(encoding="utf-8")
    for mark, replacement in (("<head>", f"<head>{HEAD}"), ("</body>", f"{panel}</body>")):
        if text.count(mark) != 1:
            raise ValueError(
                f"{path}: unsupported version of Drake: '{mark}' occurs {text.count(mark)} times, expected 1"
            )
        text = text.replace(mark, replacement)
    return text.encode()


def open_live_page(*, host: str = LOCAL_HOST, port: int | None = None) -> LivePage:
    """Opens the page.

    Args:
        host: host name or address at which the page listens. The default lets in this machine only.
        port: port of the page, 1 to 65535. None takes the first free one of `PORTS`.

    Raises:
        OSError: if the port is taken or not allowed, or ``host`` is not a name or an address of this machine.
    """
    for candidate in PORTS if port is None else (port,):
        try:
            return LivePage(host=host, port=candidate)
        except OSError as error:
            if error.errno != EADDRINUSE:
                raise OSError(f"the page cannot listen on {host}, port {candidate}: {error.strerror}") from error
    if port is None:
        raise OSError(f"no free port from {PORTS[0]} to {PORTS[-1]}; choose a port with --port")
    raise OSError(f"port {port} is taken; choose another with --port")
