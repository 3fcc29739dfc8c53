"""Reads recordings from MCAP files: the WrenchStamped messages of one topic, encoded by ROS 1, ROS 2 or as JSON."""

from __future__ import annotations

import io
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from skill.recordings.messages.wrench_topics import TakeMessage, WrenchTopics, check_file, read_parts
from skill.recordings.recording import Recording

if TYPE_CHECKING:
    from mcap.records import Chunk, Statistics

MAX_RECORD = 100_000_000
"""Largest number of bytes of a piece (a record of MCAP), packed and unpacked; usual chunks have some megabytes."""


def read_mcap_file(path: Path, *, topic: str | None = None, columns: Sequence[str] = ()) -> list[Recording]:
    """Reads the recording of a wrench topic from an MCAP file, or from a folder of the parts of one recording.

    Samples, times and channels are those of `WrenchTopics.recordings`.

    Raises:
        ValueError: if the package ``mcap`` is missing, and as `skill.recordings.reading.read_recordings`.
    """
    _require_mcap(path)
    remedy = "; 'mcap recover' makes one of what is there"
    return read_parts(
        path, _read_part, _errors(), suffix=".mcap", kind="MCAP file", remedy=remedy, topic=topic, columns=columns
    )


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


def _read_part(path: Path, topics: WrenchTopics) -> None:
    """Reads the messages of all wrench topics of a file, and compares their numbers with the statistics."""
    from mcap.records import Channel, Chunk, Message, Schema, Statistics

    check_file(path)
    schemas: dict[int, str] = {}
    names: dict[int, str] = {}
    wrenches: dict[int, TakeMessage] = {}
    counts: Counter[int] = Counter()
    chunks, first, last = 0, 2**63, 0  # number, ns, ns
    stated: Statistics | None = None
    with path.open("rb") as stream:
        for record in _records(stream):
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                names[record.id] = record.topic
                publisher = record.metadata.get("callerid", f"channel {record.id}")
                take = topics.open(record.topic, schemas.get(record.schema_id), record.message_encoding, publisher)
                if take is not None:
                    wrenches[record.id] = take
            elif isinstance(record, Chunk):
                chunks += 1
            elif isinstance(record, Statistics):
                stated = record
            elif isinstance(record, Message):
                counts[record.channel_id] += 1
                if record.log_time < first:
                    first = record.log_time
                if record.log_time > last:
                    last = record.log_time
                if record.channel_id in wrenches:
                    wrenches[record.channel_id](record.log_time, record.data)
    if counts:
        topics.extend(first, last)
    if stated is not None:
        _compare(stated, counts, chunks, names)


def _compare(stated: Statistics, counts: Counter[int], chunks: int, names: dict[int, str]) -> None:
    """Refuses a file that has not what its statistics declare."""
    if stated.message_count != counts.total():
        raise ValueError(f"{counts.total()} messages, but its statistics say {stated.message_count}")
    if stated.chunk_count != chunks:
        raise ValueError(f"{chunks} chunks, but its statistics say {stated.chunk_count}")
    for number, declared in stated.channel_message_counts.items():
        if counts[number] != declared:
            topic = names.get(number, f"channel {number}")
            raise ValueError(f"{counts[number]} messages of '{topic}', but its statistics say {declared}")


def _records(stream: BinaryIO) -> Iterator[Any]:
    """The records of a file, after each chunk those in it; each chunk is unpacked within ``MAX_RECORD`` bytes."""
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    for record in StreamReader(stream, emit_chunks=True, validate_crcs=True, record_size_limit=MAX_RECORD).records:
        yield record
        if isinstance(record, Chunk):
            yield from breakup_chunk(replace(record, data=_unpacked(record), compression=""), validate_crc=True)


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
