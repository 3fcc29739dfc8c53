"""The latest value of a vector, shared by two processes: one writes, the other reads; nobody waits."""

from __future__ import annotations

import zlib
from multiprocessing.context import SpawnContext
from typing import Any

import numpy as np

from skill.arrays import Array

CHECKED = 2
"""Numbers before the vector: how often it was written, and a checksum."""


class SharedValue:
    """The latest value of a vector of ``size`` numbers.

    A reader takes a copy and checks its checksum, so that half of a value is never read as a whole, whatever the order
    in which a processor makes writes visible. Nothing is queued: a value that is not read before the next is lost.

    Args:
        context: of the processes; an object can be an argument of one of them.
        size: length of the vector.
    """

    def __init__(self, context: SpawnContext, size: int) -> None:
        self._memory: Any = context.RawArray("d", CHECKED + size)
        self._read = 0.0

    def write(self, value: Array) -> None:
        """Replaces the value; only one process may."""
        numbers = np.frombuffer(self._memory)
        written = numbers[0] + 1.0
        numbers[CHECKED:] = value
        numbers[1] = _checksum(written, value)
        numbers[0] = written

    def read_new(self) -> Array | None:
        """Returns the value if it is another one than at the last call, else None; also while it is being written."""
        numbers = np.frombuffer(self._memory)
        if numbers[0] == self._read:
            return None
        found = numbers.copy()
        if found[1] != _checksum(found[0], found[CHECKED:]):
            return None
        self._read = float(found[0])
        return found[CHECKED:]


def _checksum(written: float, value: Array) -> float:
    return float(zlib.crc32(np.asarray(value, dtype=float).tobytes(), int(written) & 0xFFFFFFFF))
