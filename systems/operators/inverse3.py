"""A Haply Inverse3, through the service that its maker provides.

NOT TRIED ON HARDWARE. It speaks the JSON protocol of the Haply Inverse Service 3.5, as docs.haply.co describes it
(inverseSDK/service: realtime/websocket-protocol, realtime/control-commands, commons/basis, api/http). On one port,
`GET /version` names the version, and a WebSocket carries the state and the commands: first the service lists all
devices, then it answers each message with one state. Each tick is two messages: the first is answered with the newest
state, the second carries the force that belongs to it. Its answer is not used: it would be old in the next tick.

Frames: x to the right, y away, z up for the basis "XYZ", which is that of the person (V), whether the arm of the device
is on its left or its right (`handedness`): both kinds have right-handed axes. A VerseGrip, if there is one, turns the
peg; its orientation is a quaternion in the same basis. Without one the orientation stays. Three motors render the
force, scaled down to the peak force of the device; **no torque is rendered**.
"""

from __future__ import annotations

import http.client
import json
import math
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from websocket import ABNF, WebSocketException, WebSocketTimeoutException, create_connection

from models.document import brief
from models.hardware import DEVICE_PRESETS
from systems.operators.person_frame import R_HV

VARIABLE, ADDRESS = "INVERSE_SERVICE", "localhost:10001"
"""Environment variable with the address of the service, and the address without it."""

OLDEST, TOO_NEW = (3, 5), (4, 0)
"""Versions of the service that are understood: from the first one, and before the second one."""

BASIS = {"permutation": "XYZ"}
TYPES = ("inverse3", "inverse3x")
GRIPS = ("verse_grip", "wireless_verse_grip")
ANSWER_TIME = 3.0  # in units of s; while it renders, the servo closes a device that is late much sooner


