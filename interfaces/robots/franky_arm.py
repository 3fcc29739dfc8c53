"""A Franka Research 3 by libfranka, through franky."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

from interfaces.robots.robot_arm import ArmState
from skill.arrays import Array

HOLD = 20
"""Time for which a rate is held unless the next one comes, ms."""

CORRECTION = 20.0
"""Rate at which a difference between the commanded angles and those of the arm fades, 1/s."""

FORCE_LIMIT, TORQUE_LIMIT = 80.0, 40.0
"""Estimated force on the flange (N), and torque of a joint (N m), at which the arm stops by itself."""


class FrankyArm:
    """A `RobotArm` with libfranka's protocol: joint velocities, held by the arm's own joint impedance.

    Args:
        host: address of the arm.
        stiffness: of the joints, N m/rad.

    Raises:
        ModuleNotFoundError: if franky is not installed.
        ConnectionError: if no arm answers at the address.
    """

    period = 4e-3

    def __init__(self, host: str, stiffness: float) -> None:
        import franky

        self._franky = franky
        self._errors_of_franky = (
            franky.Exception,
            franky.InvalidMotionTypeException,
            franky.MotionReuseException,
            franky.TorqueSignalTimeoutException,
        )
        try:
            self._robot = self._franky.Robot(host, realtime_config=self._franky.RealtimeConfig.Ignore)
        except self._franky.NetworkException as error:
            raise ConnectionError(
                f"{host}: no arm answers ({error}); expected a Franka with FCI activated, or `haptic-skill twin fr3`"
            ) from error
        with self._errors():
            self._robot.recover_from_errors()
            self._robot.set_joint_impedance([stiffness] * 7)
            self._robot.set_collision_behavior(TORQUE_LIMIT, FORCE_LIMIT)
            unit = np.eye(4).ravel().tolist()
            self._robot.set_ee(unit)
            self._robot.set_k(unit)
            if not np.allclose(self._robot.state.F_T_EE.matrix, np.eye(4), atol=1e-6):
                raise ConnectionError(
                    f"{host}: an end effector is set in Desk; expected none, so that its frame is the flange"
                )

    def state(self) -> ArmState:
        """See `RobotArm`."""
        with self._errors():
            state, has_errors = self._robot.state, self._robot.has_errors
        # libfranka reports the force of the arm on the world (libfranka, issue 26).
        return ArmState(
            time=state.time.to_sec(),
            angles=np.array(state.q),
            rates=np.array(state.dq),
            wrench=-np.array(state.O_F_ext_hat_K),
            fault=str(state.current_errors) if has_errors else "",
        )

    def move_to(self, angles: Array, speed: float) -> None:
        """See `RobotArm`."""
        if self._robot.is_in_control:
            self.stop()
        factor = min(1.0, speed / float(np.max(self._robot.joint_velocity_limit.get())))
        with self._errors():
            self._robot.move(self._franky.JointMotion(angles, relative_dynamics_factor=factor))

    def follow(self, angles: Array, rates: Array) -> None:
        """See `RobotArm`."""
        with self._errors():
            here = np.array(self._robot.state.q_d)
            wanted = rates + CORRECTION * (angles - here)
            motion = self._franky.JointVelocityMotion(wanted, self._franky.Duration(HOLD))
            self._robot.move(motion, asynchronous=True)

    def set_tool(self, mass: float, centre: Array) -> None:
        """See `RobotArm`."""
        with self._errors():
            self._robot.set_load(mass, centre.tolist(), [0.0] * 9)

    def stop(self) -> None:
        """See `RobotArm`."""
        with self._errors():
            self._robot.stop()
        with suppress(self._franky.ControlException):  # it says that the motion has been stopped
            self._robot.join_motion()

    def close(self) -> None:
        """See `RobotArm`."""
        with suppress(*self._errors_of_franky):  # nothing is left to stop
            self._robot.stop()
        del self._robot

    @contextmanager
    def _errors(self) -> Iterator[None]:
        try:
            yield
        except self._errors_of_franky as error:
            raise ConnectionError(f"the arm has stopped: {error}") from error


class ImpedanceArm(FrankyArm):
    """The same arm under a Cartesian impedance of its flange, by torques that franky sends at 1 kHz.

    It holds the last pose where nothing more is said.

    Args:
        host: address of the arm.
        stiffness: of the joints where it moves in free air, N m/rad.
        impedance: (2,), of the flange, N/m and N m/rad.
        flange: a function of joint angles (n,), rad, that returns the pose of the flange in the base.
    """

    def __init__(
        self, host: str, stiffness: float, impedance: list[float], flange: Callable[[Array], RigidTransform]
    ) -> None:
        super().__init__(host, stiffness)
        self._impedance, self._flange = impedance, flange
        self._motion: Any = None

    def follow(self, angles: Array, rates: Array) -> None:
        """See `RobotArm`."""
        target = self._franky.CartesianReference(self._franky.Affine(self._flange(angles).GetAsMatrix4()))
        with self._errors():
            if self._motion is None:
                self._motion = self._franky.CartesianImpedanceTrackingMotion(*self._impedance)
                self._motion.set_reference(target)
                self._robot.move(self._motion, asynchronous=True)
            self._motion.set_reference(target)
            self._robot.poll_motion()  # raises what has stopped it

    def stop(self) -> None:
        """See `RobotArm`."""
        super().stop()
        self._motion = None
