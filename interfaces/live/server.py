"""Web server of a live session, in a thread of its own: the page, its values and the scene, behind one address."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import count
from socket import socket
from typing import Any, cast

from tornado.http1connection import HTTP1ServerConnection
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream, StreamClosedError
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from interfaces.live.access import Access
from interfaces.live.messages import Outbox

MAX_CONNECTIONS = 64  # open connections, of pages and of visitors that are not let in
MAX_PAGES = 8  # pages that show the scene at a time
MAX_HEADERS = 8192  # in units of bytes
MAX_BODY = 1  # in units of bytes; no request of the page has a body, and 0 means no limit
MAX_INPUT = 65536  # in units of bytes; a larger frame closes its connection
REQUEST_TIME = 10.0  # in units of s, for a whole request
PING_PERIOD, PING_TIME = 10.0, 10.0  # in units of s; a page that does not answer is closed
SCENE_PERIOD, PANEL_PERIOD = 0.008, 0.05  # in units of s, between two looks for changes; 60 pictures a second pass
KEEP_ALIVE_PERIOD = 1.0  # in units of s; values that do not change are sent again after this time
CLOSING_TIME = 2.0  # in units of s, in which the last values are sent

JUNK_FRAME, JUNK_REQUEST, BROKEN = "junk frame", "junk request", "broken connection"
TOO_MANY = "connection above the limit"


@dataclass
class Site:
    """What the server serves.

    Attributes:
        access: checks every request.
        files: content type and content of each file; the page has the name "".
        scene: messages for the viewer.
        panel: values of the panel, as JSON.
        receive: handles a frame from a browser with a number; returns whether it was valid.
        leave: is told the number of a browser that has gone.
        refused: how often something was refused or ignored, by its kind.
        pages: numbers of the browsers that show the scene.
        panels: number of browsers that show the panel.
        is_open: false while the server closes: the last values are sent, and no more.
    """

    access: Access
    files: Mapping[str, tuple[str, bytes]]
    scene: Outbox
    panel: Outbox
    receive: Callable[[str | bytes, int], bool]
    leave: Callable[[int], None]
    refused: Counter[str] = field(default_factory=Counter)
    pages: set[int] = field(default_factory=set)
    panels: int = 0
    is_open: bool = True


class LiveServer:
    """Serves a site until it is closed.

    Args:
        site: what is served.
        sockets: listening sockets.
    """

    def __init__(self, site: Site, sockets: list[socket]) -> None:
        self._site, self._sockets = site, sockets
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Sends the last values and stops the server."""
        self._site.is_open = False
        self._thread.join()

    async def _serve(self) -> None:
        site = self._site
        handlers = (("/[^/]*/", PageHandler), ("/[^/]*/values", ValuesHandler), (".*", FileHandler))
        application = Application(
            [(pattern, handler, {"site": site}) for pattern, handler in handlers],
            log_function=lambda handler: None,  # refusals are counted instead
            websocket_max_message_size=MAX_INPUT,
            websocket_ping_interval=PING_PERIOD,
            websocket_ping_timeout=PING_TIME,
        )
        server = BoundedServer(
            application,
            max_header_size=MAX_HEADERS,
            max_body_size=MAX_BODY,
            body_timeout=REQUEST_TIME,
            idle_connection_timeout=REQUEST_TIME,
        )
        server.refused = site.refused
        server.add_sockets(self._sockets)
        while site.is_open:
            await asyncio.sleep(PANEL_PERIOD)
        server.stop()
        end = time.monotonic() + CLOSING_TIME
        while site.panels and time.monotonic() < end:
            await asyncio.sleep(PANEL_PERIOD)
        server.close_streams()


class CountedStream(IOStream):
    """A connection.

    Attributes:
        has_input: whether anything has arrived since the last whole request.
        is_websocket: whether the connection has become a WebSocket.
    """

    has_input = is_websocket = False

    def read_from_fd(self, buf: bytearray | memoryview) -> int | None:
        """Reads; see `IOStream`."""
        size = super().read_from_fd(buf)
        self.has_input = self.has_input or bool(size)
        return size


class BoundedServer(HTTPServer):
    """An HTTP server with a bounded number of connections, which counts those that end without a whole request."""

    refused: Counter[str]

    def initialize(self, *args: Any, **kwargs: Any) -> None:
        """Begins without connections; see `HTTPServer`."""
        super().initialize(*args, **kwargs)
        self._streams: set[IOStream] = set()

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        """Accepts a connection, or closes it if there are too many."""
        self._streams = {known for known in self._streams if not known.closed()}
        if len(self._streams) >= MAX_CONNECTIONS:
            self.refused[TOO_MANY] += 1
            stream.close()
            return
        counted = CountedStream(stream.socket, max_buffer_size=2 * MAX_INPUT)
        self._streams.add(counted)
        super().handle_stream(counted, address)

    def on_close(self, server_conn: Any) -> None:
        """Counts a connection that ended in the middle of a request, or whose request could not be read."""
        super().on_close(server_conn)
        if server_conn.stream.has_input and not server_conn.stream.is_websocket:
            self.refused[JUNK_REQUEST] += 1

    def close_streams(self) -> None:
        """Closes all connections, so that the browsers see the end."""
        for stream in self._streams:
            stream.close()


