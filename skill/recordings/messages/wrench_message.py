"""Decodes messages of the type WrenchStamped: CDR of ROS 2, the serialization of ROS 1, and JSON.

The layout is that of geometry_msgs/WrenchStamped: a header with a time stamp and the name of a frame, then force and
torque as six 64-bit floats. CDR aligns each number to its size, counted from the end of the four bytes that say the
byte order (OMG, DDSI-RTPS 2.3, section 10).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

from skill.data.files import parse_object

SCHEMAS = ("geometry_msgs/WrenchStamped", "geometry_msgs/msg/WrenchStamped")
"""Names of the type in ROS 1 and ROS 2."""

Sample = tuple[float, ...]
"""Time, s, then fx fy fz in N and mx my mz in N m."""


def decode_cdr(message: bytes) -> Sample:
    """Decodes a message of ROS 2; the time is 0 if its header has none.

    Raises:
        ValueError: if the message has another layout.
    """
    order = {b"\0\0": ">", b"\0\1": "<"}.get(message[:2])
    if order is None:
        raise ValueError(f"encapsulation {message[:2].hex()}, expected plain CDR (0000 or 0001)")
    seconds, nanoseconds, length = _unpack(f"{order}iII", message, 4)
    place = 4 + (12 + length + 7) // 8 * 8
    return (seconds + nanoseconds * 1e-9, *_unpack_end(f"{order}6d", message, place))


def decode_ros1(message: bytes) -> Sample:
    """Decodes a message of ROS 1; the time is 0 if its header has none.

    Raises:
        ValueError: if the message has another layout.
    """
    _, seconds, nanoseconds, length = _unpack("<4I", message, 0)
    return (seconds + nanoseconds * 1e-9, *_unpack_end("<6d", message, 16 + length))


def decode_json(message: bytes) -> Sample:
    """Decodes a message in JSON, with the fields of ROS 1 or ROS 2; the time is 0 if it has no header.

    Raises:
        ValueError: if a field is missing or no number.
    """
    fields = parse_object(message)
    try:
        stamp = (fields.get("header") or {}).get("stamp") or {}
        seconds = _number(stamp.get("sec", stamp.get("secs", 0)))
        nanoseconds = _number(stamp.get("nanosec", stamp.get("nsec", stamp.get("nsecs", 0))))
        parts = [fields["wrench"][part][axis] for part in ("force", "torque") for axis in "xyz"]
        return (seconds + nanoseconds * 1e-9, *map(_number, parts))
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"no numbers in header.stamp, wrench.force or wrench.torque ({error})") from error


DECODERS: dict[str, Callable[[bytes], Sample]] = {"cdr": decode_cdr, "ros1": decode_ros1, "json": decode_json}
"""The decoder of each message encoding of MCAP that is read."""


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r:.40} is no number")
    return float(value)


def _unpack(layout: str, message: bytes, place: int) -> tuple[Any, ...]:
    try:
        return struct.unpack_from(layout, message, place)
    except struct.error:
        raise ValueError(f"{len(message)} bytes, too few for a WrenchStamped") from None


def _unpack_end(layout: str, message: bytes, place: int) -> tuple[Any, ...]:
    """The last numbers of a message; CDR may add up to seven bytes after them."""
    numbers = _unpack(layout, message, place)
    rest = len(message) - place - struct.calcsize(layout)
    if rest > 7:
        raise ValueError(f"{rest} bytes after the torque, expected a WrenchStamped")
    return numbers
