"""Reads recordings from a rosbag2 in SQLite, the default up to ROS 2 Humble: WrenchStamped messages of one topic."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from skill.data.files import one_line
from skill.recordings.messages.wrench_topics import WrenchTopics, check_file
from skill.recordings.recording import Recording

MAX_MESSAGE = 1_000_000
"""Largest number of bytes of a message or text that is read."""

ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a message that rosbag2 has compressed."""


def read_sqlite_bag(path: Path, *, topic: str | None = None) -> list[Recording]:
    """Reads the recording of a wrench topic from a ``.db3`` file, or from a folder of the parts of one recording.

    Samples, times and channels are those of `WrenchTopics.recording`.
    """
    topics = WrenchTopics(topic)
    for part in sorted(path.glob("*.db3")) if path.is_dir() else [path]:
        try:
            _read_part(part, topics)
        except FileNotFoundError:
            raise ValueError(f"{part}: no such file") from None
        except (OSError, ValueError, sqlite3.Error, MemoryError, OverflowError) as error:
            raise ValueError(f"{part}: not a complete file of a rosbag2 ({one_line(error)})") from error
    return [topics.recording(path)]


def _read_part(path: Path, topics: WrenchTopics) -> None:
    """Reads the messages of all wrench topics of a file."""
    check_file(path)
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as database:
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE)
        [pages], [page_size] = (database.execute(f"PRAGMA {name}").fetchone() for name in ("page_count", "page_size"))
        size = path.stat().st_size
        if size < pages * page_size:  # SQLite reads zeros where the last page is missing
            raise ValueError(f"{size} bytes, expected {pages * page_size}")
        rows = database.execute("SELECT id, name, type, serialization_format FROM topics").fetchall()
        for number, name, kind, encoding in rows:
            if not all(isinstance(text, str) for text in (name, kind, encoding)):
                raise ValueError(f"topic {number} has no name, type or format")
            take = topics.open(name, kind, encoding)
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
