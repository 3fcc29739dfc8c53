"""Decodes messages of the type WrenchStamped: CDR of ROS 2, the serialization of ROS 1, and JSON.

The layout is that of geometry_msgs/WrenchStamped: a header with a time stamp and the name of a frame, then force and
torque as six 64-bit floats. CDR aligns each number to its size, counted from the end of the four bytes that say the
byte order (OMG, DDSI-RTPS 2.3, section 10).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from skill.data.files import parse_object

SCHEMAS = ("geometry_msgs/WrenchStamped", "geometry_msgs/msg/WrenchStamped")
"""Names of the type in ROS 1 and ROS 2."""


class Sample(NamedTuple):
    """A message.

    Attributes:
        frame: ``frame_id`` of the header; empty if there is none.
        stamp: of the header, s; 0 if there is none.
        wrench: fx fy fz in N and mx my mz in N m.
    """

    frame: str
    stamp: float
    wrench: tuple[float, ...]


def decode_cdr(message: bytes) -> Sample:
    """Decodes a message of ROS 2.

    Raises:
        ValueError: if the message has another layout.
    """
    order = {b"\0\0": ">", b"\0\1": "<"}.get(message[:2])
    if order is None:
        raise ValueError(f"encapsulation {message[:2].hex()}, expected plain CDR (0000 or 0001)")
    seconds, nanoseconds, length = _unpack(f"{order}iII", message, 4)
    place = 4 + (12 + length + 7) // 8 * 8
    wrench = _unpack_end(f"{order}6d", message, place)
    return Sample(_frame(message[16 : 16 + length]), seconds + nanoseconds * 1e-9, wrench)


def decode_ros1(message: bytes) -> Sample:
    """Decodes a message of ROS 1.

    Raises:
        ValueError: if the message has another layout.
    """
    _, seconds, nanoseconds, length = _unpack("<4I", message, 0)
    wrench = _unpack_end("<6d", message, 16 + length)
    return Sample(_frame(message[16 : 16 + length]), seconds + nanoseconds * 1e-9, wrench)


def decode_json(message: bytes) -> Sample:
    """Decodes a message in JSON, with the fields of ROS 1 or ROS 2; null is no number (NaN).

    Raises:
        ValueError: if a field is missing or no number.
    """
    fields = parse_object(message)
    try:
        header = fields.get("header") or {}
        stamp = header.get("stamp") or {}
        seconds = _number(stamp.get("sec", stamp.get("secs", 0)))
        nanoseconds = _number(stamp.get("nanosec", stamp.get("nsec", stamp.get("nsecs", 0))))
        parts = [fields["wrench"][part][axis] for part in ("force", "torque") for axis in "xyz"]
        wrench = tuple(float("nan") if part is None else _number(part) for part in parts)
        return Sample(str(header.get("frame_id") or ""), seconds + nanoseconds * 1e-9, wrench)
    except (KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ValueError(f"no numbers in header.stamp, wrench.force or wrench.torque ({error})") from error


DECODERS: dict[str, Callable[[bytes], Sample]] = {"cdr": decode_cdr, "ros1": decode_ros1, "json": decode_json}
"""The decoder of each message encoding of MCAP that is read."""


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{value!r:.40} is no number")
    return float(value)


def _frame(text: bytes) -> str:
    """The name of a frame, which ends with a zero in ROS 2."""
    return text.rstrip(b"\0").decode(errors="replace")


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
