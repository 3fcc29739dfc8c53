"""Age of the readings of a Net F/T sensor when a controller takes them.

    python -m benchmarks.sensors.age [--seconds 60] [--json FILE]

A process sends records at 1 kHz on loopback to two readers, at the same time, each in a process of its own and polled
as a controller does: `NetFt.latest`, and a bare socket that is emptied at each poll, without a thread; only its last
packet is read. *Age*: time from the sending of the newest record to the poll; the record carries it as the force
along x. The half of a period that the newest record is old on the average is in it. Wanted: 99 % below 2 ms. *Of the
bare reader's*: the ratio of the 99 %.

Keys of the file: ``age_ms_p50``, ``age_ms_p99`` and ``age_ms_max``, of `NetFt`; ``age_ratio_p99``, to the bare reader;
``bare``, the same ages of the bare reader; ``load``, the machine's load average of the last minute at the end.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Annotated

import numpy as np
import typer

from benchmarks.command_line import JsonFile, finish, run
from interfaces.reports.result_tables import plain_table
from interfaces.sensors.net_ft import HEADER, RECORD, REQUEST, START, NetFt
from interfaces.sensors.net_ft_server import COUNTS, NetFtServer
from interfaces.terminal import console
from skill.arrays import Array

HOST, PERIOD = "127.0.0.1", 1e-3
POLL_PERIOD = 1.003e-3
"""s; not quite that of the records, so that a poll comes at any time between two."""

WANTED = 2.0
"""Largest age at 99 %, ms."""


def serve(parent: Connection, epoch: float) -> None:
    """Sends records with the time since an epoch to two readers, until the parent process says that it is enough."""
    with closing(NetFtServer(HOST)) as parsed, closing(NetFtServer(HOST)) as bare:
        parent.send((parsed.port, parsed.http_port, bare.port))
        due = time.monotonic()
        while not parent.poll():
            due = max(due + PERIOD, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
            for server in (parsed, bare):
                server.send([time.monotonic() - epoch, 0.0, 0.0, 0.0, 0.0, 0.0])


def ages(newest: Callable[[], float | None], epoch: float, seconds: float) -> Array:
    """Polls a reader of the time since an epoch; returns the ages at the polls from the first record on, ms."""
    found = []
    due = time.monotonic()
    end = due + seconds
    while due < end:
        due = max(due + POLL_PERIOD, time.monotonic())
        time.sleep(max(0.0, due - time.monotonic()))
        sent = newest()
        if sent is not None:
            found.append(1e3 * (time.monotonic() - epoch - sent))
    return np.array(found)


def net_ft_ages(port: int, http_port: int, epoch: float, seconds: float) -> Array:
    """The ages of the readings of `NetFt`, ms."""
    with closing(NetFt(HOST, port=port, http_port=http_port)) as stream:

        def newest() -> float | None:
            reading = stream.latest()
            return None if reading is None else float(reading.wrench[0])

        return ages(newest, epoch, seconds)


def bare_ages(port: int, epoch: float, seconds: float) -> Array:
    """The ages of the packets that a bare socket has received, ms."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as bare:
        bare.setblocking(False)
        bare.connect((HOST, port))
        bare.send(REQUEST.pack(HEADER, START, 0))
        packet = b""

        def newest() -> float | None:
            nonlocal packet
            with suppress(BlockingIOError):  # no more packets
                while True:
                    packet = bare.recv(RECORD.size)
            return RECORD.unpack(packet)[3] / COUNTS if packet else None

        return ages(newest, epoch, seconds)


def measure(seconds: float) -> tuple[Array, Array]:
    """Returns the ages of `NetFt` and of the bare reader, ms."""
    spawn = get_context("spawn")
    ours, theirs = spawn.Pipe()
    epoch = time.monotonic()
    server = spawn.Process(target=serve, args=(theirs, epoch), daemon=True)
    server.start()
    port, http_port, bare_port = ours.recv()
    try:
        with ProcessPoolExecutor(2, mp_context=spawn) as readers:
            for duration in (1.0, seconds):  # in the first second the processes start
                both = (
                    readers.submit(net_ft_ages, port, http_port, epoch, duration),
                    readers.submit(bare_ages, bare_port, epoch, duration),
                )
                parsed, bare = (future.result() for future in both)
    finally:
        ours.send(None)
        server.join()
    return parsed, bare


def summary(found: Array) -> dict[str, float]:
    """The percentiles of ages, ms."""
    p50, p99 = np.percentile(found, [50.0, 99.0])
    return {"age_ms_p50": float(p50), "age_ms_p99": float(p99), "age_ms_max": float(found.max())}


def main(
    seconds: Annotated[float, typer.Option(min=1.0, max=1800.0, help="Time of the measurement, s.")] = 60.0,
    json: JsonFile = None,
) -> None:
    parsed, bare = measure(seconds)
    rows = {"NetFt": summary(parsed), "bare socket": summary(bare)}
    ratio = rows["NetFt"]["age_ms_p99"] / rows["bare socket"]["age_ms_p99"]
    table = plain_table("age of the readings, ms")
    for title in ("reader", "50 %", "99 %", "largest", "polls", "of the bare reader's"):
        table.add_column(title, justify="left" if title == "reader" else "right")
    for (name, of), found, share in zip(rows.items(), (parsed, bare), (ratio, 1.0), strict=True):
        table.add_row(name, *(f"{value:.2f}" for value in of.values()), str(len(found)), f"{share:.2f}")
    console.print(table)
    load = os.getloadavg()[0]
    reached = "reached" if rows["NetFt"]["age_ms_p99"] < WANTED else "missed"
    console.print(
        f"wanted: 99 % below {WANTED:g} ms: {reached}; load of the machine: {load:.1f} on {os.cpu_count()} cores",
        highlight=False,
    )
    finish({**rows["NetFt"], "age_ratio_p99": ratio, "bare": rows["bare socket"], "load": load}, json)


if __name__ == "__main__":
    run(main)
