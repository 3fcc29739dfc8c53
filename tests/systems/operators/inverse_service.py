"""A stand-in for the Haply Inverse Service 3.5: it speaks the documented JSON over a real WebSocket on this machine."""

import asyncio
import json
import threading
from collections import deque
from contextlib import contextmanager, suppress

import numpy as np
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketHandler

from systems.operators.loopback_device import LoopbackDevice
from systems.servo.servo_process import ask_for_priority

START = np.array([0.02, -0.12, 0.15])  # of the cursor, m
STATUS = {"calibrated": True, "in_use": False, "power_supply": True, "ready": True, "started": True}


DELAY = 2
"""Messages after which a force acts."""


def xyz(values):
    return dict(zip("xyz", map(float, values), strict=True))


class Service:
    """A service with one Inverse3, which a simulated hand holds in the frame of the person.

    Attributes:
        path: where the hand wants to be, (6,), for a time in s; it does not turn.
        version: what `/version` answers.
        type: of the device.
        devices, grips: numbers of the devices, and {number: kind of the grip}.
        status, awake: of the devices and the grips.
        turn: the orientation of the grips (w, x, y, z), for a time in s.
        mangle: changes an answer, a dictionary; may return a text, or None for silence.
        clock: time in s; None counts the messages, a step of time each: a tick of the driver has two.
        sessions, forces: what clients have sent: sessions, and the force of each message, N.
        generated: the largest energy so far that the forces have given to the hand beyond what it has absorbed, J.
    """

    def __init__(self, path=lambda t: np.zeros(6)):
        self.path = path
        self.version, self.type = {"project_version": "3.5.1.0"}, "inverse3"
        self.devices, self.grips = ["049D"], {}
        self.status, self.awake, self.turn = dict(STATUS), True, lambda t: (1.0, 0.0, 0.0, 0.0)
        self.mangle, self.clock, self.step = lambda answer: answer, None, 5e-4
        self.sessions, self.forces, self.generated, self.clients = [], [], 0.0, set()
        self._given = 0.0
        self._late, self._hand, self._began = deque(), None, None

    def time(self):
        """Time since the first message, s."""
        if self.clock is None:
            return self.step * len(self.forces)
        self._began = self._began if self._began is not None else self.clock()
        return self.clock() - self._began

    def position(self):
        """Position of the hand."""
        if self._hand is None:
            self._hand = LoopbackDevice(self.path, clock=self.time)
        return self._hand.read_pose().translation()

    def take(self, text):
        """Takes a message, and lets time pass up to now; returns the answer."""
        message = json.loads(text)
        if "session" in message:
            self.sessions.append(message["session"])
        before = self.position()
        for device in message.get("inverse3", []):
            assert device["device_id"] in self.devices
            vector = device["commands"]["set_cursor_force"]["vector"]
            self._late.append(np.array([vector[axis] for axis in "xyz"]))
            self.forces.append(self._late[-1])
        force = self._late.popleft() if len(self._late) > DELAY else np.zeros(3)
        self._hand.write_wrench(np.concatenate([np.zeros(3), force]))
        self._given += force @ (self.position() - before)
        self.generated = max(self.generated, self._given - self._hand.dissipated)
        return self.mangle(self.message(full=False))

    def message(self, *, full):
        """All devices, with their configuration or without."""
        config = {"type": self.type, "handedness": "left", "device_info": {"major_version": 7}}
        state = {"cursor_position": xyz(START + self.position()), "cursor_velocity": xyz(np.zeros(3))}
        arm = {"state": state, "status": self.status, **({"config": config} if full else {})}
        found = {"session_id": 7, "inverse3": [{"device_id": name, **arm} for name in self.devices]}
        for number, kind in self.grips.items():
            state = {"orientation": dict(zip("wxyz", map(float, self.turn(self.time())), strict=True))}
            grip = {"device_id": number, "state": state, "status": {"ready": True, "awake": self.awake}}
            found.setdefault(kind, []).append(grip)
        return found

    def hang_up(self):
        """Closes the connections."""
        self.loop.call_soon_threadsafe(lambda: [client.close() for client in list(self.clients)])


class Socket(WebSocketHandler):
    def initialize(self, service):
        self.service = service

    def check_origin(self, origin):
        return True

    def open(self):
        self.set_nodelay(True)
        self.service.clients.add(self)
        self.write_message(json.dumps(self.service.message(full=True)))

    def on_message(self, text):
        answer = self.service.take(text)
        if answer is not None:
            self.write_message(answer if isinstance(answer, str) else json.dumps(answer))

    def on_close(self):
        self.service.clients.discard(self)


class Version(RequestHandler):
    def initialize(self, service):
        self.service = service

    def get(self):
        self.finish(json.dumps(self.service.version))


@contextmanager
def served(service, monkeypatch):
    """Runs a service in a thread; the driver finds it."""
    [socket] = bind_sockets(0, address="127.0.0.1")
    started = threading.Event()

    async def run():
        if service.clock is not None:
            ask_for_priority()  # as the servo: a busy machine must not keep it waiting
        service.loop, stop = asyncio.get_running_loop(), asyncio.Event()
        service.stop = lambda: service.loop.call_soon_threadsafe(stop.set)
        handlers = [("/", Socket, {"service": service}), ("/version", Version, {"service": service})]
        server = HTTPServer(Application(handlers, websocket_ping_interval=1.0))
        server.add_sockets([socket])
        started.set()
        await stop.wait()
        server.stop()
        for client in list(service.clients):
            client.close()
        await asyncio.sleep(0.05)

    thread = threading.Thread(target=asyncio.run, args=(run(),), daemon=True)
    thread.start()
    started.wait(10.0)
    monkeypatch.setenv("INVERSE_SERVICE", f"127.0.0.1:{socket.getsockname()[1]}")
    try:
        yield service
    finally:
        with suppress(RuntimeError):  # a test has stopped it
            service.stop()
        thread.join(10.0)
