"""Files of a rosbag2 in SQLite, written with the tables of ROS 2, by the package rosbags, and with damage."""

import sqlite3
import subprocess
import sys
from contextlib import closing

import numpy as np
import pytest

from skill.recordings.messages import sqlite_bag, wrench_topics
from skill.recordings.messages.mcap_file import read_mcap_file
from skill.recordings.messages.sqlite_bag import ZSTD, read_sqlite_bag
from tests.skill.recordings.messages.wrench_messages import START, check_series, series, write_db3


def execute(path, statement, values=()):
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(statement, values)


@pytest.mark.parametrize(("start", "offset"), [(START, 0.0), (0, 0.005)])
def test_the_only_topic_is_read(tmp_path, start, offset):
    path = tmp_path / "a b#?.db3"
    write_db3(path, [("/camera", 1, b"picture"), *series(start=start)])
    [found] = read_sqlite_bag(path)
    assert found.name == path.name
    check_series(found, offset=offset)
    assert sorted(tmp_path.iterdir()) == [path]


def test_a_folder_of_parts_is_one_recording(tmp_path):
    messages = list(series())
    write_db3(tmp_path / "bag_1.db3", messages[30:])
    write_db3(tmp_path / "bag_0.db3", messages[:30])
    check_series(read_sqlite_bag(tmp_path)[0])


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
@pytest.mark.parametrize("compression", [None, "MESSAGE"])
def test_bags_of_another_writer(tmp_path, plugin, compression):
    """The package rosbags has definitions of the messages and a serialisation of its own."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="needs the extra [dev]")
    from rosbags.typesys import Stores, get_typestore

    if compression and plugin == "MCAP":
        pytest.skip("its chunks are compressed")
    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types
    numbers = np.random.default_rng(0).normal(size=(20, 6))
    writer = rosbag2.Writer(tmp_path / "bag", version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
    if compression:
        writer.set_compression(rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    with writer:
        ft = writer.add_connection("/ft", "geometry_msgs/msg/WrenchStamped", typestore=store)
        text = writer.add_connection("/text", "std_msgs/msg/String", typestore=store)
        for k, row in enumerate(numbers):
            vectors = (kinds["geometry_msgs/msg/Vector3"](*part) for part in np.split(row, 2))
            stamp = kinds["builtin_interfaces/msg/Time"](START, k * 2_000_000)
            message = kinds["geometry_msgs/msg/WrenchStamped"](
                kinds["std_msgs/msg/Header"](stamp, "ft_link"), kinds["geometry_msgs/msg/Wrench"](*vectors)
            )
            logged = START * 10**9 + k * 2_000_000
            writer.write(ft, logged, bytes(store.serialize_cdr(message, "geometry_msgs/msg/WrenchStamped")))
            note = kinds["std_msgs/msg/String"]("a note")
            writer.write(text, logged, bytes(store.serialize_cdr(note, "std_msgs/msg/String")))
    read = read_sqlite_bag if plugin == "SQLITE3" else read_mcap_file
    if compression:
        with pytest.raises(ValueError, match=r"compressed; convert it with 'ros2 bag convert' first"):
            read(tmp_path / "bag")
        return
    [found] = read(tmp_path / "bag")
    np.testing.assert_array_equal(found.values, numbers)
    np.testing.assert_allclose(found.time, START + 0.002 * np.arange(20), rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("statement", "values", "message"),
    [
        ("UPDATE topics SET serialization_format = 'xml'", [], "encoding 'xml', expected cdr or ros1 or json"),
        ("UPDATE topics SET name = x'00' WHERE id = 2", [], "topic 2 has no name, type or format"),
        ("UPDATE messages SET timestamp = 'noon' WHERE id = 3", [], "topic '/ft' has a message without time"),
        ("UPDATE messages SET data = 'text' WHERE id = 3", [], "topic '/ft' has a message without time or content"),
        ("UPDATE messages SET data = ? WHERE id = 3", [ZSTD + b"1"], "its messages are compressed; convert"),
        ("UPDATE messages SET data = x'00010000' WHERE id = 3", [], "4 bytes, too few for a WrenchStamped"),
        ("UPDATE messages SET data = zeroblob(2000000) WHERE id = 3", [], "string or blob too big"),
        ("DROP TABLE messages", [], "no such table: messages"),
        ("DELETE FROM messages", [], "topic '/ft' has no messages"),
    ],
)
def test_wrong_content_is_refused(tmp_path, statement, values, message):
    path = tmp_path / "a.db3"
    write_db3(path, series())
    execute(path, statement, values)
    with pytest.raises(ValueError, match=rf"a\.db3: .*{message}"):
        read_sqlite_bag(path)


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    path = tmp_path / "a.db3"
    write_db3(path, series(500))
    whole = path.read_bytes()
    for size in (1, 50, 4096, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(ValueError, match=r"a\.db3: not a complete file of a rosbag2"):
            read_sqlite_bag(path)


KILLED = """
import os, sqlite3, sys
mode, path = sys.argv[1:]
bag = sqlite3.connect(path, isolation_level=None)
bag.execute(f"PRAGMA journal_mode={mode}")
bag.execute("PRAGMA wal_autocheckpoint=0")
bag.execute("PRAGMA cache_size=1")
rows = bag.execute("SELECT timestamp, data FROM messages WHERE topic_id = 2").fetchall()
bag.execute("BEGIN")
bag.executemany("UPDATE messages SET data = ? WHERE timestamp = ?", [(data, time) for time, data in rows])
if mode == "WAL":
    late = rows[-1][0] + 10_000_000
    bag.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (2, ?, ?)", [late, rows[-1][1]])
    bag.execute("COMMIT")
    bag.execute("BEGIN")
