"""A device that is not there: a hand of its own, which moves along a given path and yields to the force."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skill.arrays import Array
from systems.math.rotation import from_rotation_vector

SLIP_SPEEDS = np.array([1e-3, 0.01])  # in units of m/s and rad/s; below them friction is proportional to the speed
MAX_STEP = 0.02  # in units of s; longest time between two readings that the hand is simulated


@dataclass(frozen=True)
class Hand:
    """A hand and the handle in it: a mass on a spring and damper to the place where the hand wants to be.

    Attributes:
        mass: of hand and handle, kg.
        stiffness: of the grip, N/m.
        damping: of the grip, N s/m.
        friction: of the device, N.
        inertia: of hand and handle, kg m^2.
        angular_stiffness: of the grip, N m/rad.
        angular_damping: of the grip, N m s/rad.
        angular_friction: of the device, N m.
    """

    mass: float = 0.3
    stiffness: float = 400.0
    damping: float = 10.0
    friction: float = 0.04
    inertia: float = 5e-4
    angular_stiffness: float = 1.0
    angular_damping: float = 0.02
    angular_friction: float = 0.001


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
        hand: its mechanics.
        clock: time in s; tests give their own.

    Attributes:
        dissipated: energy that grip and device have absorbed, J.
    """

    def __init__(
        self,
        path: Callable[[float], Array] = insertion,
        hand: Hand | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        h = hand or Hand()
        self._path, self._clock = path, clock
        self._mass = np.repeat([h.mass, h.inertia], 3)
        self._stiffness = np.repeat([h.stiffness, h.angular_stiffness], 3)
        self._damping = np.repeat([h.damping, h.angular_damping], 3)
        self._friction = np.array([h.friction, h.angular_friction])
        self._start = self._last = clock()
        self._origin = np.array(path(0.0))
        self._x = np.zeros(6)
        self._v, self._wrench = np.zeros(6), np.zeros(6)
        self.dissipated = 0.0

    def read_pose(self) -> RigidTransform:
        """Returns the motion of the handle; simulates the hand up to now, with the wrench held."""
        now = self._clock()
        step = min(now - self._last, MAX_STEP)
        self._last = now
        if step > 0.0:
            wanted = self._path(now - self._start) - self._origin
            force = self._wrench + self._stiffness * (wanted - self._x)
            # Implicit in spring, damper and friction: stable for any step.
            speeds = np.linalg.norm(self._v.reshape(2, 3), axis=1)
            damping = self._damping + np.repeat(self._friction / np.maximum(speeds, SLIP_SPEEDS), 3)
            held = self._mass + step * damping + step * step * self._stiffness
            self._v = (self._mass * self._v + step * force) / held
            self._x = self._x + step * self._v
            self.dissipated += step * float(damping @ self._v**2)
        return RigidTransform(from_rotation_vector(self._x[3:]), self._x[:3])

    def write_wrench(self, wrench: Array) -> None:
        """Pushes the hand with [torque; force] (6,) until the next call."""
        self._wrench = np.concatenate([wrench[3:], wrench[:3]])

    def close(self) -> None:
        """Does nothing: there are no motors."""