class Inverse3:
    """The Inverse3 of a running service; implements `LiveDevice`.

    Raises:
        OSError: here and from all methods, naming the service: if there is none, its version or its answer is not
            understood, there is not one Inverse3 that is ready, or the service, the device or the grip is lost.
    """

    def __init__(self) -> None:
        self._address = os.environ.get(VARIABLE, ADDRESS)
        host, _, port = self._address.rpartition(":")
        if not (host and port.isdecimal() and int(port) < 1 << 16):
            raise OSError(f"{VARIABLE} is '{self._address}', expected host:port, such as {ADDRESS}")
        self._peak = DEVICE_PRESETS["inverse3"].peak_force
        self._force, self._device_id = np.zeros(3), ""
        self._unread = 0  # answers that are on their way
        self._is_closed = False
        try:
            _check_version(host, int(port))
            self._client: Any = create_connection(
                f"ws://{self._address}/",
                timeout=ANSWER_TIME,
                http_no_proxy=[host],
                sockopt=[(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)],
                skip_utf8_validation=True,  # it is slow in Python
            )
        except (OSError, WebSocketException) as error:
            raise self._lost(error, remedy=f"is it running? Another address: {VARIABLE}=host:port") from error
        try:
            inventory = self._receive()
            with self._understood(inventory):
                self._device_id = self._find_device(inventory)
                self._grip = self._find_grip(inventory)
            self._start = self._read(session={"configure": {"profile": {"name": "haptic-skill"}, "basis": BASIS}})
        except BaseException:
            self.close()
            raise

    def read_pose(self) -> RigidTransform:
        """Returns the motion of the handle since the device was opened, in H."""
        now = self._read()
        moved = R_HV @ (now.translation() - self._start.translation())
        turned = R_HV @ now.rotation() @ self._start.rotation().inverse() @ R_HV.inverse()
        return RigidTransform(turned, moved)

    def write_wrench(self, wrench: NDArray[np.float64]) -> None:
        """Applies the force of [torque; force] (6,), N m and N, in H, until the next call; the torque is lost."""
        force = R_HV.inverse() @ wrench[3:]
        if not np.isfinite(force).all():
            raise self._lost(f"the rendered force is {force.tolist()} N")
        self._force = force * min(1.0, self._peak / max(float(np.linalg.norm(force)), self._peak))
        self._send()

    def close(self) -> None:
        """Ends the force and the connection; another thread may do so, while this one waits for an answer."""
        self._force, self._is_closed = np.zeros(3), True
        if self._device_id:
            with suppress(OSError):
                self._send()
        self._client.abort()  # what wakes a thread that waits for an answer
        self._client.shutdown()

    def _send(self, **session: Any) -> None:
        """Sends the force; the service applies it until the next message."""
        vector = dict(zip("xyz", self._force.tolist(), strict=True))
        command = {"device_id": self._device_id, "commands": {"set_cursor_force": {"vector": vector}}}
        try:
            self._client.send(json.dumps({**session, "inverse3": [command]}))
        except (OSError, WebSocketException) as error:
            raise self._lost(error) from error
        self._unread += 1

    def _receive(self) -> dict[str, Any]:
        """Returns the newest message of the service."""
        try:
            while self._unread > 1:
                self._answer()
                self._unread -= 1
            text = self._answer()
            self._unread = 0
            message: dict[str, Any] = json.loads(text)
        except (OSError, WebSocketException) as error:
            late = self._is_closed or isinstance(error, TimeoutError | WebSocketTimeoutException)
            raise self._lost("it did not answer in time" if late else error) from error
        except ValueError as error:
            raise self._misunderstood(text) from error
        return message

    def _answer(self) -> str:
        """Waits for the next message; the service says by pings that it lives, which are no answers."""
        end = time.monotonic() + ANSWER_TIME
        while time.monotonic() < end:
            kind, content = self._client.recv_data(control_frame=True)
            if kind == ABNF.OPCODE_CLOSE:
                raise ConnectionError("it closed the connection")
            if kind not in (ABNF.OPCODE_PING, ABNF.OPCODE_PONG):
                return str(content.decode(errors="replace"))
        raise TimeoutError

    def _read(self, **session: Any) -> RigidTransform:
        """Returns the pose of the handle in V: its position (m) and the orientation of the grip."""
        self._send(**session)
        message = self._receive()
        with self._understood(message):
            device = self._entry(message, "inverse3", self._device_id)
            self._require_ready(device)
            position = _numbers(device["state"]["cursor_position"], "xyz")
            rotation = RotationMatrix()
            if self._grip is not None:
                wxyz = _numbers(self._entry(message, *self._grip)["state"]["orientation"], "wxyz")
                rotation = RotationMatrix(Quaternion(wxyz / max(float(np.linalg.norm(wxyz)), 0.5)))
            return RigidTransform(rotation, position)

    def _find_device(self, inventory: dict[str, Any]) -> str:
        devices = inventory.get("inverse3", [])
        if len(devices) != 1:
            raise self._lost(f"it has {_listed(devices)}, expected one Inverse3: connect one only")
        kind = devices[0]["config"].get("type")
        if kind not in TYPES:
            raise self._lost(f"{devices[0]['device_id']} is {brief(kind)}, expected one of {TYPES}")
        self._require_ready(devices[0])
        return str(devices[0]["device_id"])

    def _find_grip(self, inventory: dict[str, Any]) -> tuple[str, str] | None:
        """Returns list and number of the grip, or None without one; a wireless one that is asleep is none."""
        grips = [(kind, grip) for kind in GRIPS for grip in inventory.get(kind, []) if _is_awake(grip)]
        if len(grips) > 1:
            raise self._lost(f"it has {_listed([grip for _, grip in grips])}, expected one VerseGrip: connect one only")
        return (grips[0][0], str(grips[0][1]["device_id"])) if grips else None

    def _entry(self, message: dict[str, Any], kind: str, device_id: str) -> dict[str, Any]:
        found = [entry for entry in message.get(kind, []) if entry["device_id"] == device_id]
        if not found or not (kind == "inverse3" or _is_awake(found[0])):
            raise self._lost(f"{kind} {device_id} is disconnected")
        entry: dict[str, Any] = found[0]
        return entry

    def _require_ready(self, device: dict[str, Any]) -> None:
        status = device.get("status", {})
        lacking = [name for name in ("ready", "calibrated", "power_supply") if status.get(name) is False]
        if lacking:
            raise self._lost(f"{device['device_id']} has not: {', '.join(lacking)}; see the Haply Hub")

    @contextmanager
    def _understood(self, message: object) -> Iterator[None]:
        """Says of a message that does not have the parts which are read from it that it is not understood."""
        try:
            yield
        except (AttributeError, KeyError, TypeError, ValueError, RuntimeError) as error:
            raise self._misunderstood(message) from error

    def _misunderstood(self, found: Any) -> OSError:
        return self._lost(f"it sent {brief(found)}, expected the JSON protocol of version {_dotted(OLDEST)}")

    def _lost(self, reason: object, *, remedy: str = "") -> OSError:
        return OSError(f"Haply Inverse Service at {self._address}: {reason}{f'; {remedy}' if remedy else ''}")


def _check_version(host: str, port: int) -> None:
    """Refuses a service that does not say that it has a version, such as 3.5.0.0, which is understood."""
    connection = http.client.HTTPConnection(host, port, timeout=ANSWER_TIME)
    try:
        connection.request("GET", "/version")
        answer = json.loads(connection.getresponse().read(1 << 16))
        version = answer.get("data", answer)["project_version"]  # the page shows both forms
        major, minor, *_ = (int(part) for part in version.split("."))
    except (http.client.HTTPException, ValueError, KeyError, TypeError, AttributeError) as error:
        raise OSError(f"it does not tell its version ({type(error).__name__})") from error
    finally:
        connection.close()
    if not OLDEST <= (major, minor) < TOO_NEW:
        raise OSError(
            f"it has the version {brief(version)}, expected {_dotted(OLDEST)} or later, below {_dotted(TOO_NEW)}"
        )


def _dotted(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))


def _listed(devices: list[dict[str, Any]]) -> str:
    return ", ".join(str(device["device_id"]) for device in devices) or "none"


def _is_awake(grip: dict[str, Any]) -> bool:
    status = grip.get("status", {})
    return all(status.get(name) is not False for name in ("connected", "awake", "ready"))


def _numbers(values: dict[str, Any], names: str) -> NDArray[np.float64]:
    """Returns the numbers of an object, which must be finite."""
    found = [values[name] for name in names]
    if not all(isinstance(number, int | float) and math.isfinite(number) for number in found):
        raise ValueError(f"expected finite numbers {names}")
    return np.array(found, dtype=float)
