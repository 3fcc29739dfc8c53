"""A SpaceMouse as a device without force: it commands velocities, which are summed to a motion."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from systems.math.rotation import from_rotation_vector
from systems.operators.meshcat_operator import R_HV

SPEED = 0.030  # in units of m/s, at full deflection
TURN_RATE = math.radians(8.0)  # in units of rad/s, at full deflection
IDLE = 0.05  # of full deflection, that counts as none
LONGEST_STEP = 0.1  # in units of s; what is between two readings that lie further apart is not made up for


class SpaceMouse:
    """Opens the first SpaceMouse that is plugged in; needs the extra ``teleop``."""

    def __init__(self) -> None:
        try:
            import pyspacemouse
            from easyhid import HIDException
        except ImportError as error:
            raise ValueError(
                f"the SpaceMouse needs the extra 'teleop': pip install haptic-skill[teleop] ({error})"
            ) from error
        self._gone = (RuntimeError, HIDException)  # what the package raises of a device that is not there
        try:
            # As the person sees it: x to the right, y away, z up, and right-handed turns about these.
            self._device: Any = pyspacemouse.open(axis_convention=pyspacemouse.AxisConvention.HID_Z_UP)
        except self._gone as error:
            raise OSError(f"no SpaceMouse found ({error}): is it plugged in, and may this user read it?") from error
        self._moved, self._turned = np.zeros(3), np.zeros(3)
        self._last = time.monotonic()

    def read_pose(self) -> RigidTransform:
        """The sum of what was commanded so far; a turn about the axis is left out, the peg being round."""
        try:
            state = self._device.read()
        except self._gone as error:
            raise OSError(f"the SpaceMouse is gone ({error})") from error
        now = time.monotonic()
        axes = np.array([state.x, state.y, state.z, state.roll, state.pitch])
        axes[np.abs(axes) < IDLE] = 0.0
        step = min(now - self._last, LONGEST_STEP)
        self._moved += SPEED * step * axes[:3]
        self._turned += TURN_RATE * step * np.array([*axes[3:], 0.0])
        self._last = now
        return RigidTransform(from_rotation_vector(R_HV @ self._turned), R_HV @ self._moved)

    def write_wrench(self, wrench: NDArray[np.float64]) -> None:
        """A SpaceMouse has no motors."""

    def close(self) -> None:
        """Lets it go."""
        self._device.close()
