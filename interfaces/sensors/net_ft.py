"""Sensors of ATI with Ethernet (Net F/T, Ethernet Axia), by raw data transfer over UDP.

A request has eight bytes: 0x1234, a command, and a number of records (0: without end). A record has nine numbers of 32
bits in network order: the counter of the records, the counter of the sensor's samples, the status, and force and moment
in counts. The sensor's page ``netftapi2.xml`` says how many counts there are in which unit. In the status, bit 31 is
set for any error and bit 30 for a wrench out of range (manual 9610-05-Ethernet Axia, table 4.7).
"""

from __future__ import annotations

import contextlib
import re
import selectors
import socket
import struct
import threading
import time
import xml.etree.ElementTree as ET
from typing import NamedTuple
from urllib.request import urlopen

import numpy as np

from interfaces.sensors.wrench_stream import Reading, RecordOrder, StreamCounts

PORT, PAGE = 49152, "netftapi2.xml"
HEADER, START, STOP = 0x1234, 0x0002, 0x0000
REQUEST = struct.Struct("!HHI")
RECORD = struct.Struct("!III6i")
ERROR, OUT_OF_RANGE = 1 << 31, 1 << 30

SILENCE = 0.05
"""Time without a record after which the stream is asked for again, s."""

RECEIVE_BUFFER = 1 << 20
"""Bytes asked for records that wait while the receiving thread does not run: 2.5 s of them at 1 kHz. Linux grants no
more than ``net.core.rmem_max``, by default 0.5 s; with its default of 0.25 s a busy program loses records."""

PAGE_PERIOD = 1.0
"""Time between two readings of the sensor's page, s."""

POUND, GRAVITY, INCH = 4.4482216152605, 9.80665, 0.0254
FORCES = {"n": 1.0, "kn": 1e3, "lb": POUND, "lbf": POUND, "klb": 1e3 * POUND, "klbf": 1e3 * POUND}
FORCES |= {"kg": GRAVITY, "kgf": GRAVITY, "g": 1e-3 * GRAVITY, "gf": 1e-3 * GRAVITY}
TORQUES = {"nm": 1.0, "nmm": 1e-3, "knm": 1e3, "kgcm": 1e-2 * GRAVITY, "kgfcm": 1e-2 * GRAVITY}
TORQUES |= {"lbin": POUND * INCH, "lbfin": POUND * INCH, "lbft": 12.0 * POUND * INCH, "lbfft": 12.0 * POUND * INCH}
"""SI units in each unit that the page may name, by its letters."""


class Calibration(NamedTuple):
    """N and N m in a count."""

    force: float
    torque: float


def read_calibration(host: str, http_port: int = 80) -> Calibration:
    """Reads a sensor's page.

    Raises:
        ValueError: if there is no such page, or it has other contents; the message says what was expected.
    """
    address = f"http://{host}:{http_port}/{PAGE}"
    try:
        with urlopen(address, timeout=2.0) as page:
            return parse_calibration(page.read(1_000_000), address)
    except OSError as error:
        raise ValueError(f"{address}: no answer ({error}); expected the page of a Net F/T sensor") from error


def parse_calibration(page: bytes, where: str) -> Calibration:
    """Returns the calibration on a sensor's page; ``where`` names it in errors.

    Raises:
        ValueError: if a number or a unit is missing or unknown.
    """
    try:
        root = ET.fromstring(page)
    except ET.ParseError as error:
        raise ValueError(f"{where}: no XML ({error}); expected the page of a Net F/T sensor") from error
    found = []
    for counts, unit, units in (("cfgcpf", "scfgfu", FORCES), ("cfgcpt", "scfgtu", TORQUES)):
        number, name = root.findtext(f".//{counts}") or "", root.findtext(f".//{unit}") or ""
        letters = re.sub("[^a-z]", "", name.lower())
        if not (number.strip().isdigit() and int(number)):
            raise ValueError(f"{where}: <{counts}> is {number!r}, expected a positive number of counts")
        if letters not in units:
            raise ValueError(f"{where}: <{unit}> is {name!r}, expected a unit such as {', '.join(units)}")
        found.append(units[letters] / int(number))
    return Calibration(*found)


class NetFt:
    """A `WrenchStream` of a Net F/T sensor; a thread and `latest` take its records.

    A record that is late is counted and not used. After a change of the units no reading is sound any more:
    those since the change may have been wrong. After a silence the stream is asked for again.

    Args:
        host: address of the sensor.
        port: for the records.
        http_port: of its page.

    Raises:
        ValueError: if the sensor does not answer.
    """

    def __init__(self, host: str, *, port: int = PORT, http_port: int = 80) -> None:
        self._host, self._http_port = host, http_port
        self._calibration = read_calibration(host, http_port)
        self._scale = np.repeat(self._calibration, 3)
        self._order, self._counts = RecordOrder(), StreamCounts()
        self._latest: Reading | None = None
        self._arrived = time.monotonic()
        self._lock, self._ended = threading.RLock(), threading.Event()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        self._socket.setblocking(False)
        self._socket.connect((host, port))
        self._threads = [threading.Thread(target=run, daemon=True) for run in (self._receive, self._watch_page)]
        for thread in self._threads:
            thread.start()

    def latest(self) -> Reading | None:
        """See `WrenchStream`; takes what has arrived: on a busy machine the thread may wait for milliseconds."""
        self._take_arrived()
        return self._latest

    def counts(self) -> StreamCounts:
        """See `WrenchStream`."""
        return self._counts

    def close(self) -> None:
        """See `WrenchStream`."""
        self._ended.set()
        for thread in self._threads:
            thread.join()
        self._request(STOP)
        self._socket.close()

    def _request(self, command: int) -> None:
        with contextlib.suppress(OSError):  # nobody listens: the records will be missed, and asked for again
            self._socket.send(REQUEST.pack(HEADER, command, 0))

    def _receive(self) -> None:
        self._request(START)
        silent = False
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_READ)
            while not self._ended.is_set():
                selector.select(SILENCE)
                self._take_arrived()
                with self._lock:
                    was_silent, silent = silent, time.monotonic() - self._arrived > SILENCE
                    if silent:
                        self._count(silences=not was_silent)
                        self._order.note_silence()
                if silent:
                    self._ended.wait(SILENCE)
                    self._request(START)

    def _take_arrived(self) -> None:
        with self._lock, contextlib.suppress(OSError):  # there are no more, or nobody listens
            while True:
                packet = self._socket.recv(RECORD.size + 1)
                self._arrived = time.monotonic()
                self._take(packet, self._arrived)

    def _take(self, packet: bytes, now: float) -> None:
        if len(packet) != RECORD.size:
            self._count(received=1, malformed=1)
            return
        number, _, status, *counts = RECORD.unpack(packet)
        placed = self._order.place(number)
        is_overloaded = bool(status & OUT_OF_RANGE)
        is_faulty = bool(status & ERROR) and not is_overloaded
        self._count(received=1, overloaded=is_overloaded, faulty=is_faulty, **placed)
        if "late" not in placed:
            sound = not status & ERROR and not self._counts.unit_changes
            self._latest = Reading(now, np.array(counts) * self._scale, sound)

    def _watch_page(self) -> None:
        while not self._ended.wait(PAGE_PERIOD):
            try:
                found = read_calibration(self._host, self._http_port)
            except ValueError:  # a page that cannot be read says nothing about the units
                continue
            if found != self._calibration:
                self._calibration = found
                self._count(unit_changes=1)

    def _count(self, **more: int) -> None:
        with self._lock:
            self._counts = self._counts.plus(**more)
