"""A Net F/T sensor on loopback, whose stream can be disturbed."""

import math
import threading
import time

from interfaces.sensors.net_ft_server import NetFtServer

WRENCH = (1.0, -2.0, 3.0, 1e-4, 2e-4, -3e-4)


class DisturbedNetFtServer(NetFtServer):
    """Sends records at 1 kHz.

    Attributes:
        wrench, status: of the records.
        unit: of the forces on the page.
        silent_until: when records are sent again, on the monotonic clock, s.
    """

    def __init__(self):
        super().__init__()
        self.wrench, self.status, self.unit, self.silent_until = WRENCH, 0, "N", -math.inf
        self._ended = threading.Event()
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

    def _run(self):
        while not self._ended.wait(1e-3):
            if time.monotonic() > self.silent_until:
                self.send(self.wrench, self.status)
