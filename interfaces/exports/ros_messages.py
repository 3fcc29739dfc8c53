"""Messages of ROS 2 for logs: geometry_msgs/WrenchStamped and PoseStamped, encoded in CDR.

CDR aligns each number to its size, counted from the end of the four bytes that say the byte order (OMG, DDSI-RTPS 2.3,
section 10). `skill.recordings.messages.wrench_message` decodes them.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

WRENCH, POSE = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PoseStamped"

LITTLE_ENDIAN = b"\0\1\0\0"
BILLION = 1_000_000_000

_SEPARATOR = 80 * "="
_TYPES = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    **dict.fromkeys(("geometry_msgs/Vector3", "geometry_msgs/Point"), "float64 x\nfloat64 y\nfloat64 z"),
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
}


def _schema(fields: str, parts: Sequence[str]) -> str:
    """A message definition, followed by those of the types in it."""
    types = ("std_msgs/Header", "builtin_interfaces/Time", *parts)
    return f"\n{_SEPARATOR}\n".join([fields, *(f"MSG: {name}\n{_TYPES[name]}" for name in types)]) + "\n"


SCHEMAS = {
    WRENCH: _schema(
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench", ("geometry_msgs/Wrench", "geometry_msgs/Vector3")
    ),
    POSE: _schema(
        "std_msgs/Header header\ngeometry_msgs/Pose pose",
        ("geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion"),
    ),
}
"""Definitions of the messages in the notation of ROS 2 (schema encoding ``ros2msg``)."""


def stamped(nanoseconds: int, frame: str, numbers: Sequence[float]) -> bytes:
    """Returns a message of a header and 64-bit floats: a wrench (6) or a pose (7).

    Args:
        nanoseconds: time of the header, not negative.
        frame: name of the coordinate frame.
        numbers: force (N) and torque (N m); or position (m) and quaternion x y z w.
    """
    name = frame.encode() + b"\0"
    head = struct.pack("<iII", nanoseconds // BILLION, nanoseconds % BILLION, len(name)) + name
    return LITTLE_ENDIAN + head + bytes(-len(head) % 8) + struct.pack(f"<{len(numbers)}d", *numbers)
