"""The interface of a force/torque sensor, and how the records of a stream are counted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol

from skill.arrays import Array

WINDOW = 4096
"""Records by which one can be late: four seconds at 1 kHz."""

WRAP = 1 << 32
"""The counters of the records have 32 bits."""


class Reading(NamedTuple):
    """A wrench as a sensor reports it.

    Attributes:
        time: of its arrival on the monotonic clock, s.
        wrench: (6,), force (N), then moment (N m), in the frame of the sensor.
        sound: whether the sensor calls it valid.
    """

    time: float
    wrench: Array
    sound: bool


@dataclass(frozen=True)
class StreamCounts:
    """What has happened to a stream of records so far.

    Attributes:
        received: records, of any kind.
        lost: records that had not arrived when a newer one did.
        late: records that arrived after a newer one, or again.
        malformed: packets that are no record.
        overloaded: records beyond the range of the sensor.
        faulty: records that the sensor calls invalid for another reason.
        silences: times without any record.
        restarts: times when the counter of the sensor began anew.
        unit_changes: changes of the units or of the counts per unit.
    """

    received: int = 0
    lost: int = 0
    late: int = 0
    malformed: int = 0
    overloaded: int = 0
    faulty: int = 0
    silences: int = 0
    restarts: int = 0
    unit_changes: int = 0

    def plus(self, **more: int) -> StreamCounts:
        """Returns the counts with more of some of them."""
        return replace(self, **{name: getattr(self, name) + int(number) for name, number in more.items()})

    def text(self) -> str:
        """Returns the counts that are not zero, in words."""
        return ", ".join(f"{value} {name.replace('_', ' ')}" for name, value in vars(self).items() if value)


class WrenchStream(Protocol):
    """A sensor that sends wrenches by itself."""

    def latest(self) -> Reading | None:
        """Returns the newest reading; None before the first one."""

    def counts(self) -> StreamCounts:
        """Returns what has happened so far."""

    def close(self) -> None:
        """Ends the stream."""


@dataclass
class RecordOrder:
    """Places each record of a stream by its counter, of 32 bits.

    A record that is not newer than the newest one is late. One that is older by `WINDOW`, or comes after a silence, is
    of a counter that began anew.
    """

    _newest: int | None = None
    _is_silent: bool = False

    def place(self, number: int) -> dict[str, int]:
        """Returns what a record adds to the `StreamCounts`: nothing if it is the next one."""
        ahead = 1
        if self._newest is not None:
            ahead = (number - self._newest + WRAP // 2) % WRAP - WRAP // 2
        if -WINDOW < ahead <= 0 and not self._is_silent:
            return {"late": 1}
        self._newest, self._is_silent = number, False
        return {"lost": ahead - 1} if ahead > 0 else {"restarts": 1}

    def note_silence(self) -> None:
        """Takes what comes next for new, whatever its counter."""
        self._is_silent = True
