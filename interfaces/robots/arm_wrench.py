"""An arm's own estimate of the wrench on its flange, as that of a sensor."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from interfaces.robots.robot_arm import RobotArm
from interfaces.sensors.wrench_stream import Reading, StreamCounts
from skill.arrays import Array


class ArmWrench:
    """A `WrenchStream` of what an arm estimates, in a frame S that is fixed to its flange F.

    A reading is sound while the arm has no fault. Its time is when `latest` has first seen the state.

    Args:
        arm: stays open when the stream ends.
        pose: a function of the joint angles (n,), rad, that returns the orientation R_OS (3, 3) of S in the base O of
            the arm, and the position p_FS_O (3,) of S from F along the axes of O, m.
    """

    def __init__(self, arm: RobotArm, pose: Callable[[Array], tuple[Array, Array]]) -> None:
        self._arm, self._pose = arm, pose
        self._latest: Reading | None = None
        self._arm_time: float | None = None
        self._received = self._faulty = 0

    def latest(self) -> Reading | None:
        """See `WrenchStream`; asks the arm for its state.

        Raises:
            ConnectionError: if the arm no longer answers.
        """
        state = self._arm.state()
        if state.time != self._arm_time:
            self._arm_time = state.time
            self._received += 1
            self._faulty += bool(state.fault)
            R_OS, p_FS_O = self._pose(state.angles)
            force, moment = state.wrench[:3], state.wrench[3:] - np.cross(p_FS_O, state.wrench[:3])
            self._latest = Reading(time.monotonic(), np.concatenate([force @ R_OS, moment @ R_OS]), not state.fault)
        return self._latest

    def counts(self) -> StreamCounts:
        """See `WrenchStream`; states are counted that `latest` has seen."""
        return StreamCounts(received=self._received, faulty=self._faulty)

    def close(self) -> None:
        """See `WrenchStream`."""
