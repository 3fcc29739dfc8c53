"""An example of a driver: devices of Force Dimension, such as the omega.6 and the sigma.7.

NOT TRIED ON HARDWARE. It follows the documentation of the Python package forcedimension_core (1.0), which needs the
maker's SDK; `tests/docs/test_example_driver.py` runs it with a stand-in for the package. From this folder,

    haptic-skill record --live --driver force_dimension:ForceDimension

The axes of the maker's frame F are taken to be x towards the person, y to the right and z up: check yours, without
force, before you switch the motors on. Some models turn freely but have no torque.
"""

from __future__ import annotations

import numpy as np
from forcedimension_core import dhd
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from systems.operators.person_frame import R_HV

R_VF = RotationMatrix(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
R_HF = R_HV @ R_VF


class ForceDimension:
    """The first device that is found; implements `systems.operators.device_operator.LiveDevice`.

    Raises:
        OSError: here and from all methods, with the maker's message.
    """

    def __init__(self) -> None:
        self._device = dhd.open()
        if self._device < 0:
            raise OSError(f"no Force Dimension device: {dhd.errorGetLastStr()}")
        self._position = [0.0, 0.0, 0.0]
        self._frame = [[0.0, 0.0, 0.0] for _ in range(3)]
        self._check(dhd.enableForce(True, self._device))
        self._start = self._read()

    def read_pose(self) -> RigidTransform:
        """Returns the motion of the handle since the device was opened, in H."""
        now = self._read()
        moved = R_HF @ (now.translation() - self._start.translation())
        turned = R_HF @ now.rotation() @ self._start.rotation().inverse() @ R_HF.inverse()
        return RigidTransform(turned, moved)

    def write_wrench(self, wrench: NDArray[np.float64]) -> None:
        """Applies [torque; force] (6,), N m and N, in H, until the next call."""
        torque, force = (R_HF.inverse() @ part for part in np.split(wrench, 2))
        self._check(dhd.setForceAndTorque(force.tolist(), torque.tolist(), self._device))

    def close(self) -> None:
        """Switches the motors off and releases the device."""
        dhd.enableForce(False, self._device)
        dhd.close(self._device)

    def _read(self) -> RigidTransform:
        self._check(dhd.getPositionAndOrientationFrame(self._position, self._frame, self._device))
        rotation = RotationMatrix.ProjectToRotationMatrix(np.array(self._frame))
        return RigidTransform(rotation, np.array(self._position))

    def _check(self, result: int) -> None:
        if result < 0:
            raise OSError(str(dhd.errorGetLastStr()))
