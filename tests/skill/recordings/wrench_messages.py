"""Messages of the type WrenchStamped, written byte by byte, and files of them."""

import sqlite3
import struct
from contextlib import closing

import numpy as np

START = 1_700_000_000  # s
WRENCH = (1.0, -2.5, 3.0, 0.25, 5e-3, -6.0)


def cdr(sec=12, nanosec=500_000_000, frame="ft_link", wrench=WRENCH):
    """A message of ROS 2: each number is aligned to its size, counted after the first four bytes."""
    name = frame.encode() + b"\0"
    body = struct.pack("<iII", sec, nanosec, len(name)) + name
    return b"\0\1\0\0" + body + bytes(-len(body) % 8) + struct.pack("<6d", *wrench)


def ros1(sec=12, nanosec=500_000_000, frame="ft_link", wrench=WRENCH):
    name = frame.encode()
    return struct.pack("<4I", 7, sec, nanosec, len(name)) + name + struct.pack("<6d", *wrench)


def series(count=50, write=cdr, topic="/ft", start=START):
    """Messages at 100 Hz, logged 5 ms after their stamp; without a start they have no stamp."""
    time = START + np.arange(count) / 100
    return messages(time if start else np.zeros(count), time + 0.005, frames="ft_link", topic=topic, write=write)


def messages(stamps, logged=None, wrenches=None, frames="ft", topic="/ft", write=cdr):
    """Messages with these stamps, s, logged 5 ms later unless said otherwise; the wrench counts up."""
    for k, stamp in enumerate(stamps):
        ns = round(stamp * 1e9)
        log = ns + 5_000_000 if logged is None else round(logged[k] * 1e9)
        wrench = np.arange(6.0) + k if wrenches is None else wrenches[k]
        frame = frames if isinstance(frames, str) else frames[k]
        yield topic, log, write(ns // 10**9, ns % 10**9, frame, list(wrench))


def check_series(found, count=50, offset=0.0):
    assert found.channels == ("fx", "fy", "fz", "mx", "my", "mz")
    assert found.phases is None
    np.testing.assert_array_equal(found.values, np.arange(count)[:, None] + np.arange(6.0))
    np.testing.assert_allclose(found.time, START + offset + np.arange(count) / 100, rtol=0, atol=1e-6)


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


def write_db3(path, messages, *, encoding="cdr", kind="geometry_msgs/msg/WrenchStamped"):
    """Writes messages (topic, log time in ns, bytes) with the tables of rosbag2_storage_sqlite3."""
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
            " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
        )
        database.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
            " data BLOB NOT NULL)"
        )
        database.execute("INSERT INTO topics VALUES (1, '/camera', 'sensor_msgs/msg/Image', 'cdr', '')")
        topics = {"/camera": 1}
        for topic, logged, data in messages:
            if topic not in topics:
                topics[topic] = len(topics) + 1
                database.execute("INSERT INTO topics VALUES (?, ?, ?, ?, '')", [topics[topic], topic, kind, encoding])
            database.execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", [topics[topic], logged, data]
            )


def write_bag(path, messages, *, compression=None):
    """Writes messages of ROS 1 (topic, log time in ns, bytes) with the writer of the package rosbags."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    connections = {}
    writer = Writer(path)
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    with writer:
        for topic, logged, data in messages:
            if topic not in connections:
                kind = "sensor_msgs/msg/Image" if topic == "/camera" else "geometry_msgs/msg/WrenchStamped"
                connections[topic] = writer.add_connection(topic, kind, typestore=get_typestore(Stores.ROS1_NOETIC))
            writer.write(connections[topic], logged, data)
