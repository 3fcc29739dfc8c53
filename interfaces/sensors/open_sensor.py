"""Sensors by their address."""

from __future__ import annotations

import re

from interfaces.sensors.net_ft import PORT, NetFt
from interfaces.sensors.wrench_stream import WrenchStream

NET_FT = re.compile(r"netft://([^\s:/]+)(?::(\d{1,5}))?(?::(\d{1,5}))?")


def open_sensor(url: str, arm: WrenchStream | None = None) -> WrenchStream:
    """Opens a sensor.

    Args:
        url: ``netft://HOST[:PORT[:HTTPPORT]]`` for a Net F/T sensor, or ``arm:`` for the arm's own estimate.
        arm: the stream of this estimate, if there is an arm.

    Raises:
        ValueError: if the address is none of these, or there is no such sensor; the message says what was expected.
    """
    if url == "arm:":
        if arm is None:
            raise ValueError("sensor 'arm:': there is no arm that estimates a wrench")
        return arm
    found = NET_FT.fullmatch(url)
    port, http_port = (int(found[2] or PORT), int(found[3] or 80)) if found else (0, 0)
    if not (found and 0 < port < 1 << 16 and 0 < http_port < 1 << 16):
        raise ValueError(
            f"sensor {url!r}: expected netft://HOST[:PORT[:HTTPPORT]], such as netft://192.168.1.1, or arm:"
        )
    return NetFt(found[1], port=port, http_port=http_port)
