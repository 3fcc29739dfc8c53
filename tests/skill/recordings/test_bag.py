"""Bags of ROS 1 and ROS 2: their files, folders and topics, what a killed recorder leaves, and damage of every kind."""

import os
import re
import sqlite3
import subprocess
import sys
from contextlib import closing

import numpy as np
import pytest
import yaml
from mcap.writer import CompressionType
from rosbags import rosbag2
from rosbags.typesys import Stores, get_typestore

from skill.recordings import bag, column_table
from skill.recordings.bag import REINDEX, read_bag
from tests.skill.recordings.wrench_messages import (
    START,
    cdr,
    check_series,
    ros1,
    series,
    write_bag,
    write_db3,
    write_mcap,
)

WRITERS = {".mcap": (write_mcap, cdr), ".db3": (write_db3, cdr), ".bag": (write_bag, ros1)}
STORE = get_typestore(Stores.ROS2_HUMBLE)
WRENCH, STAMPED = "geometry_msgs/msg/Wrench", "geometry_msgs/msg/WrenchStamped"


@pytest.fixture(params=WRITERS)
def write(request, tmp_path):
    """Writes a series and a picture to a file of each kind."""
    writer, encode = WRITERS[request.param]

    def write_file(name="a b", first=0, last=50, **options):
        path = tmp_path / f"{name}{request.param}"
        path.unlink(missing_ok=True)
        writer(path, [("/camera", 1, b"picture"), *list(series(write=encode, **options))[first:last]])
        return path

    return write_file


def test_the_only_topic_is_read(write):
    path = write("a b#?")
    [found] = read_bag(path)
    assert found.name == path.name
    check_series(found)
    assert sorted(path.parent.iterdir()) == [path]


def test_without_stamps_the_time_is_that_of_logging(write):
    check_series(read_bag(write(start=0))[0], offset=0.005)


def test_the_files_of_a_folder_are_one_recording(write, tmp_path):
    for part, name in enumerate(["bag_10", "bag_2"]):
        write(name, 25 * part, 25 * part + 25)
    [found] = read_bag(tmp_path)
    assert found.name == tmp_path.name
    check_series(found)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("use_chunking", [True, False])
@pytest.mark.parametrize(
    ("encoding", "encode", "schema"), [("cdr", cdr, STAMPED), ("ros1", ros1, "geometry_msgs/WrenchStamped")]
)
def test_mcap_of_every_encoding_and_compression(tmp_path, compression, use_chunking, encoding, encode, schema):
    options = {"compression": compression, "use_chunking": use_chunking, "chunk_size": 1000}
    write_mcap(tmp_path / "a.mcap", list(series(write=encode))[::-1], encoding=encoding, schema=schema, **options)
    check_series(read_bag(tmp_path / "a.mcap")[0])


def test_one_of_several_topics_is_chosen(tmp_path):
    path = tmp_path / "a.mcap"
    write_mcap(path, [*series(), *series(10, topic="/tool"), ("/tool", 1, b"not decoded")][:-1])
    assert len(read_bag(path, topic="/tool")[0].time) == 10
    with pytest.raises(ValueError, match=r"found topics \['/ft', '/tool'\] of this type; say which one"):
        read_bag(path)
    message = f"expected topic '/camera' of the type {STAMPED} or {WRENCH}; found none"
    with pytest.raises(ValueError, match=re.escape(message) + r", but other topics \['/camera', '/ft', '/tool'\]"):
        read_bag(path, topic="/camera")


def test_a_wrench_without_a_header_is_read_if_the_user_names_its_topic(tmp_path):
    path = tmp_path / "a.db3"
    write_db3(path, [("/ft", START * 10**9 + k * 10**7, b"\0\1\0\0" + cdr()[-48:]) for k in range(5)], kind=WRENCH)
    [found] = read_bag(path, topic="/ft")
    assert found.values.tolist() == [[1.0, -2.5, 3.0, 0.25, 5e-3, -6.0]] * 5
    np.testing.assert_allclose(found.time, START + np.arange(5) / 100, rtol=0, atol=1e-6)
    with pytest.raises(ValueError, match=rf"expected a topic of the type {STAMPED}; found none, but other topics"):
        read_bag(path)


