"""Keeps a simulation at the pace of the wall clock."""

from __future__ import annotations

import time
from dataclasses import dataclass

MAX_DELAY = 0.04  # in units of s; a longer delay is not made up for


@dataclass(frozen=True)
class Deadlines:
    """Numbers of missed deadlines.

    Attributes:
        late_steps: contact steps that ended late.
        steps: contact steps.
        late_ticks: servo ticks that ended late.
        ticks: servo ticks.
    """

    late_steps: int
    steps: int
    late_ticks: int
    ticks: int


class Clock:
    """Delays the simulation after every servo tick until the wall clock has caught up, and counts late ticks.

    Args:
        period: duration of a tick, s.
        ticks_per_step: ticks in a contact step.
        start: wall-clock time at which the first tick begins, s, as of `time.monotonic`.
    """

    def __init__(self, *, period: float, ticks_per_step: int, start: float) -> None:
        self.period = period
        self._ticks_per_step = ticks_per_step
        self._start = start
        self._ticks = self._late_ticks = self._late_steps = 0

    @property
    def time(self) -> float:
        """Simulated time at the end of the last tick, s."""
        return self._ticks * self.period

    @property
    def next_time(self) -> float:
        """Simulated time at the end of the next tick, s."""
        return (self._ticks + 1) * self.period

    @property
    def deadlines(self) -> Deadlines:
        """The counts so far."""
        steps = self._ticks // self._ticks_per_step
        return Deadlines(late_steps=self._late_steps, steps=steps, late_ticks=self._late_ticks, ticks=self._ticks)

    def end_tick(self) -> None:
        """Ends a tick: sleeps until its time, or counts it as late.

        Later ticks make up for a delay of at most `MAX_DELAY`. After a longer delay the clock starts anew from now.
        """
        self._ticks += 1
        remaining = self._start + self.time - time.monotonic()
        if remaining >= 0:
            time.sleep(remaining)
            return
        self._late_ticks += 1
        self._late_steps += int(self._ticks % self._ticks_per_step == 0)
        if -remaining > MAX_DELAY:
            self._start -= remaining
