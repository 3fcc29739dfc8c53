"""Reads recordings from MCAP files: the WrenchStamped messages of one topic, encoded by ROS 1, ROS 2 or as JSON."""

from __future__ import annotations

import io
import stat
import struct
from array import array
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from skill.data.tables import one_line
from skill.recordings.column_table import check_length
from skill.recordings.columns import FORCES, MOMENTS, listed
from skill.recordings.recording import Recording
from skill.recordings.wrench_message import DECODERS, SCHEMAS

if TYPE_CHECKING:
    from mcap.records import Chunk

MAX_BYTES = 20_000_000_000
"""Largest size of a file; it is read piece by piece."""

MAX_RECORD = 100_000_000
"""Largest number of bytes of a piece (a record of MCAP), packed and unpacked; usual chunks have some megabytes."""


def read_mcap_file(path: Path, *, topic: str | None = None) -> list[Recording]:
    """Reads the recording of a wrench topic from an MCAP file, or from a folder of the parts of one recording.

    The samples are sorted by the time at which they were logged. Their time is that of their headers; if no header has
    a time, it is the time of logging. The channels are fx fy fz mx my mz.

    Args:
        path: MCAP file, or folder with ``*.mcap`` files, as rosbag2 writes it.
        topic: topic to read; None for the only one of the type WrenchStamped.

    Raises:
        ValueError: if the package ``mcap`` is missing; if the file is missing, damaged or too large; if it has no such
            topic, or several and none is chosen; or if the samples are no valid recording. The message names the file.
    """
    _require_mcap(path)
    paths = sorted(path.glob("*.mcap")) if path.is_dir() else [path]
    topics: dict[str, array[float]] = {}
    others: set[str] = set()
    for part in paths:
        try:
            _read_part(part, topic, topics, others)
        except FileNotFoundError:
            raise ValueError(f"{part}: no such file") from None
        except _errors() as error:
            raise ValueError(f"{part}: not a complete MCAP file ({one_line(error)})") from error
    if len(topics) != 1:
        found = f"topics {listed(sorted(topics))} of this type; say which one" if topics else "none"
        wanted = f"topic '{topic}'" if topic else "a topic"
        raise ValueError(
            f"{path}: expected {wanted} of the type {' or '.join(SCHEMAS)}; found {found}"
            + (f", but other topics {listed(sorted(others))}" if others and not topics else "")
        )
    [(found_topic, numbers)] = topics.items()
    if not numbers:
        raise ValueError(f"{path}: topic '{found_topic}' has no messages")
    rows = np.frombuffer(numbers).reshape(-1, 8)
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    logged, stamps = rows[:, 0], rows[:, 1]
    return [Recording(path.name, stamps if stamps.any() else logged, rows[:, 2:], (*FORCES, *MOMENTS))]


def _require_mcap(path: Path) -> None:
    """Refuses to go on without the package."""
    try:
        import mcap.stream_reader  # noqa: F401
    except ImportError as error:
        raise ValueError(
            f"{path}: reading MCAP needs the extra 'recordings': pip install 'haptic-skill[recordings]' ({error})"
        ) from error


def _errors() -> tuple[type[Exception], ...]:
    """What reading a damaged file may raise."""
    from mcap.exceptions import McapError

    damaged: tuple[type[Exception], ...] = (OSError, ValueError, RuntimeError, struct.error, MemoryError, OverflowError)
    try:
        from zstandard import ZstdError
    except ImportError:
        return (*damaged, McapError)
    return (*damaged, McapError, ZstdError)


def _read_part(path: Path, topic: str | None, topics: dict[str, array[float]], others: set[str]) -> None:
    """Appends log time, stamp and wrench of all messages of a file to the array of their topic."""
    from mcap.records import Channel, Message, Schema, Statistics

    status = path.stat()
    if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_BYTES:
        raise ValueError(f"{status.st_size / 1e6:.0f} MB, expected a file of at most {MAX_BYTES / 1e6:.0f} MB")
    schemas: dict[int, str] = {}
    wrenches: dict[int, tuple[Any, array[float]]] = {}
    messages, stated = 0, None
    with path.open("rb") as stream:
        for record in _records(stream):
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                if schemas.get(record.schema_id) not in SCHEMAS or topic not in (None, record.topic):
                    others.add(record.topic)
                    continue
                decode = DECODERS.get(record.message_encoding)
                if decode is None:
                    raise ValueError(
                        f"topic '{record.topic}' has the encoding '{record.message_encoding}',"
                        f" expected {' or '.join(DECODERS)}"
                    )
                wrenches[record.id] = decode, topics.setdefault(record.topic, array("d"))
            elif isinstance(record, Statistics):
                stated = record.message_count
            elif isinstance(record, Message):
                messages += 1
                if record.channel_id not in wrenches or len(topics) > 1:
                    continue
                decode, numbers = wrenches[record.channel_id]
                numbers.append(record.log_time * 1e-9)
                numbers.extend(decode(record.data))
                if len(numbers) % 80_000 == 0:
                    check_length(len(numbers) // 8, "the topic")
    if stated not in (None, messages):
        raise ValueError(f"{messages} messages, but its statistics say {stated}")


def _records(stream: BinaryIO) -> Iterator[Any]:
    """The records of a file, those in its chunks too; each chunk is unpacked within ``MAX_RECORD`` bytes."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    for record in StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD).records:
        if isinstance(record, Chunk):
            yield from breakup_chunk(replace(record, data=_unpacked(record), compression=""), validate_crc=True)
        else:
            yield record


def _unpacked(chunk: Chunk) -> bytes:
    """The content of a chunk, whatever size it claims to have."""
    if chunk.compression == "zstd":
        import zstandard

        with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(chunk.data)) as reader:
            data: bytes = reader.read(MAX_RECORD + 1)
    elif chunk.compression == "lz4":
        import lz4.frame

        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=MAX_RECORD + 1)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"compression '{chunk.compression[:20]}', expected zstd, lz4 or none")
    if len(data) > MAX_RECORD or len(data) != chunk.uncompressed_size:
        raise ValueError(
            f"a chunk of {len(data)} bytes, expected {chunk.uncompressed_size} and at most {MAX_RECORD} bytes"
        )
    return data
