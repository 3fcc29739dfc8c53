"""Uses a SpaceMouse as a device without force feedback: it commands velocities, which are integrated to a motion."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from systems.math.rotation import from_rotation_vector
from systems.operators.person_frame import R_HV

SPEED = 0.030  # in units of m/s, at full deflection
TURN_RATE = math.radians(8.0)  # in units of rad/s, at full deflection
IDLE = 0.05  # share of the full deflection below which a deflection is ignored
MAX_STEP = 0.1  # in units of s; maximum time between two readings that is integrated


class SpaceMouse:
    """The first connected SpaceMouse; implements `LiveDevice`.

    Raises:
        ValueError: If the extra ``teleop`` is not installed.
        OSError: If no SpaceMouse is found.
    """

    def __init__(self) -> None:
        try:
            import pyspacemouse
            from easyhid import HIDException
        except ImportError as error:
            raise ValueError(
                f"the SpaceMouse needs the extra 'teleop': pip install haptic-skill[teleop] ({error})"
            ) from error
        self._disconnected = (RuntimeError, HIDException)  # errors of the package when there is no device
        try:
            # Axes as the person sees them: x to the right, y away, z up; rotations are right-handed.
            self._device: Any = pyspacemouse.open(axis_convention=pyspacemouse.AxisConvention.HID_Z_UP)
        except self._disconnected as error:
            raise OSError(f"no SpaceMouse found ({error}): is it connected, and may this user read it?") from error
        self._moved, self._turned = np.zeros(3), np.zeros(3)
        self._last = time.monotonic()

    def read_pose(self) -> RigidTransform:
        """Returns the integrated motion; rotation about the vertical axis is ignored, because the peg is round.

        Raises:
            OSError: If the SpaceMouse is disconnected.
        """
        try:
            state = self._device.read()
        except self._disconnected as error:
            raise OSError(f"the SpaceMouse is disconnected ({error})") from error
        now = time.monotonic()
        axes = np.array([state.x, state.y, state.z, state.roll, state.pitch])
        axes[np.abs(axes) < IDLE] = 0.0
        step = min(now - self._last, MAX_STEP)
        self._moved += SPEED * step * axes[:3]
        self._turned += TURN_RATE * step * np.array([*axes[3:], 0.0])
        self._last = now
        return RigidTransform(from_rotation_vector(R_HV @ self._turned), R_HV @ self._moved)

    def write_wrench(self, wrench: NDArray[np.float64]) -> None:
        """Does nothing: a SpaceMouse has no motors."""

    def close(self) -> None:
        """Closes the device."""
        self._device.close()
