"""The process of the servo: opens the device, ticks at the wall's pace, and is stopped from outside."""

from __future__ import annotations

import gc
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection

import numpy as np
from pydrake.math import RigidTransform

from models.hardware import DEVICE_PRESETS
from models.scenario import Scenario
from skill.arrays import Array
from systems.law.faults import error_summary
from systems.operators.device_operator import DeviceOperator, LiveDevice, find_device
from systems.operators.page_hand import PAGE, PageHand
from systems.servo.local_contact import LocalContact
from systems.servo.own_time import OwnTime
from systems.servo.servo_diagram import MakeServo, Servo
from systems.servo.shared_value import SharedValue
from systems.virtual_environment import start_pose

STALL = 0.05
"""Time without a tick, s, after which the force is taken away; it returns slowly (see `StaleContactFade`)."""

SPIN = 3e-4
"""Last part of a wait, s, in which the process does not sleep: a sleep ends up to so much late."""

REST, REST_SHARE = 1e-4, 0.08
"""Shortest sleep in each tick, s, and as a share of the time since the sleep before it: Linux stops a real-time process
that leaves others less than 5 % of its core for 50 ms in each second, as a fixed rest does where a tick takes 2 ms."""

PRIORITY = 10
"""Real-time priority of the process, where the system grants one."""

PARENT_PERIOD = 100
"""Ticks between two looks at the parent process."""

WATCH_PERIOD = 0.01
"""Time between two looks of the watchdog, s."""


@dataclass(frozen=True)
class ServoLink:
    """What the two processes share.

    Attributes:
        contact: the local model of the contact, written by the simulation.
        probe: the probe, written by the servo.
        hand: what a person at the page wants of the hand (`HandInput`), written by the page.
    """

    contact: SharedValue
    probe: SharedValue
    hand: SharedValue


class WatchedDevice:
    """A device whose motors are switched off when one of its own calls does not return; a `LiveDevice`.

    A thread beside the ticks looks at the call that runs. Only the call's own time counts (see `OwnTime`): a process
    that the system has stopped, or that waits for a core, is not taken for a driver that blocks. A driver that holds
    the interpreter's lock stops the thread too; the session then ends the process.

    Args:
        device: is closed; used by the thread that makes this object.
    """

    def __init__(self, device: LiveDevice) -> None:
        self._device = device
        self._calls = 0  # odd while a call runs
        self._is_closed = False
        thread = threading.get_native_id()
        threading.Thread(target=self._watch, args=(thread,), name="watchdog", daemon=True).start()

    def read_pose(self) -> RigidTransform:
        """See `LiveDevice`."""
        with self._watched():
            return self._device.read_pose()

    def write_wrench(self, wrench: Array) -> None:
        """See `LiveDevice`."""
        with self._watched():
            self._device.write_wrench(wrench)

    def close(self) -> None:
        """Closes the device, once."""
        if not self._is_closed:
            self._is_closed = True
            self._device.close()

    @contextmanager
    def _watched(self) -> Iterator[None]:
        self._calls += 1
        try:
            yield
        finally:
            self._calls += 1
        if self._is_closed:
            raise OSError(f"it did not return for {1e3 * STALL:.0f} ms")

    def _watch(self, thread: int) -> None:
        time_of, seen, lasted = OwnTime(os.getpid(), thread), 0, 0.0
        while not self._is_closed:
            time.sleep(WATCH_PERIOD)
            own, calls = time_of.since_last(), self._calls
            lasted = lasted + own if calls % 2 and calls == seen else 0.0
            seen = calls
            if lasted >= STALL:
                self.close()


class Pace:
    """Waits for the next tick, and counts.

    Args:
        period: of a tick, s.
        clock: time in s.
        spin: last part of a wait, s, in which it does not sleep.
    """

    def __init__(self, period: float, clock: Callable[[], float] = time.monotonic, *, spin: float = SPIN) -> None:
        self.period, self._clock, self._spin = period, clock, spin
        self._last = self._woken = clock()
        self._next = self._last + period
        self.ticks = self.late = self.stalls = 0

    def wait(self) -> bool:
        """Waits until the tick's time has passed; returns False after a stall.

        Delays up to `STALL` are made up for; from a longer one, or many short ones, the ticks go on from the present.
        """
        self.ticks += 1
        now = self._clock()
        behind = now - self._next
        stalled = now - self._last > STALL
        self._last = now
        self.late, self.stalls = self.late + (behind > 0.0), self.stalls + stalled
        if behind > STALL:
            self._next = now
        time.sleep(max(-behind - self._spin, REST, REST_SHARE * (now - self._woken)))
        self._woken = self._clock()
        while self._clock() < self._next:
            pass
        self._next += self.period
        return not stalled


