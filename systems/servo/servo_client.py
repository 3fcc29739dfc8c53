"""The simulation's side of the servo's process: starts it, reads the probe, notices its end."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from multiprocessing import get_context
from types import TracebackType
from typing import Any, Self

from models.scenario import Scenario
from skill.arrays import Array
from systems.operators.page_hand import HandInput
from systems.servo.local_contact import LocalContact
from systems.servo.own_time import LONGEST_LOOK, OwnTime
from systems.servo.probe import Probe
from systems.servo.servo_process import ServoLink, serve
from systems.servo.shared_value import SharedValue

START_TIME = 60.0  # in units of s; a process imports Drake and opens the device
ANSWER_TIME = 10.0  # in units of s
SILENCE = 0.5  # in units of s of its own time without a tick, after which the process is ended
LOOK_PERIOD = 2e-4  # in units of s, between two looks at the probe


class ServoClient:
    """A servo in a process of its own; a context manager.

    Every method raises an OSError that names the driver if the process has ended, reports an error, or is silent for
    `SILENCE`. The process is then ended; a new client may be made. A process that waits for a core is not silent.

    Args:
        driver: name of the device's driver (see `find_device`); `PAGE` is the hand of the page.

    Attributes:
        driver: name of the driver.
        has_priority: whether the system lets the process run before others.
    """

    def __init__(self, driver: str) -> None:
        self.driver = driver
        spawn = get_context("spawn")  # a fork would inherit Drake's and the page's threads
        sizes = (LocalContact.SIZE, Probe.SIZE, HandInput.SIZE)
        self._link = ServoLink(*(SharedValue(spawn, size) for size in sizes))
        self._connection, theirs = spawn.Pipe()
        self._process: Any = spawn.Process(
            target=serve, args=(driver, self._link, theirs, os.getpid()), name=f"servo of {driver}", daemon=True
        )
        self._process.start()
        theirs.close()
        self._own_time = OwnTime(self.process)
        self._last: Probe | None = None
        try:
            self.has_priority: bool = self._expect("opened", START_TIME)
        except OSError:
            self.close()
            raise

    def __enter__(self) -> Self:
        """Returns the client."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Ends the process."""
        self.close()

    @property
    def process(self) -> int:
        """Number of the process."""
        return int(self._process.pid)

    def begin(self, scenario: Scenario) -> None:
        """Starts the ticks of a demonstration; returns when they have begun."""
        self._link.probe.read_new()
        self._last = None
        self._send(("begin", scenario))
        self._expect("begun", ANSWER_TIME)

    def end(self) -> Array:
        """Ends the ticks; returns the wall-clock times of them, s."""
        self._send(("end", None))
        found: Array = self._expect("ended", ANSWER_TIME)
        return found

    def publish(self, contact: LocalContact) -> None:
        """Gives the servo a new local model of the contact."""
        self._link.contact.write(contact.as_vector())

    def move_hand(self, wanted: Array) -> None:
        """Tells the hand of the page what the person wants, a vector of `HandInput`."""
        self._link.hand.write(wanted)

    def probe_at(self, servo_time: float) -> Probe:
        """Waits until the servo's time has come; returns its newest probe."""
        silent, looked = 0.0, time.monotonic()
        while True:
            values = self._link.probe.read_new()
            if values is not None:
                self._last, silent = Probe.from_vector(values), 0.0
            if self._last is not None and self._last.time >= servo_time - 1e-9:
                return self._last
            if self._connection.poll():
                self._raise_report()
            if silent > SILENCE:
                raise self._lost(f"it did not tick for {silent:.1f} s")
            time.sleep(LOOK_PERIOD)
            if time.monotonic() - looked > LONGEST_LOOK:
                looked, silent = time.monotonic(), silent + self._own_time.since_last()

    def close(self) -> None:
        """Ends the process, which closes the device."""
        with suppress(OSError, ValueError):
            self._connection.send(("close", None))
        self._process.join(2.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._connection.close()

    def _send(self, message: tuple[str, Any]) -> None:
        try:
            self._connection.send(message)
        except OSError:
            self._raise_report()

    def _raise_report(self) -> None:
        """Raises what the process has reported, or that it has ended."""
        self._expect("error", ANSWER_TIME)

    def _expect(self, kind: str, timeout: float) -> Any:
        """Returns the content of the next message, which must be of a kind; raises an OSError if it is an error."""
        try:
            if not self._connection.poll(timeout):
                raise self._lost(f"no answer in {timeout:.0f} s")
            found, content = self._connection.recv()
        except (EOFError, ConnectionResetError) as error:
            self._process.join(2.0)
            raise self._lost(f"its process ended with code {self._process.exitcode}") from error
        if found == "error":
            raise self._lost(content)
        if found != kind:
            raise self._lost(f"it answered {found!r}, expected {kind!r}")
        return content

    def _lost(self, reason: str) -> OSError:
        """Ends the process; returns the error to raise."""
        if self._process.is_alive():
            self._process.kill()
        return OSError(f"device driver '{self.driver}': {reason}")
