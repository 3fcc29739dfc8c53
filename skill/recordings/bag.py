"""Reads recordings from bags of ROS 1 and ROS 2 (SQLite or MCAP): the wrenches of one topic, by the package rosbags."""

from __future__ import annotations

import shutil
import sqlite3
import struct
import warnings
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import pandas as pd
from mcap.reader import SeekingReader
from numpy.typing import NDArray
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.msg import normalize_msgtype
from zstandard import ZstdDecompressor

from skill.data.files import check_regular, no_access, one_line
from skill.recordings.column_table import ColumnChoice, check_length, select_columns, table_recordings
from skill.recordings.columns import FORCES, MOMENTS, listed
from skill.recordings.recording import Recording

STAMPED, PLAIN = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench"
"""Types of the messages; one without a header is read only from the topic that the user names."""

STAMP, LOG_TIME = "stamp", "log_time"
"""The two times of a message, as columns: that of its header, and that of logging, s."""

COLUMNS = (LOG_TIME, STAMP, *FORCES, *MOMENTS)
"""What is kept of a message."""

MAX_JUMP = 60.0
"""By how much the header stamps of two messages may differ more than their times of logging, s; else two clocks made
them. Slow networks and the pace of a simulation differ by less."""

MAX_DISORDER = 0.1
"""By how much later than its successor a message may be logged, s; if it is more, the clock was set back."""

BY_LOG_TIME = f"; --columns time={LOG_TIME} takes the time of logging"

