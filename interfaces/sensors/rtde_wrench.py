"""The sensor in the wrist of an arm of Universal Robots, and what the arm says of itself, by RTDE over TCP.

A message has its size (16 bits), its kind (a letter) and a body, in network order. The client asks for a version of the
protocol (V) and for that of the controller (v), names the variables that it wants and their rate (O), and starts (S).
Then the controller sends packages (U), each with the number of the list of variables and their values. Universal
Robots' guide "Real-Time Data Exchange" says what the variables are.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from interfaces.sensors.wrench_stream import Reading, RecordOrder, StreamCounts
from skill.arrays import Array

PORT, PROTOCOL, CONTROLLER = 30004, 2, 5
"""The port, the version of the protocol, and the oldest one of the controllers: those before have no sensor."""

PERIOD = 0.002
"""Time between two packages, s."""

VARIABLES = {
    "timestamp": "DOUBLE",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "actual_TCP_pose": "VECTOR6D",
    "actual_TCP_force": "VECTOR6D",
    "robot_status_bits": "UINT32",
    "safety_status_bits": "UINT32",
}
PACKAGE = struct.Struct("!Bd6d6d6d6dII")

STOPPED = 0b111_1111_1100
"""Bits of the safety status with which the arm does not follow: all but normal and reduced mode."""

TIMEOUT = 2.0
"""Time for an answer of the controller, s."""

SILENCE = 0.05
"""Time without a package that is counted, s."""

LOST = 0.1
"""Time without a package after which the arm no longer answers, s."""


class ArmRecord(NamedTuple):
    """What an arm says of itself in one package.

    Attributes:
        arrival: on the monotonic clock, s.
        time: on the clock of the arm, s.
        angles: (6,), of the joints, rad.
        rates: (6,), of the joints, rad/s.
        pose: (6,), position (m) and rotation vector of the tool centre point in the base.
        wrench: (6,), force (N), then moment (N m), about the tool centre point along the axes of the base.
        robot: bits of the arm's status.
        safety: bits of its safety status.
    """

    arrival: float
    time: float
    angles: Array
    rates: Array
    pose: Array
    wrench: Array
    robot: int
    safety: int


class RtdeWrench:
    """A `WrenchStream` of an e-Series arm's own sensor; a thread receives its packages.

    The wrench is that of the world on the arm, in the frame of the tool centre point that is set on the arm, without
    the weight of the payload that is set there. It is not sound while the arm is stopped for safety.

    Args:
        host: address of the arm's controller.

    Raises:
        ConnectionError: if no such controller answers; the message says what was expected.
    """

    def __init__(self, host: str) -> None:
        self.where = f"{host}:{PORT}"
        self._order, self._counts, self._buffer = RecordOrder(), StreamCounts(), bytearray()
        self._newest: ArmRecord | None = None
        self._ended, self._lost = threading.Event(), ""
        try:
            self._socket = socket.create_connection((host, PORT), TIMEOUT)
        except OSError as error:
            raise ConnectionError(f"{self.where}: no answer ({error}); expected an arm of Universal Robots") from error
        try:
            self._start()
        except (OSError, struct.error) as error:
            self._socket.close()
            raise ConnectionError(f"{self.where}: {error}; expected RTDE of an arm of Universal Robots") from error
        self._socket.settimeout(SILENCE)
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def latest(self) -> Reading | None:
        """See `WrenchStream`; there is a reading from the start."""
        newest = self._newest
        if newest is None:
            return None
        turn = Rotation.from_rotvec(newest.pose[3:]).inv()
        return Reading(newest.arrival, turn.apply(newest.wrench.reshape(2, 3)).ravel(), not newest.safety & STOPPED)

    def counts(self) -> StreamCounts:
        """See `WrenchStream`."""
        return self._counts

    def record(self) -> ArmRecord:
        """Returns what the arm said last.

        Raises:
            ConnectionError: if the arm no longer answers.
        """
        newest = self._newest
        if self._lost or newest is None or time.monotonic() - newest.arrival > LOST:
            raise ConnectionError(f"{self.where}: the arm no longer answers ({self._lost or 'silence'})")
        return newest

    def close(self) -> None:
        """See `WrenchStream`."""
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def _start(self) -> None:
        if self._ask(b"V", struct.pack("!H", PROTOCOL)) != b"\x01":
            raise ConnectionError(f"it does not speak version {PROTOCOL} of the protocol")
        major = struct.unpack("!4I", self._ask(b"v"))[0]
        if major < CONTROLLER:
            raise ConnectionError(f"the version of its controller is {major}, and must be {CONTROLLER} at least")
        types = self._ask(b"O", struct.pack("!d", 1.0 / PERIOD) + ",".join(VARIABLES).encode())[1:].decode()
        if types.split(",") != list(VARIABLES.values()):
            raise ConnectionError(f"the types of {', '.join(VARIABLES)} are {types!r}")
        if self._ask(b"S") != b"\x01":
            raise ConnectionError("it does not start to send")
        while self._newest is None:
            self._take(*self._message())

    def _ask(self, kind: bytes, body: bytes = b"") -> bytes:
        self._socket.sendall(struct.pack("!Hc", 3 + len(body), kind) + body)
        while True:
            answered, answer = self._message()
            if answered == kind:
                return answer

    def _message(self) -> tuple[bytes, bytes]:
        """Returns kind and body of the next message; a part of one is kept where the time is over."""
        while len(self._buffer) < 3 or len(self._buffer) < int.from_bytes(self._buffer[:2]):
            part = self._socket.recv(4096)
            if not part:
                raise ConnectionError("it has ended the connection")
            self._buffer += part
        size = int.from_bytes(self._buffer[:2])
        if size < 3:
            raise ConnectionError(f"a message of {size} bytes")
        kind, body = bytes(self._buffer[2:3]), bytes(self._buffer[3:size])
        del self._buffer[:size]
        return kind, body

    def _receive(self) -> None:
        while not self._ended.is_set():
            try:
                self._take(*self._message())
            except TimeoutError:
                self._counts = self._counts.plus(silences=1)
            except OSError as error:
                self._lost = str(error)
                return

    def _take(self, kind: bytes, body: bytes) -> None:
        if kind != b"U":  # a text, or the late answer to a request
            return
        if len(body) != PACKAGE.size:
            self._counts = self._counts.plus(received=1, malformed=1)
            return
        _, timestamp, *values, robot, safety = PACKAGE.unpack(body)
        placed = self._order.place(round(timestamp / PERIOD))
        self._counts = self._counts.plus(received=1, faulty=bool(safety & STOPPED), **placed)
        angles, rates, pose, wrench = np.array(values).reshape(4, 6)
        self._newest = ArmRecord(time.monotonic(), timestamp, angles, rates, pose, wrench, robot, safety)
