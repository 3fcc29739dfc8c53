"""An arm's own estimate of the wrench on its flange, as that of a sensor."""

from __future__ import annotations

import time

import numpy as np

from interfaces.robots.robot_arm import RobotArm
from interfaces.sensors.wrench_stream import Reading, StreamCounts
from systems.arm.kinematics import FLANGE_TO_SENSOR, ArmKinematics


class ArmWrench:
    """A `WrenchStream` of what an arm estimates, as if a sensor stood at its place on the flange.

    A reading is sound while the arm has no fault. Its time is when `latest` has first seen the state.

    Args:
        arm: stays open when the stream ends.
        kinematics: of the arm; the axes of the sensor are those of the peg.
    """

    def __init__(self, arm: RobotArm, kinematics: ArmKinematics) -> None:
        self._arm, self._kinematics = arm, kinematics
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
            R_OS = self._kinematics.tip(state.angles).rotation().matrix()
            force, moment = state.wrench[:3], state.wrench[3:]
            moment = moment + FLANGE_TO_SENSOR * np.cross(R_OS[:, 2], force)
            self._latest = Reading(time.monotonic(), np.concatenate([force @ R_OS, moment @ R_OS]), not state.fault)
        return self._latest

    def counts(self) -> StreamCounts:
        """See `WrenchStream`; states are counted that `latest` has seen."""
        return StreamCounts(received=self._received, faulty=self._faulty)

    def close(self) -> None:
        """See `WrenchStream`."""
