"""Arms by their name and address."""

from __future__ import annotations

from pydrake.math import RigidTransform

from interfaces.robots.franky_arm import FrankyArm, ImpedanceArm
from interfaces.robots.robot_arm import RobotArm
from interfaces.robots.ur_arm import UrArm
from models.arm import FR3, UR5E
from models.scenario import Scenario
from systems.arm.kinematics import ArmKinematics


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
