"""Arms by their name and address."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from interfaces.robots.arm_wrench import ArmWrench
from interfaces.robots.franky_arm import FrankyArm, ImpedanceArm
from interfaces.robots.robot_arm import RobotArm
from interfaces.robots.ur_arm import UrArm
from models.arm import FR3, UR5E
from models.scenario import Scenario
from skill.arrays import Array
from systems.arm.kinematics import FLANGE_TO_SENSOR, ArmKinematics


def open_arm(host: str, scenario: Scenario) -> RobotArm:
    """Connects to the arm that carries the peg of a scenario.

    Raises:
        ValueError: if no arm carries the peg.
        ModuleNotFoundError: if the package of the arm is not installed.
        ConnectionError: if no arm answers.
    """
    match scenario.carrier:
        case str(name) if name == FR3 and scenario.arm.impedance is not None:
            base, kinematics = RigidTransform(scenario.arm.hole), ArmKinematics(scenario)
            return ImpedanceArm(
                host, scenario.arm.joint_stiffness, scenario.arm.impedance, lambda q: base @ kinematics.flange(q)
            )
        case str(name) if name == FR3:
            return FrankyArm(host, scenario.arm.joint_stiffness)
        case str(name) if name == UR5E and scenario.arm.impedance is None:
            return UrArm(host)
        case other:
            raise ValueError(
                f"scenario.carrier is {other!r}; expected an arm, {FR3!r}, or {UR5E!r} without arm.impedance"
            )


def estimated_wrench(arm: RobotArm, scenario: Scenario) -> ArmWrench:
    """Returns the arm's own estimate as if a sensor of the scenario stood at its place on the flange."""
    kinematics = ArmKinematics(scenario)

    def pose(angles: Array) -> tuple[Array, Array]:
        R = kinematics.tip(angles).rotation().matrix()
        return R, np.asarray(-FLANGE_TO_SENSOR * R[:, 2])

    return ArmWrench(arm, pose)