# ------------------------------------------------------------ folders of ROS 2


def write_folder(path, plugin="SQLITE3", compression=None):
    """Writes a bag of 20 messages with the writer of the package rosbags; returns its wrenches."""
    numbers = np.random.default_rng(0).normal(size=(20, 6))
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin])
    if compression:
        writer.set_compression(rosbag2.CompressionMode[compression], rosbag2.CompressionFormat.ZSTD)
    with writer:
        ft = writer.add_connection("/ft", STAMPED, typestore=STORE)
        text = writer.add_connection("/text", "std_msgs/msg/String", typestore=STORE)
        for k, row in enumerate(numbers):
            logged = START * 10**9 + k * 2_000_000
            writer.write(ft, logged, cdr(START, k * 2_000_000, wrench=row))
            note = STORE.serialize_cdr(STORE.types["std_msgs/msg/String"]("a note"), "std_msgs/msg/String")
            writer.write(text, logged, note)
    return numbers


@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
@pytest.mark.parametrize("compression", [None, "MESSAGE", "FILE"])
def test_folders_of_ros_2_are_read_compressed_or_not(tmp_path, plugin, compression):
    numbers = write_folder(tmp_path / "bag", plugin, compression)
    [found] = read_bag(tmp_path / "bag")
    np.testing.assert_array_equal(found.values, numbers)
    np.testing.assert_allclose(found.time, START + 0.002 * np.arange(20), rtol=0, atol=1e-6)
    if compression != "FILE":
        [found] = read_bag(next((tmp_path / "bag").glob("bag.*")))
        np.testing.assert_array_equal(found.values, numbers)


DECLARED = {  # what a folder declares wrongly, and what the refusal says
    "too many": ({"message_count": 27}, "has 20 messages, but the bag declares 27; 7 are missing"),
    "too few": ({"message_count": 19}, "has 20 messages, but the bag declares 19; 1 are too many"),
    "a lost file": ({"path": "b.db3"}, "Some database files are missing"),
    "nothing": (None, "not a complete bag (A metadata key is missing"),
    "no YAML": ("[1", "not a complete bag (Could not load YAML"),
}


@pytest.mark.parametrize("name", DECLARED)
def test_a_folder_that_has_not_what_it_declares_is_refused(tmp_path, name):
    change, message = DECLARED[name]
    write_folder(tmp_path / "bag")
    file = tmp_path / "bag" / "metadata.yaml"
    content = yaml.safe_load(file.read_text())
    information = content["rosbag2_bagfile_information"]
    if isinstance(change, dict):
        information["topics_with_message_count"][0] |= {k: v for k, v in change.items() if k != "path"}
        information["relative_file_paths"] = [change.get("path", "bag.db3")]
    file.write_text(change if isinstance(change, str) else yaml.safe_dump(content if change else {"operator": "me"}))
    with pytest.raises(ValueError, match=re.escape(str(tmp_path / "bag"))) as refused:
        read_bag(tmp_path / "bag")
    assert message in str(refused.value)
    assert str(refused.value).endswith(REINDEX)
    assert "\n" not in str(refused.value)


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
@pytest.mark.parametrize("place", ["bag/bag_0.db3", "link.db3", "bag"])
def test_what_a_killed_recorder_had_committed_is_read_and_the_folder_stays_as_it_is(
    tmp_path, mode, ending, count, place
):
    (tmp_path / "bag").mkdir()
    path = tmp_path / "bag" / "bag_0.db3"
    write_db3(path, series(start=0))
    (tmp_path / "link.db3").symlink_to(path)
    subprocess.run([sys.executable, "-c", KILLED, mode, str(path)], check=True)
    before = {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in path.parent.iterdir()}
    assert before[f"bag_0.db3{ending}"][0]
    [found] = read_bag(tmp_path / place)
    assert len(found.time) == count
    assert found.values[49, 0] == 49
    assert {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in path.parent.iterdir()} == before


