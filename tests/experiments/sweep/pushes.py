"""Policies that only tests use: they push, and on the way end their process or fail."""

import os
import signal
import sqlite3
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from skill.policy.rig_policy import Action
from systems.law.control_law import ControlLaw


@dataclass(frozen=True)
class Push(ControlLaw):
    """A push that kills its process at a depth, as long as the file ``deaths`` has fewer letters than ``times``."""

    deaths: str = ""
    times: int = 0
    depth: float = 0.002

    def act(self, measured, estimate=None):
        """See `ControlLaw`."""
        if self.times and -measured[6] > self.depth:
            died = Path(self.deaths)
            if (len(died.read_text()) if died.exists() else 0) < self.times:
                with died.open("a") as file:
                    file.write("x")
                os.kill(os.getpid(), signal.SIGKILL)
        return Action(turn=np.zeros(2), feed=-0.02 * self.period_)


def push(training_context, **options):
    """A push with these options."""
    return Push(**options)


HELD = {"lock": threading.Lock, "database": lambda: sqlite3.connect(":memory:")}


@dataclass(frozen=True)
class Holding(Push):
    """A push that holds something."""

    held: Any = None


def holding(training_context, what):
    """A push that holds something that may have no place in another process."""
    return Holding(held=HELD[what]())


@dataclass(frozen=True)
class Unwilling(ControlLaw):
    """A law that says that it is made for another peg: no rig can be built with it."""

    metadata_ = {"geometry": "that of another peg"}

    def act(self, measured, estimate=None):
        """See `ControlLaw`."""
        raise AssertionError


def unwilling(training_context):
    """A law with which no rig can be built."""
    return Unwilling()