UNWRITTEN = ("-wal", "-journal")
"""What SQLite appends to the name of a file with changes that a killed program has left; SQLite completes them."""

ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 has compressed, in a file without the folder that says so."""

REINDEX = "copy what is missing, or let 'ros2 bag reindex' declare what is there"
REMEDIES = {
    ".mcap": "'mcap recover' makes one of what is there",
    ".db3": REINDEX,
    ".bag": "'rosbag reindex' repairs its index",
}
"""What helps with a damaged file, by the ending of its name."""

MAX_RECORD = 100_000_000
"""Largest number of bytes of a record of MCAP."""

MAX_UNPACKED = 200_000_000
"""Largest number of bytes to which a chunk of MCAP may unpack; usual ones have some megabytes."""

NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")


@dataclass
class _Samples:
    """The messages of a topic: the numbers of each, as ``COLUMNS``, and which publisher and frame it has."""

    numbers: array[float] = field(default_factory=lambda: array("d"))
    sources: array[int] = field(default_factory=lambda: array("I"))
    names: dict[tuple[str, str], int] = field(default_factory=dict)


class _McapFile:
    """Reads a file in MCAP as the readers of rosbags do, which take only such files of which all topics are of ROS 2.

    Args:
        stream: the file, open.

    Raises:
        Exception: as the package mcap; a ValueError if the file does not say how many messages it has, or a chunk is
            larger than ``MAX_UNPACKED``.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._reader = SeekingReader(stream, validate_crcs=True, record_size_limit=MAX_RECORD)
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError("no statistics of its messages")
        largest = max((chunk.uncompressed_size for chunk in summary.chunk_indexes), default=0)
        if largest > MAX_UNPACKED:
            raise ValueError(f"a chunk unpacks to {largest} bytes, expected at most {MAX_UNPACKED}")
        self.connections: list[Connection] = []
        for number, channel in summary.channels.items():
            schema = summary.schemas.get(channel.schema_id)
            kind = normalize_msgtype(schema.name) if schema else ""
            count = summary.statistics.channel_message_counts.get(number, 0)
            encoding: ConnectionExtRosbag1 | ConnectionExtRosbag2 = ConnectionExtRosbag2(channel.message_encoding, [])
            if channel.message_encoding == "ros1":
                encoding = ConnectionExtRosbag1(channel.metadata.get("callerid"), None)
            self.connections.append(Connection(number, channel.topic, kind, NO_DEFINITION, "", count, encoding, self))

    def messages(self, connections: Sequence[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yields the connection, the time of logging, ns, and the content of each message of a topic."""
        by_number = {connection.id: connection for connection in connections}
        for _, channel, message in self._reader.iter_messages(connections[0].topic, log_time_order=False):
            yield by_number[channel.id], message.log_time, message.data


_Reader: TypeAlias = rosbag1.Reader | rosbag2.Reader | _McapFile


def read_bag(path: Path, *, topic: str | None = None, columns: Sequence[str] = ()) -> list[Recording]:
    """Reads the recording of a wrench topic from a file, or from the folder of a bag.

    The channels are fx fy fz mx my mz. The time is that of the headers; if no header has one, it is the time of
    logging. Messages without values (NaN), those before the first stamp, and those that are there twice are left out,
    with a warning. Messages that were logged in another order than that of their stamps are sorted.

    Args:
        path: file with an ending of ``REMEDIES``, or folder with such files; ``metadata.yaml`` says which, if it is
            there.
        topic: topic to read; None for the only one of the type WrenchStamped.
        columns: choices of the user, as of `skill.recordings.columns.choose_columns`, among ``COLUMNS``.

    Raises:
        ValueError: if there is no topic of this type, or several; if there are several frames, or publishers at the
            same time; if the stamps are of several clocks, go back or repeat; if there are not as many messages as
            the bag declares; if a file is damaged, or the samples are no valid recording.
    """
    samples = _Samples()
    parts = _parts(path)
    with ExitStack() as stack:
        readers: list[_Reader] = []
        for part in parts:
            with _named_damage(part):
                readers.append(_opened(part, stack))
        found = [connection for reader in readers for connection in reader.connections]
        topic = _chosen_topic(found, topic, path)
        encodings = {getattr(c.ext, "serialization_format", "ros1") for c in found if c.topic == topic}
        for encoding in encodings - {"cdr", "ros1"}:
            raise ValueError(f"{path}: topic '{topic}' has the encoding '{encoding}', expected cdr or ros1")
        declared = sum(connection.msgcount for connection in found if connection.topic == topic)
        check_length(declared, str(path))
        for part, reader in zip(parts, readers, strict=True):
            with _named_damage(part):
                _take_messages(reader, topic, samples)
    where = f"{path}: topic '{topic}'"
    count = len(samples.sources)
    if count != declared:
        wrong = f"{abs(declared - count)} are {'missing' if count < declared else 'too many'}"
        raise ValueError(f"{where} has {count} messages, but the bag declares {declared}; {wrong}; {REINDEX}")
    if not count:
        raise ValueError(f"{where} has no messages")
    return _recordings(samples, columns, path, where)


def _parts(path: Path) -> list[Path]:
    """What is opened of a bag: its folder, if that declares its files, or each file."""
    if not path.is_dir() or (path / "metadata.yaml").is_file():
        return [path]
    return sorted(part for part in path.iterdir() if part.suffix in REMEDIES)


@contextmanager
def _named_damage(path: Path) -> Iterator[None]:
    """Names the file that cannot be read; rosbags raises errors of many types for damaged files."""
    try:
        yield
    except (FileNotFoundError, PermissionError) as error:
        raise ValueError(f"{path}: {no_access(error)}") from None
    except Exception as error:
        remedy = REMEDIES.get(path.suffix, REINDEX)
        raise ValueError(f"{path}: not a complete bag ({one_line(error)}); {remedy}") from error


def _opened(path: Path, stack: ExitStack) -> _Reader:
    """A reader of a part, which the stack closes."""
    if not path.is_dir():
        check_regular(path)
        path.open("rb").close()
    if path.suffix == ".mcap":
        return _McapFile(stack.enter_context(path.open("rb")))
    if path.suffix == ".bag":
        return stack.enter_context(rosbag1.Reader(path))
    return stack.enter_context(rosbag2.Reader(_completed(path, stack)))


def _completed(path: Path, stack: ExitStack) -> Path:
    """A link to a bag in SQLite, or a copy that SQLite has completed where a killed recorder has left changes.

    The folder of the bag stays as it is. The link has a name without signs that SQLite takes for options.
    """
    path = path.resolve()
    databases = sorted(path.glob("*.db3")) if path.is_dir() else [path]
    if not databases:
        return path
    beside = [database.with_name(database.name + ending) for database in databases for ending in UNWRITTEN]
    beside = [file for file in beside if file.is_file() and file.stat().st_size]
    copy = Path(stack.enter_context(TemporaryDirectory())) / f"bag{path.suffix}"
    if not beside:
        copy.symlink_to(path)
    elif path.is_dir():
        shutil.copytree(path, copy)
    else:
        for file in (path, *beside):
            shutil.copyfile(file, copy.with_name(copy.name + file.name.removeprefix(path.name)))
    for database in sorted(copy.glob("*.db3")) if copy.is_dir() else [copy]:
        if beside:
            with closing(sqlite3.connect(database)) as changed:
                changed.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                changed.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
        _check_whole(database)
    return copy


def _check_whole(database: Path) -> None:
    """Refuses a database that is cut off; SQLite reads zeros where the last page is missing."""
    with database.open("rb") as stream:
        page_size, pages = struct.unpack(">16xH10xI", stream.read(32))
    expected = pages * (65536 if page_size == 1 else page_size)
    if database.stat().st_size < expected:
        raise ValueError(f"{database.stat().st_size} bytes, expected {expected}")


def _chosen_topic(connections: Sequence[Connection], wanted: str | None, path: Path) -> str:
    """The topic that the user names, or the only one of the type WrenchStamped."""
    topics = {connection.topic for connection in connections}
    types = (STAMPED,) if wanted is None else (STAMPED, PLAIN)
    found = sorted({c.topic for c in connections if c.msgtype in types and wanted in (None, c.topic)})
    if len(found) == 1:
        return found[0]
    expected = f"topic '{wanted}'" if wanted else "a topic"
    what = f"topics {listed(found)} of this type; say which one" if found else "none"
    others = f", but other topics {listed(sorted(topics))}" if topics and not found else ""
    raise ValueError(f"{path}: expected {expected} of the type {' or '.join(types)}; found {what}{others}")


@cache
def _decoder(*, ros1: bool) -> Callable[[bytes, str], Any]:
    """What decodes messages of ROS 1, or of ROS 2."""
    if ros1:
        return get_typestore(Stores.ROS1_NOETIC).deserialize_ros1
    return get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr


def _take_messages(reader: _Reader, topic: str, samples: _Samples) -> None:
    """Appends the messages of a topic."""
    connections = [connection for connection in reader.connections if connection.topic == topic]
    if not connections:
        return
    decoders = {c.id: _decoder(ros1=isinstance(c.ext, ConnectionExtRosbag1)) for c in connections}
    for connection, logged, data in reader.messages(connections):
        if data.startswith(ZSTD):
            data = ZstdDecompressor().decompress(data)
        message = decoders[connection.id](data, connection.msgtype)
        frame, stamp, wrench = "", 0.0, message
        if connection.msgtype == STAMPED:
            frame, wrench = message.header.frame_id.strip("/"), message.wrench
            stamp = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        force, torque = wrench.force, wrench.torque
        samples.numbers.extend((logged * 1e-9, stamp, force.x, force.y, force.z, torque.x, torque.y, torque.z))
        publisher = getattr(connection.ext, "callerid", None) or f"connection {connection.id}"
        samples.sources.append(samples.names.setdefault((publisher, frame), len(samples.names)))


def _recordings(samples: _Samples, choices: Sequence[str], path: Path, where: str) -> list[Recording]:
    """The recording of the messages of a topic, at least one."""
    table = pd.DataFrame(np.frombuffer(samples.numbers).reshape(-1, len(COLUMNS)), columns=list(COLUMNS))
    table["source"] = np.asarray(samples.sources)
    table = table.sort_values(LOG_TIME, kind="stable", ignore_index=True)
    table = _without(table, table[[*FORCES, *MOMENTS]].isna().all(axis=1).to_numpy(), "no values (NaN)", where)
    if not any(text.partition("=")[0].strip().lower() == "time" for text in choices):
        choices = [*choices, f"time={STAMP if table[STAMP].any() else LOG_TIME}:s"]
    selection = select_columns(COLUMNS, str(path), ColumnChoice(choices))
    if selection.columns[0].name == STAMP:
        table = _by_stamp(table, where)
    _check_sources(table, list(samples.names), where)
    return table_recordings(table, selection, str(path), path.name, row_name=lambda row: f"message {table.index[row]}")


def _check_sources(table: pd.DataFrame, names: Sequence[tuple[str, str]], where: str) -> None:
    """Refuses messages of several frames, or of publishers that send at the same time."""
    used = [names[source] for source in table["source"].unique()]
    frames = sorted({frame for _, frame in used})
    if len(frames) > 1:
        raise ValueError(f"{where} has messages of the frames {listed(frames)}, expected those of one sensor")
    logged = table[LOG_TIME].groupby(table["source"]).agg(["min", "max"]).sort_values("min")
    if (logged["min"].to_numpy()[1:] < np.maximum.accumulate(logged["max"].to_numpy())[:-1]).any():
        publishers = sorted({publisher for publisher, _ in used})
        raise ValueError(f"{where} has messages of {listed(publishers)} at the same time, expected one publisher")


def _without(table: pd.DataFrame, out: NDArray[np.bool_], why: str, where: str) -> pd.DataFrame:
    """Leaves messages out, and says so."""
    if not out.any():
        return table
    warnings.warn(f"{where}: {out.sum()} of {len(out)} messages left out, which have {why}", UserWarning, stacklevel=2)
    return table[~out]


def _by_stamp(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """Sorts messages, which are in the order of logging, by their stamps, and leaves out those without and repeats."""
    stamps = table[STAMP].to_numpy()
    unset = int(np.argmax(stamps != 0)) if stamps.any() else 0
    if unset > 1 or (unset == 1 and abs(stamps[1]) > 1.0):  # a simulation may begin at 0 s
        table = _without(table, np.arange(len(table)) < unset, f"no time stamp{BY_LOG_TIME}", where)
    stamps, logged = table[STAMP].to_numpy(), table[LOG_TIME].to_numpy()
    steps = np.diff(stamps)
    jumps = np.flatnonzero(~(np.abs(steps - np.diff(logged)) <= MAX_JUMP))
    if jumps.size:
        _refuse(table, jumps, f"jump by {steps[jumps[0]]:.9g} s, to that of another clock,", where)
    table = table.iloc[np.lexsort((table["source"], stamps))]
    logged = table[LOG_TIME].to_numpy()
    if np.any(steps < 0) and (np.maximum.accumulate(logged) - logged).max() > MAX_DISORDER:
        _refuse(table.sort_index(), np.flatnonzero(steps < 0), "go back", where)
    same = table.duplicated([STAMP, *FORCES, *MOMENTS]).to_numpy()
    table = _without(table, same, "the stamp and the values of another", where)
    repeated = np.flatnonzero(np.diff(table[STAMP]) == 0)
    if repeated.size:
        _refuse(table, repeated, "repeat", where)
    return table


def _refuse(table: pd.DataFrame, before: NDArray[Any], what: str, where: str) -> None:
    """Raises the error that the stamps do something wrong after some messages."""
    first, second = table.iloc[before[0]], table.iloc[before[0] + 1]
    raise ValueError(
        f"{where}: the header stamps {what} from {first[STAMP]:.16g} s to {second[STAMP]:.16g} s in message"
        f" {second.name} ({len(before)} such), expected times that increase{BY_LOG_TIME}"
    )