@pytest.mark.parametrize("mode", ["WAL", "DELETE"])
def test_a_folder_that_declares_its_files_is_completed_too(tmp_path, mode):
    numbers = write_folder(tmp_path / "bag")
    path = tmp_path / "bag" / "bag.db3"
    program = KILLED.replace("topic_id = 2", "topic_id = 1").replace("(2, ?, ?)", "(1, ?, ?)")
    subprocess.run([sys.executable, "-c", program.replace('mode == "WAL"', "False"), mode, str(path)], check=True)
    [found] = read_bag(tmp_path / "bag")
    np.testing.assert_array_equal(found.values, numbers)


# --------------------------------------------------------------------- damage


def execute(path, statement, values=()):
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(statement, values)


def test_a_file_that_is_cut_off_is_refused(write):
    path = write()
    whole = path.read_bytes()
    for size in (0, 1, 50, len(whole) // 3, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(ValueError, match=rf"a b\{path.suffix}: not a complete bag \(.*\); .*'") as refused:
            read_bag(path)
        assert "\n" not in str(refused.value)


def test_an_mcap_file_that_was_not_finished_is_refused(tmp_path):
    for options in ({"finish": False}, {"use_statistics": False}):
        write_mcap(tmp_path / "a.mcap", series(), **options)
        with pytest.raises(ValueError, match=r"a\.mcap: not a complete bag \(.*'mcap recover' makes one"):
            read_bag(tmp_path / "a.mcap")


CONTENT = [
    ("UPDATE topics SET serialization_format = 'xml'", [], "encoding 'xml', expected cdr or ros1"),
    ("UPDATE messages SET timestamp = 'noon' WHERE id = 3", [], "not a complete bag"),
    ("UPDATE messages SET data = 'text' WHERE id = 3", [], "not a complete bag"),
    ("UPDATE messages SET data = x'00010000' WHERE id = 3", [], "Could not deserialize"),
    ("UPDATE messages SET data = ? WHERE id = 3", [cdr() + bytes(8)], "message size mismatch"),
    ("DROP TABLE messages", [], "database missing tables"),
    ("DELETE FROM messages", [], "topic '/ft' has no messages"),
    ("DELETE FROM messages WHERE id > 2", [], "found 1 samples, expected at least 2"),
    (
        "UPDATE messages SET data = ? WHERE id = 3",
        [cdr(0, 0, wrench=[np.inf] * 6)],
        "column 'fx' is infinite in message",
    ),
]


@pytest.mark.parametrize(("statement", "values", "message"), CONTENT)
def test_wrong_content_is_refused(tmp_path, statement, values, message):
    path = tmp_path / "a.db3"
    write_db3(path, [("/camera", 1, b"a"), *series(start=0)])
    execute(path, statement, values)
    with pytest.raises(ValueError, match=rf"a\.db3: .*{message}"):
        read_bag(path)


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_compressed_chunks_of_ros_1_are_read(tmp_path, compression):
    write_bag(tmp_path / "a.bag", series(write=ros1), compression=compression)
    check_series(read_bag(tmp_path / "a.bag")[0])


def test_a_chunk_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    write_mcap(tmp_path / "a.mcap", series())
    monkeypatch.setattr(bag, "MAX_UNPACKED", 3000)
    with pytest.raises(ValueError, match=r"a\.mcap: .*a chunk unpacks to \d+ bytes, expected at most 3000"):
        read_bag(tmp_path / "a.mcap")


def test_limits_and_missing_files(write, monkeypatch):
    path = write()
    monkeypatch.setattr(column_table, "MAX_SAMPLES", 49)
    with pytest.raises(ValueError, match=r"50 samples, expected at most 49"):
        read_bag(path)
    with pytest.raises(ValueError, match="no such file"):
        read_bag(path.with_stem("b"))
    os.mkfifo(path.with_stem("pipe"))
    with pytest.raises(ValueError, match="a device or pipe, expected a file"):
        read_bag(path.with_stem("pipe"))
