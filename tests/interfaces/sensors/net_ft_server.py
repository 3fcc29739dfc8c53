"""A Net F/T sensor on loopback, whose stream can be disturbed."""

import math
import threading
import time

from interfaces.sensors.net_ft_server import NetFtServer

WRENCH = (1.0, -2.0, 3.0, 1e-4, 2e-4, -3e-4)
BLOCK = 10


class DisturbedNetFtServer(NetFtServer):
    """Sends records at 1 kHz, in blocks of `BLOCK`.

    Attributes:
        wrench, status: of the records.
        order: a function of the next block of records that returns the packets to send.
        unit: of the forces on the page.
        silent_until: when records are sent again, on the monotonic clock, s.
        sent: number of packets so far.
        longest_pause: between two records, s; the machine may be busy.
    """

    def __init__(self):
        super().__init__()
        self.wrench, self.status, self.order = WRENCH, 0, lambda records: records
        self.unit, self.silent_until, self.sent, self.longest_pause = "N", -math.inf, 0, 0.0
        self._held, self._ended = [], threading.Event()
        self._clock = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._clock.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self._clock.join()
        self.close()

    def page(self):
        return super().page().replace("<scfgfu>N<", f"<scfgfu>{self.unit}<")

    def _send(self, packet, client):
        self._held.append(packet)
        if len(self._held) == BLOCK:
            packets, self._held = self.order(self._held), []
            for each in packets:
                super()._send(each, client)
            self.sent += len(packets)

    def _run(self):
        due = last = time.monotonic()
        while not self._ended.is_set():
            due += 1e-3
            time.sleep(max(0.0, due - time.monotonic()))
            if time.monotonic() > self.silent_until:
                self.send(self.wrench, self.status)
                self.longest_pause, last = max(self.longest_pause, time.monotonic() - last), time.monotonic()
