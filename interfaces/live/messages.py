"""Messages to the browsers: the latest of each kind, so that a slow browser skips what is out of date."""

from __future__ import annotations

import threading
from collections.abc import Hashable

Message = tuple[int, str | bytes, int | None]  # serial number, content, and the browser that caused it


class Outbox:
    """Keeps the latest message of each key; it may be used by several threads.

    The memory is bounded by the number of keys, however slowly a browser reads.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._serial = 0
        self._messages: dict[Hashable, Message] = {}

    def put(self, key: Hashable, content: str | bytes, *, source: int | None = None) -> None:
        """Replaces the message of ``key``. The browser ``source`` caused the message and does not receive it."""
        with self._lock:
            self._serial += 1
            self._messages[key] = (self._serial, content, source)

    def since(self, serial: int, *, reader: int | None = None) -> tuple[int, list[str | bytes]]:
        """Returns the messages for the browser ``reader`` that are newer than ``serial``, and their last number.

        The messages are in the order in which they were put. A new reader begins with ``serial`` 0.
        """
        with self._lock:
            newer = sorted(message for message in self._messages.values() if message[0] > serial)
            return self._serial, [content for _, content, source in newer if source is None or source != reader]
