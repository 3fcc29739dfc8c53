"""MCAP files, written with the package mcap and with damage of every kind."""

import re
import struct
import sys
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mcap")

from mcap.writer import CompressionType

from skill.recordings import column_table
from skill.recordings.messages import mcap_file, wrench_topics
from skill.recordings.messages.mcap_file import read_mcap_file
from tests.skill.recordings.messages.wrench_messages import as_json, cdr, check_series, ros1, series, write_mcap


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("use_chunking", [True, False])
@pytest.mark.parametrize(
    ("encoding", "write", "schema"),
    [
        ("cdr", cdr, "geometry_msgs/msg/WrenchStamped"),
        ("ros1", ros1, "geometry_msgs/WrenchStamped"),
        ("json", as_json, "geometry_msgs/msg/WrenchStamped"),
    ],
)
def test_the_only_topic_is_read(tmp_path, compression, use_chunking, encoding, write, schema):
    path = tmp_path / "a.mcap"
    messages = [("/camera", 1, b"picture"), *series(write=write)]
    options = {"compression": compression, "use_chunking": use_chunking, "chunk_size": 1000}
    write_mcap(path, messages, encoding=encoding, schema=schema, **options)
    [found] = read_mcap_file(path)
    assert found.name == "a.mcap"
    check_series(found)


def test_without_stamps_the_time_is_that_of_logging(tmp_path):
    write_mcap(tmp_path / "a.mcap", series(start=0))
    check_series(read_mcap_file(tmp_path / "a.mcap")[0], offset=0.005)


def test_messages_are_sorted_by_the_time_of_logging(tmp_path):
    messages = list(series())
    write_mcap(tmp_path / "a.mcap", messages[::-1])
    check_series(read_mcap_file(tmp_path / "a.mcap")[0])


def test_the_parts_of_a_folder_are_one_recording(tmp_path):
    messages = list(series())
    for part, name in enumerate(["bag_10.mcap", "bag_2.mcap"]):
        write_mcap(tmp_path / name, messages[25 * part : 25 * part + 25])
    [found] = read_mcap_file(tmp_path)
    assert found.name == tmp_path.name
    check_series(found)


def test_one_of_several_topics_is_chosen(tmp_path):
    path = tmp_path / "a.mcap"
    write_mcap(path, [*series(), *series(10, topic="/tool")])
    assert len(read_mcap_file(path, topic="/tool")[0].time) == 10
    with pytest.raises(ValueError, match=r"found topics \['/ft', '/tool'\] of this type; say which one"):
        read_mcap_file(path)
    write_mcap(tmp_path / "b.mcap", [*series(), ("/tool", 1, b"not decoded")])
    with pytest.raises(ValueError, match="say which one"):
        read_mcap_file(tmp_path / "b.mcap")
    types = "geometry_msgs/WrenchStamped or geometry_msgs/msg/WrenchStamped"
    message = f"expected topic '/camera' of the type {types}; found none"
    with pytest.raises(ValueError, match=re.escape(message) + r", but other topics \['/camera', '/ft', '/tool'\]"):
        read_mcap_file(path, topic="/camera")


REFUSED = {
    "encoding": (
        {"encoding": "protobuf"},
        list(series()),
        "topic '/ft' has the encoding 'protobuf', expected cdr or ros1",
    ),
    "message": ({}, [("/ft", 1, cdr()[:-1])], "too few for a WrenchStamped"),
    "one": ({}, series(1), "a.mcap: found 1 samples, expected at least 2"),
    "infinite": ({}, [("/ft", k, cdr(k, wrench=[np.inf] * 6)) for k in (1, 2)], "column 'fx' is infinite in message 0"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_messages_are_refused(tmp_path, name):
    options, messages, text = REFUSED[name]
    write_mcap(tmp_path / "a.mcap", messages, **options)
    with pytest.raises(ValueError, match=r"a\.mcap: .") as refused:
        read_mcap_file(tmp_path / "a.mcap")
    assert text in str(refused.value)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_truncated_file_is_refused(tmp_path, compression):
    path = tmp_path / "a.mcap"
    write_mcap(path, series(), compression=compression, chunk_size=1000)
    data = path.read_bytes()
    for length in {*range(0, len(data), 97), len(data) - 1, len(data) - 8, len(data) - 9}:
        path.write_bytes(data[:length])
        with pytest.raises(ValueError, match=r"a\.mcap: not a complete MCAP file \("):
            read_mcap_file(path)
    write_mcap(path, series(), finish=False)
    with pytest.raises(ValueError, match=r"a\.mcap: not a complete MCAP file \("):
        read_mcap_file(path)


@pytest.mark.slow
@pytest.mark.parametrize("compression", list(CompressionType))
def test_changed_bytes_are_refused_or_change_nothing(tmp_path, compression):
    path = tmp_path / "a.mcap"
    write_mcap(path, series(20), compression=compression, chunk_size=600)
    data = path.read_bytes()
    [expected] = read_mcap_file(path)
    rng = np.random.default_rng(0)
    refusals = []
    for place in rng.integers(0, len(data), 300):
        path.write_bytes(data[:place] + bytes([data[place] ^ (1 << int(rng.integers(8)))]) + data[place + 1 :])
        try:
            [found] = read_mcap_file(path)
        except ValueError as error:
            refusals.append(str(error))
        else:
            np.testing.assert_array_equal(found.values, expected.values)
    assert len(refusals) > 100
    assert all("a.mcap" in text for text in refusals)


def chunk(data, compression, size):
    """An MCAP file with one chunk, byte by byte."""
    name = compression.encode()
    body = (
        struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(data)) + data
    )
    magic = bytes([137, 77, 67, 65, 80, 48, 13, 10])
    return magic + b"\x06" + struct.pack("<Q", len(body)) + body


BOMBS = {"zstd": "zstandard", "lz4": "lz4.frame"}


@pytest.mark.parametrize("compression", BOMBS)
@pytest.mark.parametrize("claimed", [10, 10**7, 2**63])
def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch, compression, claimed):
    packed = pytest.importorskip(BOMBS[compression]).compress(bytes(10**7))
    assert len(packed) < 50_000
    path = tmp_path / "a.mcap"
    path.write_bytes(chunk(packed, compression, claimed))
    monkeypatch.setattr(mcap_file, "MAX_RECORD", 1_000_000)
    with pytest.raises(ValueError, match=rf"a chunk of 1000001 bytes, expected {claimed} and at most 1000000 bytes"):
        read_mcap_file(path)


