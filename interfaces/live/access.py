"""Who is let in to the page of a live session: only a browser that was given the address with the token."""

from __future__ import annotations

import ipaddress
import re
import secrets
import socket
from collections.abc import Mapping

LOCAL_HOST = "127.0.0.1"
AUTHORITY = re.compile(r"(?:\[(?P<v6>[0-9A-Fa-f:.]+)\]|(?P<name>[^\s:/@\[\]]+))(?::\d{1,5})?")

FOREIGN_HOST, FOREIGN_ORIGIN, WRONG_TOKEN = "foreign Host header", "foreign Origin header", "missing or wrong token"


class Access:
    """Checks the requests to a server.

    Args:
        host: host name or address at which the server listens.

    Attributes:
        token: random text that every address of the server contains.
    """

    def __init__(self, host: str) -> None:
        self.token = secrets.token_urlsafe(24)
        self._names = {"localhost", host.lower()}
        listens_at = _ip_address(host)
        self._is_local = host.lower() == "localhost" or (listens_at is not None and listens_at.is_loopback)

    def objection(self, token: str, headers: Mapping[str, str], *, needs_origin: bool) -> str | None:
        """Returns why a request is refused, or None if it may pass.

        Args:
            token: token in the address of the request.
            headers: headers of the request.
            needs_origin: whether the Origin header must be present. A browser sends it with every handshake of a
                WebSocket, but not with every request.
        """
        host = headers.get("Host", "")
        if not self._is_own_host(host):
            return FOREIGN_HOST
        origin = headers.get("Origin")
        if needs_origin and origin is None:
            return FOREIGN_ORIGIN
        if origin is not None and origin.lower() != f"http://{host.lower()}":
            return FOREIGN_ORIGIN
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return WRONG_TOKEN
        return None

    def _is_own_host(self, host: str) -> bool:
        """Whether a Host header has the name of the server or an IP address: of this machine only, for a local server.

        A foreign site can let its own *name* point to this machine (DNS rebinding), but not an address.
        """
        match = AUTHORITY.fullmatch(host)
        if match is None:
            return False
        name = match["v6"] or match["name"]
        address = _ip_address(name)
        return name.lower() in self._names or (address is not None and (address.is_loopback or not self._is_local))


def _ip_address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None


def page_host(host: str) -> str:
    """Returns the host in the address of a page that listens at ``host``, for a browser on this machine."""
    address = _ip_address(host)
    if address is None:
        return host
    if address.is_unspecified:
        return LOCAL_HOST if address.version == 4 else "[::1]"
    return f"[{address}]" if address.version == 6 else host


def exposure_warning(host: str) -> str | None:
    """Returns a warning that names who can reach a server at ``host``, or None if only this machine can.

    Raises:
        OSError: if the name cannot be resolved.
    """
    found = sorted({str(info[4][0]).split("%")[0] for info in socket.getaddrinfo(host, None)})
    addresses = [ipaddress.ip_address(address) for address in found]
    if all(address.is_loopback for address in addresses):
        return None
    if any(address.is_unspecified for address in addresses):
        where = f"all network interfaces of this machine ({host}): everyone in any of its networks"
        remedy = "; from another machine, use the IP address of this one in place of the host"
    else:
        where = f"{', '.join(found)}: everyone in the network of this address"
        remedy = ""
    return (
        f"warning: the page listens on {where} can reach it. Anyone with the address and its token can watch and"
        f" control the session. The connection is not encrypted: the token can be read from the network traffic{remedy}"
    )
