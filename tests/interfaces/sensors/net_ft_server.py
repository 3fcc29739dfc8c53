"""A Net F/T sensor on loopback, whose stream can be disturbed."""

import contextlib
import socket
import struct
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

from interfaces.sensors.net_ft import RECORD, START


class NetFtServer:
    """Sends records at 1 kHz to whoever has asked last.

    Attributes:
        counts: (6,), of the wrench in the records.
        status: of the records.
        number: counter of the next record.
        order: a function of the next records that returns those to send.
        unit: of the forces on the page.
    """

    def __init__(self, *, number=1, unit="N"):
        self.counts, self.status, self.number, self.sample = [1000, -2000, 3000, 10, 20, -30], 0, number, 7
        self.order, self.unit, self.silent = (lambda records: records), unit, False
        self.sent, self._held, self._client = 0, [], None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.02)
        self.port = self._socket.getsockname()[1]
        self._http = HTTPServer(("127.0.0.1", 0), self._page())
        self.http_port = self._http.server_port
        self._ended = threading.Event()
        runs = (self._listen, self._send, lambda: self._http.serve_forever(poll_interval=0.01))
        self._threads = [threading.Thread(target=run, daemon=True) for run in runs]

    def __enter__(self):
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._http.shutdown()
        for thread in self._threads:
            thread.join()
        self._socket.close()
        self._http.server_close()

    def _page(self):
        server = self

        class Page(BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.end_headers()
                page = f"<netft><cfgcpf>1000</cfgcpf><scfgfu>{server.unit}</scfgfu>"
                self.wfile.write(f"{page}<cfgcpt>100</cfgcpt><scfgtu>N-mm</scfgtu></netft>".encode())

            def log_message(self, *_):
                pass

        return Page

    def _listen(self):
        while not self._ended.is_set():
            with contextlib.suppress(TimeoutError):
                request, client = self._socket.recvfrom(64)
                header, command, _ = struct.unpack("!HHI", request)
                self._client = client if header == 0x1234 and command == START else None

    def _send(self):
        due = time.monotonic()
        while not self._ended.is_set():
            due += 1e-3
            time.sleep(max(0.0, due - time.monotonic()))
            if self._client is None or self.silent:
                continue
            record = RECORD.pack(self.number % (1 << 32), self.sample, self.status, *self.counts)
            self.number, self.sample = self.number + 1, self.sample + 1
            self._held.append(record)
            if len(self._held) == 10:
                for packet in self.order(self._held):
                    self._socket.sendto(packet, self._client or ("127.0.0.1", self.port))
                    self.sent += 1
                self._held = []
