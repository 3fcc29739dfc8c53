"""The page of a live session: Drake's Meshcat page with a panel of instructions and readings."""

from __future__ import annotations

import json
from errno import EADDRINUSE
from pathlib import Path
from typing import Any

from pydrake.common import FindResourceOrThrow

from interfaces.live.controls import LiveControls
from interfaces.live.messages import Outbox
from interfaces.live.server import LOCAL_HOST, LiveServer, exposure_warning, page_host
from interfaces.live.viewer_scene import ViewerScene

PANEL = Path(__file__).with_name("panel")
# The first one serves the others.
SCRIPTS = ("panel.js", "readings.js", "pictures.js", "rumble.js", "guide.js")
HEAD = '<link rel="icon" href="data:,">'  # without it a browser asks for one, at an address without the token
PORTS = range(7100, 7200)  # tried one after another if no port is given
MAX_PORT = 65535


class LivePage:
    """Serves the page: the scene, its controls, and the values of the panel, for every browser that shows it.

    Args:
        host: host name or address at which the page listens.
        port: port of the page.

    Attributes:
        scene: what the viewer shows.
        controls: buttons, sliders and gamepad of the page.

    Raises:
        OSError: if there is no such host, or the port is taken.
    """

    def __init__(self, *, host: str, port: int) -> None:
        self._port, self._warning = port, exposure_warning(host)
        self._values: dict[str, Any] = {}
        messages, self._panel = Outbox(), Outbox()
        self.scene, self.controls = ViewerScene(messages), LiveControls(messages)
        viewer = Path(FindResourceOrThrow("drake/geometry/meshcat.js")).read_bytes()
        files = {"": ("text/html; charset=utf-8", page_source()), "meshcat.js": ("text/javascript", viewer)}
        self._server = LiveServer(host, port, files=files, scene=messages, panel=self._panel, controls=self.controls)

    @property
    def address(self) -> str:
        """The address of the page for a browser on this machine. Anyone who knows it controls the session."""
        return f"http://{page_host(self._server.host)}:{self._port}/{self._server.token}/"

    @property
    def is_shown(self) -> bool:
        """Whether a browser shows the page."""
        return bool(self._server.pages)

    def announcement(self) -> list[str]:
        """Returns lines for the console: the address, and a warning if others can reach the page."""
        return [f"open {self.address} in a browser", *([self._warning] if self._warning else [])]

    def show(self, **values: Any) -> None:
        """Changes the given values of the panel; panel/readings.js lists their names and units."""
        if not values.items() <= self._values.items():
            self._values |= values
            self._panel.put("values", json.dumps(self._values))

    def close(self) -> None:
        """Stops the server; open pages keep their last values."""
        self.show(over=True)
        self._server.close()


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
        port: port of the page. None takes the first free one of `PORTS`.

    Raises:
        ValueError: if the port is not a port number.
        OSError: if the port is taken or not allowed, or ``host`` is not a name or an address of this machine.
    """
    if port is not None and not 1 <= port <= MAX_PORT:
        raise ValueError(f"port is {port}, expected 1 to {MAX_PORT}")
    for candidate in PORTS if port is None else (port,):
        try:
            return LivePage(host=host, port=candidate)
        except OSError as error:
            if error.errno != EADDRINUSE:
                raise OSError(f"the page cannot listen on {host}, port {candidate}: {error.strerror}") from error
    if port is None:
        raise OSError(f"no free port from {PORTS[0]} to {PORTS[-1]}; choose a port with --port")
    raise OSError(f"port {port} is taken; choose another with --port")
