"""Who reaches a live session: the checks of Host, Origin and token, and names and addresses of hosts.

Only a browser that was given the address with the token is let in, by a name that a foreign site cannot point here.
"""

from __future__ import annotations

import ipaddress
import secrets
import socket
from typing import Any

from tornado.web import HTTPError, RequestHandler

LOCAL_HOST = "127.0.0.1"


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


class GuardedHandler(RequestHandler):
    """Refuses every request with a foreign Host or Origin header, or without the token.

    A browser sends an Origin with every handshake of a WebSocket, but not with every request.
    """

    def initialize(self, page: Any) -> None:
        """Remembers the page, an `interfaces.live.page.LivePage`."""
        self._page = page

    def set_default_headers(self) -> None:
        """Keeps the address with its token out of caches, other sites and frames."""
        for name, value in (
            ("Cache-Control", "no-store"),
            ("Referrer-Policy", "no-referrer"),
            ("X-Content-Type-Options", "nosniff"),
            ("Content-Security-Policy", "frame-ancestors 'none'"),
        ):
            self.set_header(name, value)
        self.clear_header("Server")

    def prepare(self) -> None:
        """Checks the request."""
        own = f"http://{self.request.host.lower()}"
        origin = self.request.headers.get("Origin", "" if self.is_handshake() else own)
        if not is_own_host(self.request.host_name, listens_at=self._page.host):
            raise HTTPError(403, reason="Forbidden: foreign Host header")
        if origin.lower() != own:
            raise HTTPError(403, reason="Forbidden: foreign Origin header")
        if not secrets.compare_digest(str(self.path_args[0]).encode(), self._page.token.encode()):
            raise HTTPError(403, reason="Forbidden: missing or wrong token")

    def is_handshake(self) -> bool:
        """Whether the request is to begin a WebSocket."""
        return self.request.headers.get("Upgrade", "").lower() == "websocket"

    def write_error(self, status_code: int, **kwargs: object) -> None:
        """Answers with one line."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}; open the address that the session has printed\n")
