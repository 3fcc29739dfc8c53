"""The server of a Net F/T sensor: what a simulated arm serves its sensor with, as a real one does."""

from __future__ import annotations

import contextlib
import socket
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
from numpy.typing import ArrayLike

from interfaces.sensors.net_ft import ERROR, HEADER, OUT_OF_RANGE, RECORD, REQUEST, START
from interfaces.sensors.wrench_stream import WRAP

COUNTS = 1_000_000
"""Counts in a newton and in a newton metre, as real sensors have."""

LEAST, MOST = -(1 << 31), (1 << 31) - 1
"""Range of a record, in counts."""


class NetFtServer:
    """Serves the page of a sensor, and its records to whoever has asked last.

    Requests are taken when a record is sent. Each is answered without end, whatever number of records it names. Every
    address has the page.

    Attributes:
        port: for the records.
        http_port: of the page.
        number: counter of the next record.
        sample: counter of the next sample; it goes on while nobody asks.

    Args:
        host: address to listen at.
        port: for the records; 0 takes a free one.
        http_port: of the page; 0 takes a free one.

    Raises:
        OSError: if a port is taken.
    """

    def __init__(self, host: str = "127.0.0.1", port: int = 0, http_port: int = 0) -> None:
        self.number = self.sample = 1
        self._client: tuple[str, int] | None = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind((host, port))
        self.port = self._socket.getsockname()[1]
        try:
            self._http = ThreadingHTTPServer((host, http_port), self._page_handler())
        except OSError:
            self._socket.close()
            raise
        self.http_port = self._http.server_port
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.01,), daemon=True)
        self._thread.start()

    def page(self) -> str:
        """Returns the page of the sensor."""
        counts = f"<cfgcpf>{COUNTS}</cfgcpf><cfgcpt>{COUNTS}</cfgcpt>"
        return f"<netft>{counts}<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu></netft>"

    def send(self, wrench: ArrayLike, status: int = 0) -> None:
        """Sends one record, of the next sample, to whoever has asked last, if anybody has.

        Args:
            wrench: (6,), force (N), then moment (N m), in the frame of the sensor; clipped to the range of a record,
                which is then flagged.
            status: of the record.

        Raises:
            ValueError: if a number is NaN.
        """
        self._take_requests()
        counts = np.rint(COUNTS * np.asarray(wrench, dtype=float))
        clipped = counts.clip(LEAST, MOST)
        if (clipped != counts).any():
            status |= ERROR | OUT_OF_RANGE
        record = RECORD.pack(self.number % WRAP, self.sample % WRAP, status, *map(int, clipped))
        self.sample += 1
        if self._client is not None:
            self.number += 1
            self._send(record, self._client)

    def close(self) -> None:
        """Ends the service."""
        self._http.shutdown()
        self._thread.join()
        self._http.server_close()
        self._socket.close()

    def _send(self, packet: bytes, client: tuple[str, int]) -> None:
        with contextlib.suppress(OSError):  # no way to the client: it misses the record
            self._socket.sendto(packet, client)

    def _take_requests(self) -> None:
        with contextlib.suppress(BlockingIOError):  # no more requests
            while True:
                request, client = self._socket.recvfrom(REQUEST.size + 1)
                if len(request) == REQUEST.size:
                    header, command, _ = REQUEST.unpack(request)
                    if header == HEADER:
                        self._client = client if command == START else None

    def _page_handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/xml")
                self.end_headers()
                self.wfile.write(server.page().encode())

            def log_message(self, *_: object) -> None:
                pass

        return Handler