def test_other_damage_of_chunks_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    path.write_bytes(chunk(b"x", "brotli", 1))
    with pytest.raises(ValueError, match="compression 'brotli', expected zstd, lz4 or none"):
        read_mcap_file(path)
    path.write_bytes(chunk(b"x", "", 2))
    with pytest.raises(ValueError, match="a chunk of 1 bytes, expected 2 and at most"):
        read_mcap_file(path)
    path.write_bytes(chunk(b"", "", 0)[:9] + struct.pack("<Q", 2**62))
    with pytest.raises(ValueError, match=f"length {2**62} that exceeds limit"):
        read_mcap_file(path)


def test_limits(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    write_mcap(path, series(10_000))
    monkeypatch.setattr(column_table, "MAX_SAMPLES", 9999)
    with pytest.raises(ValueError, match=r"a\.mcap: .*10000 samples, expected at most 9999"):
        read_mcap_file(path)
    monkeypatch.setattr(wrench_topics, "MAX_BYTES", 1000)
    with pytest.raises(ValueError, match=r"a\.mcap: .*expected a file of at most 0 MB"):
        read_mcap_file(path)
    with pytest.raises(ValueError, match=r"b\.mcap: no such file"):
        read_mcap_file(tmp_path / "b.mcap")


def test_a_missing_package_names_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.stream_reader", None)
    with pytest.raises(
        ValueError, match=r"a\.mcap: .* the extra 'recordings': pip install 'haptic-skill\[recordings\]'"
    ):
        read_mcap_file(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"message_count": 51}, "50 messages, but its statistics say 51"),
        ({"chunk_count": 2}, r"\d+ chunks, but its statistics say 2"),
        ({"channel_message_counts": {2: 49}}, "50 messages of '/ft', but its statistics say 49"),
        ({"channel_message_counts": {2: 50, 9: 4}}, "0 messages of 'channel 9', but its statistics say 4"),
    ],
)
def test_statistics_that_differ_are_refused(tmp_path, monkeypatch, change, message):
    from mcap.records import Statistics

    write = Statistics.write
    monkeypatch.setattr(Statistics, "write", lambda self, stream: write(replace(self, **change), stream))
    write_mcap(tmp_path / "a.mcap", series(), chunk_size=1000)
    with pytest.raises(ValueError, match=rf"a\.mcap: not a complete MCAP file \({message}\); 'mcap recover' makes"):
        read_mcap_file(tmp_path / "a.mcap")


def test_a_file_without_statistics_is_read(tmp_path):
    write_mcap(tmp_path / "a.mcap", series(), use_statistics=False)
    check_series(read_mcap_file(tmp_path / "a.mcap")[0])


def test_a_lost_chunk_is_noticed(tmp_path):
    path = tmp_path / "a.mcap"
    write_mcap(path, series(), chunk_size=1000)
    data = bytearray(path.read_bytes())
    second = data.index(b"zstd", data.index(b"zstd") + 9) - 4 - 8 - 8 - 8 - 4 - 9
    assert data[second] == 6  # the mark of a chunk
    data[second] = 0x86  # that of a record of another program
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"a\.mcap: .*\d\d messages, but its statistics say 50"):
        read_mcap_file(path)
