"""A device that is not there: a hand of its own, which moves along a given path and yields to the force."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform

from skill.arrays import Array
from systems.math.rotation import from_rotation_vector

SLIP_SPEEDS = np.array([1e-3, 0.01])  # in units of m/s and rad/s; below them friction is proportional to the speed
MAX_STEP = 0.02  # in units of s; longest time between two readings that the hand is simulated


# Of the hand and the handle in it, first along the three axes, then about them: a mass on a spring and a damper, the
# grip, to the place where the hand wants to be, and the friction of the device.
MASS = np.repeat([0.3, 5e-4], 3)  # in units of kg and kg m^2
STIFFNESS = np.repeat([400.0, 1.0], 3)  # in units of N/m and N m/rad
DAMPING = np.repeat([10.0, 0.02], 3)  # in units of N s/m and N m s/rad
FRICTION = np.array([0.04, 0.001])  # in units of N and N m


def insertion(elapsed: float) -> Array:
    """Where the loopback device's hand wants to be: it feeds down by 40 mm in 4 s, and wobbles.

    Args:
        elapsed: time since the device was opened, s.

    Returns:
        (6,), displacement (m) and rotation vector (rad).
    """
    wobble = math.radians(0.5) * math.sin(2.0 * math.pi * 0.7 * elapsed)
    return np.array([0.0, 0.0, -0.01 * min(elapsed, 4.0), wobble, wobble, 0.0])


class LoopbackDevice:
    """Implements `LiveDevice` without hardware, on the wall's clock.

    Args:
        path: where the hand wants to be, (6,) displacement (m) and rotation vector (rad), for a time in s. Only its
            difference from the first value counts.
        clock: time in s; tests give their own.

    Attributes:
        dissipated: energy that grip and device have absorbed, J.
    """

    def __init__(self, path: Callable[[float], Array] = insertion, clock: Callable[[], float] = time.monotonic) -> None:
        self._path, self._clock = path, clock
        self._start = self._last = clock()
        self._origin = np.array(path(0.0))
        self._x, self._v, self._wrench = np.zeros((3, 6))
        self.dissipated = 0.0

    def read_pose(self) -> RigidTransform:
        """Returns the motion of the handle; simulates the hand up to now, with the wrench held."""
        now = self._clock()
        step = min(now - self._last, MAX_STEP)
        self._last = now
        if step > 0.0:
            wanted = self._path(now - self._start) - self._origin
            force = self._wrench + STIFFNESS * (wanted - self._x)
            # Implicit in spring, damper and friction: stable for any step.
            speeds = np.linalg.norm(self._v.reshape(2, 3), axis=1)
            damping = DAMPING + np.repeat(FRICTION / np.maximum(speeds, SLIP_SPEEDS), 3)
            held = MASS + step * damping + step * step * STIFFNESS
            self._v = (MASS * self._v + step * force) / held
            self._x = self._x + step * self._v
            self.dissipated += step * float(damping @ self._v**2)
        return RigidTransform(from_rotation_vector(self._x[3:]), self._x[:3])

    def write_wrench(self, wrench: Array) -> None:
        """Pushes the hand with [torque; force] (6,) until the next call."""
        self._wrench = np.concatenate([wrench[3:], wrench[:3]])

    def close(self) -> None:
        """Does nothing: there are no motors."""
