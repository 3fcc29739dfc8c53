"""The interface of a force/torque sensor, and how the records of a stream are counted."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import NamedTuple, Protocol

from skill.arrays import Array

WINDOW = 4096
"""Records for which a gap can still be filled, and a record be recognised: four seconds at 1 kHz."""

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
        lost: records that are missing at present; one that arrives late is no longer lost.
        late: records that arrived after a newer one; they are not used.
        doubled: records that arrived again; they are not used.
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
    doubled: int = 0
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


class Arrival(Enum):
    """What a record is beside those before it."""

    NEW = auto()
    LATE = auto()
    DOUBLED = auto()
    RESTARTED = auto()


@dataclass
class RecordOrder:
    """Places each record of a stream by its counters.

    A record is late if it fills a gap that newer ones left and is an older sample than these, and doubled if both of
    its counters have been seen. Any other record behind the newest one means that the counter of the sensor began anew.

    Attributes:
        lost: records that are missing at present.
    """

    lost: int = 0
    _newest: int | None = None
    _sample: int = 0
    _missing: set[int] = field(default_factory=set)
    _seen: set[tuple[int, int]] = field(default_factory=set)
    _recent: deque[tuple[int, int]] = field(default_factory=deque)

    def place(self, number: int, sample: int) -> Arrival:
        """Returns what a record is.

        Args:
            number: counter of the records of the stream.
            sample: counter of the samples of the sensor.
        """
        if (number, sample) in self._seen:
            return Arrival.DOUBLED
        self._remember(number, sample)
        newest, last_sample = self._newest, self._sample
        if number in self._missing and (sample - last_sample) % WRAP >= WRAP // 2:
            self._missing.discard(number)
            self.lost -= 1
            return Arrival.LATE
        self._newest, self._sample = number, sample
        if newest is None:
            return Arrival.NEW
        ahead = (number - newest) % WRAP
        if not 0 < ahead < WRAP // 2:
            self._missing.clear()
            return Arrival.RESTARTED
        self.lost += ahead - 1
        if ahead > 1:
            gap = {(newest + k) % WRAP for k in range(max(1, ahead - WINDOW), ahead)}
            self._missing = {k for k in self._missing | gap if (number - k) % WRAP <= WINDOW}
        return Arrival.NEW

    def forget(self) -> None:
        """Forgets what was seen and what is missing: after a silence, these counters are those of a new beginning."""
        self._seen.clear()
        self._recent.clear()
        self._missing.clear()

    def _remember(self, number: int, sample: int) -> None:
        self._seen.add((number, sample))
        self._recent.append((number, sample))
        if len(self._recent) > WINDOW:
            self._seen.discard(self._recent.popleft())
