"""Drivers that only tests use: each fails in its own way, a while after its demonstration has begun."""

import os
import time
from pathlib import Path

import numpy as np

from systems.operators.loopback_device import LoopbackDevice

TICKS = 300


class Still(LoopbackDevice):
    """Its hand stays where it is: a demonstration on a busy machine does not end."""

    def __init__(self):
        super().__init__(lambda t: np.zeros(6))


class _Failing(Still):
    """Fails after some ticks."""

    reads = 0

    def read_pose(self):
        self.reads += 1
        if self.reads == TICKS:
            self.fail()
        return super().read_pose()


class Raising(_Failing):
    """Is unplugged; then it takes no wrench either."""

    def fail(self):
        raise OSError("unplugged")

    def write_wrench(self, wrench):
        if self.reads >= TICKS:
            raise OSError("not there")


class Blocking(_Failing):
    """Does not return, and notes when it is closed."""

    def fail(self):
        time.sleep(2.0)

    def close(self):
        Path(os.environ["CLOSED"]).write_text("closed")


class Noted(LoopbackDevice):
    """Notes the last wrench that it got when it is closed."""

    last = None

    def write_wrench(self, wrench):
        super().write_wrench(wrench)
        self.last = wrench.tolist()

    def close(self):
        Path(os.environ["CLOSED"]).write_text(str(self.last))