bag.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (2, ?, ?)", rows * 20)
os._exit(0)
"""


@pytest.mark.parametrize(("mode", "ending", "count"), [("WAL", "-wal", 51), ("DELETE", "-journal", 50)])
@pytest.mark.parametrize("link", [False, True])
def test_what_a_killed_recorder_had_committed_is_read_and_the_folder_stays_as_it_is(
    tmp_path, mode, ending, count, link
):
    (tmp_path / "bag").mkdir()
    path = tmp_path / "bag" / "bag_0.db3"
    write_db3(path, series(start=0))
    subprocess.run([sys.executable, "-c", KILLED, mode, str(path)], check=True)
    before = {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in path.parent.iterdir()}
    assert before[f"bag_0.db3{ending}"][0]
    source = path
    if link:
        source = tmp_path / "link.db3"
        source.symlink_to(path)
    for place in (source, path.parent):
        [found] = read_sqlite_bag(place)
        assert len(found.time) == count
        assert found.values[49, 0] == 49
    assert {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in path.parent.iterdir()} == before


def test_a_bag_that_was_closed_properly_in_this_mode_is_not_touched(tmp_path):
    path = tmp_path / "a.db3"
    write_db3(path, series())
    execute(path, "PRAGMA journal_mode=WAL")
    check_series(read_sqlite_bag(path)[0])
    assert sorted(tmp_path.iterdir()) == [path]


def test_limits(tmp_path, monkeypatch):
    path = tmp_path / "a.db3"
    write_db3(path, series())
    monkeypatch.setattr(sqlite_bag, "MAX_MESSAGE", 60)
    with pytest.raises(ValueError, match="too big"):
        read_sqlite_bag(path)
    monkeypatch.setattr(wrench_topics, "MAX_BYTES", 1000)
    with pytest.raises(ValueError, match=r"a\.db3: .*expected a file of at most 0 MB"):
        read_sqlite_bag(path)
    with pytest.raises(ValueError, match=r"b\.db3: no such file"):
        read_sqlite_bag(tmp_path / "b.db3")
