"""Web server of a live session, in a thread of its own: the page, its values and the scene, behind one address.

Only a browser that was given the address with the token is let in, by a name that a foreign site cannot point here.
"""

from __future__ import annotations

import asyncio
import ipaddress
import secrets
import socket
import threading
from collections.abc import Mapping
from itertools import count

from tornado.httpserver import HTTPServer
from tornado.iostream import StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from interfaces.live.controls import LiveControls
from interfaces.live.messages import Outbox

LOCAL_HOST = "127.0.0.1"
MAX_HEADERS = 8192  # in units of bytes
MAX_BODY = 1  # in units of bytes; no request of the page has a body, and 0 means no limit
MAX_INPUT = 4096  # in units of bytes; the largest event, of a gamepad, has a few hundred. A larger one closes the page
REQUEST_TIME = 10.0  # in units of s, for a whole request
PING_PERIOD, PING_TIME = 10.0, 10.0  # in units of s; a page that does not answer is closed
SCENE_PERIOD, PANEL_PERIOD = 0.008, 0.05  # in units of s, between two looks for changes; 60 pictures a second pass


class LiveServer:
    """Serves the page until it is closed.

    Args:
        host: host name or address at which the server listens.
        port: port.
        files: content type and content of each file; the page has the name "".
        scene: messages for the viewer.
        panel: values of the panel, as JSON.
        controls: receive the frames of the browsers.

    Attributes:
        host: as given.
        token: random text that every address of the server contains.
        pages: numbers of the browsers that show the scene.
        is_open: false while the server closes: the last values are sent, and no more.

    Raises:
        OSError: if there is no such host, or the port is taken.
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        files: Mapping[str, tuple[str, bytes]],
        scene: Outbox,
        panel: Outbox,
        controls: LiveControls,
    ) -> None:
        self.host, self.token = host, secrets.token_urlsafe(24)
        self.files, self.scene, self.panel, self.controls = files, scene, panel, controls
        self.pages: set[int] = set()
        self.is_open = True
        self._sockets = bind_sockets(port, address=host)
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Sends the last values and stops the server."""
        self.is_open = False
        self._thread.join()

    async def _serve(self) -> None:
        handlers = (("/([^/]*)/", PageHandler), ("/([^/]*)/values", ValuesHandler), ("/([^/]*)(.*)", FileHandler))
        application = Application(
            [(pattern, handler, {"server": self}) for pattern, handler in handlers],
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
        server.add_sockets(self._sockets)
        while self.is_open:
            await asyncio.sleep(PANEL_PERIOD)
        server.stop()
        await asyncio.sleep(2 * PANEL_PERIOD)  # the handlers send the last values


class GuardedHandler(RequestHandler):
    """Refuses every request with a foreign Host or Origin header, or without the token.

    A browser sends an Origin with every handshake of a WebSocket, but not with every request.
    """

    def initialize(self, server: LiveServer) -> None:
        """Remembers the server."""
        self._server = server

    def set_default_headers(self) -> None:
        """Keeps the address with its token out of caches, other sites and frames."""
        self.set_header("Cache-Control", "no-store")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Content-Security-Policy", "frame-ancestors 'none'")
        self.clear_header("Server")

    def prepare(self) -> None:
        """Checks the request."""
        own = f"http://{self.request.host.lower()}"
        origin = self.request.headers.get("Origin", "" if self.is_handshake() else own)
        if not is_own_host(self.request.host_name, listens_at=self._server.host):
            raise HTTPError(403, reason="Forbidden: foreign Host header")
        if origin.lower() != own:
            raise HTTPError(403, reason="Forbidden: foreign Origin header")
        if not secrets.compare_digest(str(self.path_args[0]).encode(), self._server.token.encode()):
            raise HTTPError(403, reason="Forbidden: missing or wrong token")

    def is_handshake(self) -> bool:
        """Whether the request is to begin a WebSocket."""
        return self.request.headers.get("Upgrade", "").lower() == "websocket"

    def write_error(self, status_code: int, **kwargs: object) -> None:
        """Answers with one line."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}; open the address that the session has printed\n")

    def send_file(self, name: str) -> None:
        """Answers with a file.

        Raises:
            HTTPError: if there is no such file.
        """
        if name not in self._server.files:
            raise HTTPError(404)
        kind, content = self._server.files[name]
        self.set_header("Content-Type", kind)
        self.finish(content)


class FileHandler(GuardedHandler):
    """Serves files by their names."""

    def get(self, token: str, rest: str) -> None:
        """Answers with a file."""
        self.send_file(rest.removeprefix("/"))


class ValuesHandler(GuardedHandler):
    """Sends the values of the panel as server-sent events, after every change."""

    async def get(self, token: str) -> None:
        """Sends until the browser or the session closes."""
        serial, is_last = 0, False
        self.set_header("Content-Type", "text/event-stream")
        try:
            while not is_last:
                is_last = not self._server.is_open  # before the values are read, so that the last ones are sent
                serial, messages = self._server.panel.since(serial)
                self.write("".join(f"data: {message!s}\n\n" for message in messages))
                await self.flush()
                await asyncio.sleep(PANEL_PERIOD)
        except StreamClosedError:
            return  # the browser has closed the page


class PageHandler(GuardedHandler, WebSocketHandler):
    """Serves the page, and at the same address the WebSocket of its viewer, as Drake's Meshcat does."""

    _numbers = count(1)

    async def get(self, token: str) -> None:
        """Answers with the page, or begins a WebSocket."""
        if self.is_handshake():
            await super().get(token)
        else:
            self.send_file("")

    def open(self, token: str) -> None:
        """Begins to send the scene."""
        self._number = next(self._numbers)
        self._server.pages.add(self._number)
        self._sending = asyncio.create_task(self._send_scene())

    def on_message(self, message: str | bytes) -> None:
        """Handles a frame."""
        self._server.controls.receive(message, self._number)

    def on_close(self) -> None:
        """Forgets the browser."""
        self._server.pages.discard(self._number)
        self._server.controls.forget(self._number)

    async def _send_scene(self) -> None:
        """Sends the scene and its changes. It waits for a slow browser, and then skips what is out of date."""
        serial = 0
        try:
            while self._number in self._server.pages and self._server.is_open:
                serial, messages = self._server.scene.since(serial, reader=self._number)
                for message in messages:
                    await self.write_message(message, binary=True)
                await asyncio.sleep(SCENE_PERIOD)
            self.close()
        except WebSocketClosedError:
            return  # the browser has closed the page


def is_own_host(name: str, *, listens_at: str) -> bool:
    """Whether a name in a Host header is that of the server or an IP address: of this machine only, for a local server.

    A foreign site can let its own *name* point to this machine (DNS rebinding), but not an address.
    """
    address = ip_address(name.removeprefix("[").removesuffix("]"))
    own = ip_address(listens_at)
    is_local = listens_at.lower() == "localhost" or (own is not None and own.is_loopback)
    is_own_address = address is not None and (address.is_loopback or not is_local)
    return is_own_address or name.lower() in ("localhost", listens_at.lower())


def ip_address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Returns the IP address in a text, or None if it is something else."""
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None


def page_host(host: str) -> str:
    """Returns the host in the address of a page that listens at ``host``, for a browser on this machine."""
    here = {"0.0.0.0": LOCAL_HOST, "::": "::1"}.get(host, host)
    return f"[{here}]" if ":" in here else here


def exposure_warning(host: str) -> str | None:
    """Returns a warning if others than this machine can reach a server at ``host``, else None.

    Raises:
        OSError: if the name cannot be resolved.
    """
    addresses = {str(info[4][0]).split("%")[0] for info in socket.getaddrinfo(host, None)}
    if all(ipaddress.ip_address(address).is_loopback for address in addresses):
        return None
    return (
        f"warning: the page listens on {host}: others in its network can reach it, at the IP address of this machine."
        " Anyone with the address and its token can watch and control the session. The connection is not encrypted: the"
        " token can be read from the network traffic"
    )