class GuardedHandler(RequestHandler):
    """Refuses every request that `Access` objects to."""

    def initialize(self, site: Site) -> None:
        """Remembers the site."""
        self._site = site

    def set_default_headers(self) -> None:
        """Keeps the address with its token out of caches, other sites and frames."""
        self.set_header("Cache-Control", "no-store")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Content-Security-Policy", "frame-ancestors 'none'")
        self.clear_header("Server")

    def prepare(self) -> None:
        """Checks the request."""
        self._stream().has_input = False
        parts = self.request.path.split("/")
        token = parts[1] if len(parts) > 1 else ""  # a path of a raw request may have no "/"
        headers = self.request.headers
        objection = self._site.access.objection(token, headers, needs_origin=is_handshake(headers))
        if objection is not None:
            self._site.refused[objection] += 1
            raise HTTPError(403, reason=f"Forbidden: {objection}")

    def write_error(self, status_code: int, **kwargs: Any) -> None:
        """Answers with one line and closes the connection."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        written = self.finish(f"{status_code} {self._reason}; open the address that the session has printed\n")
        written.add_done_callback(lambda _: self._stream().close())

    def _stream(self) -> CountedStream:
        return cast(CountedStream, cast(HTTP1ServerConnection, self.request.server_connection).stream)

    def send_file(self, name: str) -> None:
        """Answers with a file of the site.

        Raises:
            HTTPError: if there is no such file.
        """
        if name not in self._site.files:
            raise HTTPError(404)
        kind, content = self._site.files[name]
        self.set_header("Content-Type", kind)
        self.finish(content)


class FileHandler(GuardedHandler):
    """Serves files by their names."""

    def get(self) -> None:
        """Answers with a file."""
        self.send_file(self.request.path.split("/", 2)[-1])


class ValuesHandler(GuardedHandler):
    """Sends the values of the panel as server-sent events: after every change, and every `KEEP_ALIVE_PERIOD`."""

    async def get(self) -> None:
        """Sends until the browser or the session closes."""
        site, serial, sent_at = self._site, 0, 0.0
        self.set_header("Content-Type", "text/event-stream")
        site.panels += 1
        try:
            while True:
                is_last = not site.is_open  # before the values are read, so that the last ones are sent
                if time.monotonic() - sent_at > KEEP_ALIVE_PERIOD:
                    serial = 0
                serial, messages = site.panel.since(serial)
                if messages:
                    sent_at = time.monotonic()
                    self.write("".join(f"data: {message!s}\n\n" for message in messages))
                    await self.flush()
                if is_last:
                    return
                await asyncio.sleep(PANEL_PERIOD)
        except StreamClosedError:
            return  # the browser has closed the page
        finally:
            site.panels -= 1


class PageHandler(GuardedHandler, WebSocketHandler):
    """Serves the page, and at the same address the WebSocket of its viewer, as Drake's Meshcat does."""

    _numbers = count(1)

    async def get(self) -> None:
        """Answers with the page, or begins a WebSocket."""
        if is_handshake(self.request.headers):
            self._stream().is_websocket = True
            await super().get()
        else:
            self.send_file("")

    def check_origin(self, origin: str) -> bool:
        """Accepts the origin, which `prepare` has checked."""
        return True

    def open(self) -> None:
        """Begins to send the scene."""
        self._number = next(self._numbers)
        if len(self._site.pages) >= MAX_PAGES:
            self._site.refused[TOO_MANY] += 1
            self.close(1013, "too many pages are open")
            return
        self._site.pages.add(self._number)
        self._sending = asyncio.create_task(self._send_scene())

    def on_message(self, message: str | bytes) -> None:
        """Handles or counts a frame."""
        if self._number in self._site.pages and not self._site.receive(message, self._number):
            self._site.refused[JUNK_FRAME] += 1

    def on_close(self) -> None:
        """Forgets the browser."""
        if self._number not in self._site.pages:
            return
        self._site.pages.discard(self._number)
        self._site.leave(self._number)
        if self.close_code is None and self._site.is_open:
            self._site.refused[BROKEN] += 1

    async def _send_scene(self) -> None:
        """Sends the scene and its changes. It waits for a slow browser, and then skips what is out of date."""
        serial = 0
        try:
            while self._number in self._site.pages:
                serial, messages = self._site.scene.since(serial, reader=self._number)
                for message in messages:
                    await self.write_message(message, binary=True)
                await asyncio.sleep(SCENE_PERIOD)
        except WebSocketClosedError:
            return  # the browser has closed the page


def is_handshake(headers: Mapping[str, str]) -> bool:
    """Whether a request asks for a WebSocket."""
    return headers.get("Upgrade", "").lower() == "websocket"
