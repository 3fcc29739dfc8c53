"""Collects the samples of the topics of the type WrenchStamped while a file of messages is read."""

from __future__ import annotations

import stat
from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np

from skill.recordings.column_table import check_length
from skill.recordings.columns import FORCES, MOMENTS, listed
from skill.recordings.messages.wrench_message import DECODERS, SCHEMAS
from skill.recordings.recording import Recording

MAX_BYTES = 20_000_000_000
"""Largest size of a file; it is read piece by piece."""

NUMBERS = 8
"""Numbers of a sample: time of logging, s, time of the header, s, and the wrench."""

CHECKED_EVERY = 10_000
"""Samples after which the length is checked."""

TakeMessage = Callable[[int, bytes], None]
"""Takes the time of logging, ns, and the content of a message; raises a ValueError if it cannot be decoded."""


def check_file(path: Path) -> None:
    """Refuses what is no file, or a file that is too large.

    Raises:
        FileNotFoundError: if there is none.
        ValueError: if it is no regular file or has more than `MAX_BYTES`.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_BYTES:
        raise ValueError(f"{status.st_size / 1e6:.0f} MB, expected a file of at most {MAX_BYTES / 1e6:.0f} MB")


class WrenchTopics:
    """The wrench topics of one recording, which may have several files.

    Args:
        wanted: topic to read; None for the only one.
    """

    def __init__(self, wanted: str | None) -> None:
        self._wanted = wanted
        self._samples: dict[str, array[float]] = {}
        self._others: set[str] = set()

    def open(self, topic: str, schema: str | None, encoding: str) -> TakeMessage | None:
        """Returns what takes the messages of a topic; None if its messages are not needed.

        Raises:
            ValueError: if its encoding is unknown.
        """
        if schema not in SCHEMAS or self._wanted not in (None, topic):
            self._others.add(topic)
            return None
        decode = DECODERS.get(encoding)
        if decode is None:
            raise ValueError(f"topic '{topic}' has the encoding '{encoding}', expected {' or '.join(DECODERS)}")
        numbers = self._samples.setdefault(topic, array("d"))

        def take(logged: int, message: bytes) -> None:
            if len(self._samples) > 1:
                return  # the user has to choose first
            numbers.append(logged * 1e-9)
            numbers.extend(decode(message))
            if len(numbers) % (NUMBERS * CHECKED_EVERY) == 0:
                check_length(len(numbers) // NUMBERS, "the topic")

        return take

    def recording(self, path: Path) -> Recording:
        """Returns the recording of the topic, with the channels fx fy fz mx my mz.

        The samples are sorted by the time at which they were logged. Their time is that of their headers; if no header
        has a time, it is the time of logging.

        Raises:
            ValueError: if there is no topic of this type, or several, or the samples are no valid recording.
        """
        topics = self._samples
        if len(topics) != 1:
            found = f"topics {listed(sorted(topics))} of this type; say which one" if topics else "none"
            wanted = f"topic '{self._wanted}'" if self._wanted else "a topic"
            raise ValueError(
                f"{path}: expected {wanted} of the type {' or '.join(SCHEMAS)}; found {found}"
                + (f", but other topics {listed(sorted(self._others))}" if self._others and not topics else "")
            )
        [(topic, numbers)] = topics.items()
        if not numbers:
            raise ValueError(f"{path}: topic '{topic}' has no messages")
        rows = np.frombuffer(numbers).reshape(-1, NUMBERS)
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        logged, stamps = rows[:, 0], rows[:, 1]
        return Recording(path.name, stamps if stamps.any() else logged, rows[:, 2:], (*FORCES, *MOMENTS))
