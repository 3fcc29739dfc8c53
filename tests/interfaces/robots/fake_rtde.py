"""A controller of Universal Robots on loopback: RTDE, its dashboard and its script server, and an arm that only moves.

It runs in a process of its own, for ur_rtde holds the interpreter while it waits for the controller.
"""

import contextlib
import math
import multiprocessing
import random
import socket
import struct
import threading
import time

import numpy as np

PERIOD = 0.002
DASHBOARD, SCRIPT, RTDE = 29999, 30003, 30004
MOVEJ, SERVOJ, SERVO_STOP, SET_PAYLOAD, SET_TCP, STOPJ, STOP_SCRIPT = 1, 11, 16, 17, 29, 34, 255
"""Commands in the first integer register, as ur_rtde's script numbers them."""

STOPPED, PLAYING = 1, 2
READY, DONE = 1, 2
POWER_ON, PROGRAM_RUNNING, NORMAL = 1 << 0, 1 << 1, 1 << 0
ANSWERS = {"PolyscopeVersion": "URSoftware 5.12.2.1101534 (Jul 06 2022)", "get serial number": "20225500001"}


def type_of(name):
    """Returns the type of a variable and its format."""
    if name.startswith("actual_") or name == "external_force_torque":
        return "VECTOR6D", "6d"
    if "_bits" in name or name == "runtime_state":
        return "UINT32", "I"
    return ("INT32", "i") if "_int_" in name else ("DOUBLE", "d")


class FakeUr:
    """A controller, at an address of its own.

    Attributes:
        host: where it is.
    """

    def __init__(self):
        self.host = f"127.{random.randint(1, 254)}.{random.randint(0, 255)}.{random.randint(2, 254)}"
        self._pipe, other = multiprocessing.Pipe()
        context = multiprocessing.get_context("spawn")
        self._process = context.Process(target=serve, args=(self.host, other), daemon=True)

    def __enter__(self):
        self._process.start()
        assert self._pipe.recv() == "ready"
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.join()

    def get(self, name):
        """Returns an attribute of the controller."""
        self._pipe.send((name,))
        return self._pipe.recv()

    def set(self, name, value):
        """Sets an attribute of the controller."""
        self._pipe.send((name, value))
        self._pipe.recv()


def serve(host, pipe):
    """Runs a controller until its process ends."""
    controller = Controller(host)
    pipe.send("ready")
    while True:
        name, *value = pipe.recv()
        if value:
            with controller.between_ticks:
                setattr(controller, name, value[0])
        pipe.send(getattr(controller, name))


