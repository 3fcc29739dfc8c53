"""Reads recordings from a rosbag2 in SQLite, the default up to ROS 2 Humble: WrenchStamped messages of one topic."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from skill.recordings.messages.wrench_topics import WrenchTopics, check_file, read_parts
from skill.recordings.recording import Recording

MAX_MESSAGE = 1_000_000
"""Largest number of bytes of a message or text that is read."""

ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 has compressed."""


UNWRITTEN = ("-wal", "-journal")
"""What SQLite appends to the name of a file with changes that a killed program has left; SQLite completes them."""


def read_sqlite_bag(path: Path, *, topic: str | None = None, columns: Sequence[str] = ()) -> list[Recording]:
    """Reads the recording of a wrench topic from a ``.db3`` file, or from a folder of the parts of one recording.

    Samples, times and channels are those of `WrenchTopics.recordings`.
    """
    damaged = (OSError, ValueError, sqlite3.Error, MemoryError, OverflowError)
    kind = "file of a rosbag2"
    return read_parts(path, _read_part, damaged, suffix=".db3", kind=kind, topic=topic, columns=columns)


def _read_part(path: Path, topics: WrenchTopics) -> None:
    """Reads the messages of all wrench topics of a file."""
    check_file(path)
    with _opened(path) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)
        rows = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
        for number, name, kind, encoding in rows:
            if not all(isinstance(text, str) for text in (name, kind, encoding)):
                raise ValueError(f"topic {number} has no name, type or format")
            take = topics.open(name, kind, encoding, f"topic {number}")
            if take is None:
                continue
            for logged, message in database.execute(
                "SELECT timestamp, data FROM messages WHERE topic_id = ?", [number]
            ):
                if not isinstance(logged, int) or not isinstance(message, bytes):
                    raise ValueError(f"topic '{name}' has a message without time or content")
                if message.startswith(ZSTD):
                    raise ValueError("its messages are compressed; convert it with 'ros2 bag convert' first")
                take(logged, message)
        first, last = database.execute("SELECT MIN(timestamp), MAX(timestamp) FROM messages").fetchone()
        if isinstance(first, int) and isinstance(last, int):
            topics.extend(first, last)


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Opens a database without changing anything in its folder, where SQLite itself would complete it."""
    path = path.resolve()  # SQLite looks beside the file itself, not beside a link to it
    beside = [path.with_name(path.name + ending) for ending in UNWRITTEN]
    beside = [file for file in beside if file.is_file() and file.stat().st_size]
    with ExitStack() as stack:
        if beside:
            folder = Path(stack.enter_context(TemporaryDirectory()))
            for file in (path, *beside):
                check_file(file)
                shutil.copyfile(file, folder / file.name)
            path = folder / path.name
        options = "mode=rw" if beside else "mode=ro&immutable=1"
        database = stack.enter_context(closing(sqlite3.connect(f"{path.as_uri()}?{options}", uri=True)))
        if beside:
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        [pages], [page_size] = (database.execute(f"PRAGMA {name}").fetchone() for name in ("page_count", "page_size"))
        size = path.stat().st_size
        if size < pages * page_size:  # SQLite reads zeros where the last page is missing
            raise ValueError(f"{size} bytes, expected {pages * page_size}")
        yield database