def serve(driver: str, link: ServoLink, connection: Connection, parent: int) -> None:
    """Runs the servo until the parent closes the connection or dies; the function of the process.

    Messages from the parent are ``("begin", scenario)``, ``("end", None)`` and ``("close", None)``. The answers are
    ``("opened", has_priority)``, ``("begun", None)``, ``("ended", times)`` with the wall-clock time of each tick in s,
    and, as the last one, ``("error", text)``.

    Args:
        driver: name of the device's driver; `PAGE` is the hand of the page.
        link: to the simulation.
        connection: to the parent.
        parent: process number of the parent.
    """
    gc.disable()  # a collection would be a late tick
    has_priority = driver != PAGE and ask_for_priority()  # a hand without motors must not take time from the browser
    device: LiveDevice | None = None
    try:
        device = PageHand(link.hand.read_new) if driver == PAGE else WatchedDevice(find_device(driver)())
        connection.send(("opened", has_priority))
        while True:
            if not connection.poll(1.0):
                if os.getppid() != parent:
                    return
                continue
            kind, content = connection.recv()
            if kind == "close":
                return
            if kind == "begin":
                connection.send(("ended", run_ticks(content, device, link, connection, parent)))
            gc.collect()
    except (EOFError, BrokenPipeError):  # the parent has gone
        return
    except BaseException as error:  # whatever a driver raises; SystemExit too
        connection.send(("error", str(error) if isinstance(error, OSError) else error_summary(error)))
    finally:
        if device is not None:
            device.close()


def ask_for_priority() -> bool:
    """Asks the system to run this process before others; returns whether it does. Most users may not ask.

    What a driver starts does not inherit the priority: it could keep the simulation from running.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except (AttributeError, OSError):  # not on macOS; not permitted
        return False
    return True


def run_ticks(scenario: Scenario, device: LiveDevice, link: ServoLink, connection: Connection, parent: int) -> Array:
    """Ticks until the parent says something; returns the wall-clock time of each tick, s.

    Raises:
        OSError: from the device.
    """
    X_HP_start = start_pose(scenario)
    period = DEVICE_PRESETS[scenario.device].servo_period
    before = device.read_pose()  # the peg starts where the handle is now
    operator = DeviceOperator(device=device, period=period, X_HD_start=X_HP_start, moved_before=before)
    servo = MakeServo(scenario, operator=operator, X_HP_start=X_HP_start)
    servo.start(X_HP_start)
    servo.tick()  # the first one is slow
    times = np.zeros(round(scenario.recorder.time_limit / period) + 1)
    link.contact.read_new()  # of the demonstration before
    connection.send(("begun", None))
    spin = 0.0 if isinstance(device, PageHand) else SPIN  # a hand without motors leaves that time to the browser
    pace = Pace(period, spin=spin)
    try:
        while not connection.poll():
            _tick(servo, pace, link)
            if pace.ticks < len(times):
                times[pace.ticks] = time.monotonic()
            if pace.ticks % PARENT_PERIOD == 0 and os.getppid() != parent:
                raise EOFError
    finally:
        with suppress(OSError):  # of a device that is lost; the first error is the one to tell
            device.write_wrench(np.zeros(6))
    return times[1 : pace.ticks + 1]


def _tick(servo: Servo, pace: Pace, link: ServoLink) -> None:
    """One tick: the newest model of the contact, the device, and the probe for the simulation."""
    model = link.contact.read_new()
    if model is not None:
        servo.set_contact(LocalContact.from_vector(model))
    servo.tick()
    probe = replace(servo.probe(), ticks=pace.ticks, late=pace.late, stalls=pace.stalls)
    link.probe.write(probe.as_vector())
    servo.set_closed(pace.wait())