class Controller:
    """What answers.

    Attributes:
        q: (6,), angles of the joints, rad.
        qd: (6,), rates, rad/s.
        force: of the tool, (6,).
        pose: of the tool, (6,), with a rotation vector.
        safety: its bits.
        power: the bit of the power, or 0.
        version: of the controller.
        remote: whether it is in remote control, as its dashboard says it.
        silent: whether no packages are sent.
        held: whether something holds the joints.
        junk: bytes that are sent once, before the next package.
        skipped: packages that are left out next.
        commands: those that arrived, with their numbers in the order of the recipe.
        script: the last one that arrived.
        between_ticks: held during a tick, so that what is set meanwhile is not overwritten.
    """

    def __init__(self, host):
        self.q, self.qd = [0.0, -1.5, 1.5, -1.5, -1.5, 0.0], [0.0] * 6
        self.force, self.pose = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], [0.4, 0.1, 0.3, 0.0, 0.0, math.pi / 2]
        self.safety, self.power, self.version = NORMAL, POWER_ON, 5
        self.remote, self.held, self.silent, self.junk, self.skipped = "true", False, False, b"", 0
        self.commands, self.script, self.time = [], "", 100.0
        self._inputs, self._clients, self._running, self._executing = {}, [], False, False
        self._outputs = {"output_int_register_0": 0}
        self._goal, self._speed, self.between_ticks = None, math.inf, threading.Lock()
        for port, run in ((DASHBOARD, self._dashboard), (SCRIPT, self._read_script), (RTDE, self._rtde)):
            server = socket.create_server((host, port))
            threading.Thread(target=self._accept, args=(server, run), daemon=True).start()
        threading.Thread(target=self._tick, daemon=True).start()

    def _accept(self, server, run):
        while True:
            connection, _ = server.accept()
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            threading.Thread(target=run, args=(connection,), daemon=True).start()

    def _dashboard(self, connection):
        connection.sendall(b"Connected: Universal Robots Dashboard Server\n")
        while line := connection.recv(1000).decode().strip():
            connection.sendall(f"{ANSWERS.get(line, self.remote)}\n".encode())

    def _read_script(self, connection):
        text = ""
        while part := connection.recv(1 << 20):
            text += part.decode()
            if text.rstrip().endswith("\nend"):
                self.script, text, self._running, self._executing = text, "", True, False

    def _rtde(self, connection):
        with contextlib.suppress(ConnectionError):
            self._answer(connection)

    def _answer(self, connection):
        names, recipes = [], [[]]
        while header := connection.recv(3, socket.MSG_WAITALL):
            size, kind = struct.unpack("!Hc", header)
            body = connection.recv(size - 3, socket.MSG_WAITALL) if size > 3 else b""
            if kind == b"U":
                self._take(recipes[body[0]], body[1:])
                continue
            if kind == b"V":
                answer = b"\x01"
            elif kind == b"v":
                answer = struct.pack("!4I", self.version, 12, 2, 1101534)
            elif kind == b"O":
                names = body[8:].decode().strip(",").split(",")
                answer = b"\x01" + ",".join(type_of(name)[0] for name in names).encode()
            elif kind == b"I":
                recipes.append(body.decode().strip(",").split(","))
                answer = bytes([len(recipes) - 1]) + ",".join(type_of(name)[0] for name in recipes[-1]).encode()
            else:  # start and pause
                answer = b"\x01"
            connection.sendall(struct.pack("!Hc", 3 + len(answer), kind) + answer)
            if kind == b"S":
                self._clients.append((connection, names))

    def _take(self, recipe, body):
        values = struct.unpack("!" + "".join(type_of(name)[1] for name in recipe), body)
        self._inputs |= dict(zip(recipe, values, strict=False))
        if values[0]:
            self.commands.append(values)

    def _tick(self):
        due = time.monotonic()
        while True:
            due += PERIOD
            time.sleep(max(0.0, due - time.monotonic()))
            with self.between_ticks:
                self._step()

    def _step(self):
        self.time += PERIOD
        self._obey()
        self._move()
        if self.skipped or self.silent:
            self.skipped = max(0, self.skipped - 1)
            return
        for client in list(self._clients):
            self._send(*client)
        self.junk = b""

    def _send(self, connection, names):
        program = PROGRAM_RUNNING if self._running else 0
        values = {"timestamp": self.time, "actual_q": self.q, "actual_qd": self.qd, "actual_TCP_force": self.force}
        values |= {"actual_TCP_pose": self.pose, "safety_status_bits": self.safety} | self._outputs
        values |= {"robot_status_bits": self.power | program, "runtime_state": PLAYING if self._running else STOPPED}
        body = b"".join(struct.pack(f"!{type_of(n)[1]}", *np.atleast_1d(values.get(n, 0)).tolist()) for n in names)
        try:
            connection.sendall(self.junk + struct.pack("!HcB", 4 + len(body), b"U", 1) + body)
        except OSError:
            with contextlib.suppress(ValueError):
                self._clients.remove((connection, names))

    def _obey(self):
        """Takes one turn of the loop of ur_rtde's script."""
        command = self._inputs.get("input_int_register_0", 0)
        if not self._running:
            return
        if self.safety != NORMAL:
            self._running, self._goal = False, None
        elif command in (0, SERVOJ):
            self._executing = False
            self._outputs["output_int_register_0"] = READY
            if command == SERVOJ:
                self._goal, self._speed = self._numbers(6), math.inf
        elif not self._executing:
            self._executing = True
            self._outputs["output_int_register_0"] = DONE
            if command == MOVEJ:
                *self._goal, self._speed = self._numbers(7)
            elif command in (STOPJ, SERVO_STOP, STOP_SCRIPT):
                self._goal = None
                self._running = command != STOP_SCRIPT

    def _numbers(self, stop):
        return [self._inputs[f"input_double_register_{k}"] for k in range(stop)]

    def _move(self):
        """Moves the joints: at once to their goal by servoj, else no faster than they are told to."""
        q = np.array(self.q)
        rates = (
            np.zeros(6)
            if self._goal is None or self.held
            else np.clip((self._goal - q) / PERIOD, -self._speed, self._speed)
        )
        self.q, self.qd = (q + PERIOD * rates).tolist(), rates.tolist()
