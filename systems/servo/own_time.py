"""How long a thread has had its way: a process that waits for a core of the machine has not."""

from __future__ import annotations

import time
from pathlib import Path

LONGEST_LOOK = 0.01
"""Time that one look counts for at most, s: whoever looks may have been stopped meanwhile."""


class OwnTime:
    """Measures the time in which a thread ran, or waited for anything but a core.

    Linux says in /proc for how long a thread has run and waited for a core. Where nothing says so, all time counts.

    Args:
        process: number of the process.
        thread: number of the thread in the system (`threading.get_native_id`); None is the main one.
    """

    def __init__(self, process: int, thread: int | None = None) -> None:
        folder = Path(f"/proc/{process}/task/{thread or process}")
        self._state, self._times = folder / "stat", folder / "schedstat"
        self._last = time.monotonic(), *self._used()

    def since_last(self) -> float:
        """Returns the thread's own time since the last call, s, at most `LONGEST_LOOK`."""
        (before, ran_before, waited_before), is_ready = self._last, self._is_ready()
        self._last = now, ran, waited = time.monotonic(), *self._used()
        # The wait that a thread is in is not yet counted as one: while it is ready, only what it has run is its own.
        own = ran - ran_before if is_ready else now - before - (waited - waited_before)
        return min(max(own, 0.0), LONGEST_LOOK)

    def _used(self) -> tuple[float, float]:
        """Time that the thread has run, and has waited for a core, s."""
        try:
            ran, waited, _ = self._times.read_text().split()
        except OSError:  # not Linux; or the process has ended
            return 0.0, 0.0
        return 1e-9 * int(ran), 1e-9 * int(waited)

    def _is_ready(self) -> bool:
        """Whether the thread runs or waits for a core."""
        try:
            return self._state.read_text().rpartition(")")[2].split()[0] == "R"
        except OSError:
            return False
