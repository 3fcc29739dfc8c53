"""Messages of the type WrenchStamped, written byte by byte, and MCAP files of them."""

import json
import struct

WRENCH = (1.0, -2.5, 3.0, 0.25, 5e-3, -6.0)


def cdr(sec=12, nanosec=500_000_000, frame="ft_link", wrench=WRENCH, order="<"):
    """A message of ROS 2: each number is aligned to its size, counted after the first four bytes."""
    name = frame.encode() + b"\0"
    body = struct.pack(f"{order}iII", sec, nanosec, len(name)) + name
    body += bytes(-len(body) % 8) + struct.pack(f"{order}6d", *wrench)
    return (b"\0\1\0\0" if order == "<" else b"\0\0\0\0") + body


def ros1(sec=12, nanosec=500_000_000, frame="ft_link", wrench=WRENCH):
    name = frame.encode()
    return struct.pack("<4I", 7, sec, nanosec, len(name)) + name + struct.pack("<6d", *wrench)


def as_json(sec=12, nanosec=500_000_000, frame="ft_link", wrench=WRENCH, fraction="nanosec"):
    force, torque = (dict(zip("xyz", part, strict=True)) for part in (wrench[:3], wrench[3:]))
    header = {"stamp": {"sec": sec, fraction: nanosec}, "frame_id": frame}
    return json.dumps({"header": header, "wrench": {"force": force, "torque": torque}}).encode()


def write_mcap(path, messages, *, encoding="cdr", schema="geometry_msgs/msg/WrenchStamped", finish=True, **options):
    """Writes messages (topic, log time in ns, bytes) with the writer of the package mcap."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile="ros2", library="a test")
        schema_id = writer.register_schema(schema, "ros2msg", b"")
        other = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"")
        channels = {"/camera": writer.register_channel("/camera", "cdr", other)}
        for topic, log_time, data in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, encoding, schema_id)
            writer.add_message(channels[topic], log_time=log_time, publish_time=log_time, data=data)
        if finish:
            writer.finish()
