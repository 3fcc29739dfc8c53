"""Arms of Universal Robots (e-Series), by RTDE; the commands are those of the package ur_rtde."""

from __future__ import annotations

import contextlib
import time

import numpy as np

from interfaces.robots.robot_arm import ArmState
from interfaces.sensors.rtde_wrench import PERIOD, STOPPED, ArmRecord, RtdeWrench
from skill.arrays import Array

LOOKAHEAD, GAIN = 0.03, 300.0
"""Of servoj: it smooths over a time (s), here the least that it takes, and its gain, here that of URScript."""

ACCELERATION = 1.4
"""Of the leading joint on the way to angles, as URScript has it, rad/s^2."""

SERVO_STOP, JOINT_STOP = 10.0, 10.0
"""Decelerations of the tool where the arm follows, m/s^2, and else of the leading joint, rad/s^2 [choice]."""

THERE, AT_REST = 1e-3, 1e-3
"""How near to its angles (rad) and how slow (rad/s) an arm is that has arrived."""

PATIENCE = 1.0
"""Time for which an arm may stand still before it has arrived, s."""

POWER_ON, PROGRAM_RUNNING = 1 << 0, 1 << 1
SAFETY = (
    "normal mode",
    "reduced mode",
    "protective stop",
    "recovery mode",
    "safeguard stop",
    "system emergency stop",
    "robot emergency stop",
    "emergency stop",
    "violation",
    "fault",
    "stopped due to safety",
)
"""What the bits of the safety status mean."""


def fault_of(record: ArmRecord) -> str:
    """Returns why an arm does not move; "" if it does."""
    found = [name for k, name in enumerate(SAFETY) if record.safety & STOPPED & 1 << k]
    if not record.robot & POWER_ON:
        found.append("power is off")
    if not record.robot & PROGRAM_RUNNING:
        found.append("no program runs")
    return ", ".join(found)


class UrArm:
    """A `RobotArm` of Universal Robots. It is in remote control, and nothing else moves it.

    The joints follow by servoj: where nothing more is said they come to rest at the last angles, whereas speedj goes on
    at the last rates. servoj approaches its angles in the time that it looks ahead, so that it is told where the joints
    will be then. The tool centre point of the arm is set to the flange. The base is that of the controller.

    Args:
        host: address of the arm's controller.

    Attributes:
        period: see `RobotArm`.
        sensor: the sensor in the wrist; its frame is that of the flange.

    Raises:
        ConnectionError: if no such controller answers, or it does not take commands.
        ModuleNotFoundError: if the extra ``ur`` is not installed.
    """

    period: float = PERIOD

    def __init__(self, host: str) -> None:
        import rtde_control

        self.sensor = RtdeWrench(host)
        self._following = False
        try:
            self._control = rtde_control.RTDEControlInterface(host)
        except RuntimeError as error:
            self.sensor.close()
            raise ConnectionError(
                f"{self.sensor.where}: the arm takes no commands ({error}); expected one in remote control, whose ports"
                " 29999 and 30003 answer too"
            ) from error
        try:
            self._require(self._control.setTcp([0.0] * 6), "set its tool centre point")
            self._wait_for_program()
        except ConnectionError:
            self.close()
            raise

    def _wait_for_program(self) -> None:
        """Waits for the records of the running program: the package held the interpreter since it was started."""
        begun = time.monotonic()
        while self.state().fault and time.monotonic() - begun < PATIENCE:
            time.sleep(self.period)

    def state(self) -> ArmState:
        """See `RobotArm`; the wrench is that of the sensor in the wrist, without the weight of the tool."""
        r = self.sensor.record()
        return ArmState(r.time, r.angles, r.rates, r.wrench, fault_of(r))

    def move_to(self, angles: Array, speed: float) -> None:
        """See `RobotArm`."""
        self.stop()
        self._require(self._control.moveJ(angles.tolist(), speed, ACCELERATION, True), "move")
        try:
            self._wait_for(angles)
        except BaseException:
            self._control.stopJ(JOINT_STOP)
            raise

    def _wait_for(self, angles: Array) -> None:
        """Waits until the joints rest at angles (n,), rad."""
        moved = time.monotonic()
        while True:
            state = self.state()
            if state.fault:
                raise ConnectionError(f"{self.sensor.where}: the arm has stopped on its way: {state.fault}")
            if np.abs(state.rates).max() > AT_REST:
                moved = time.monotonic()
            elif np.abs(state.angles - angles).max() < THERE:
                return
            elif time.monotonic() - moved > PATIENCE:
                raise ConnectionError(
                    f"{self.sensor.where}: the arm stands still at {np.round(state.angles, 3)} rad, on its way to"
                    f" {np.round(angles, 3)}"
                )
            time.sleep(self.period)

    def follow(self, angles: Array, rates: Array) -> None:
        """See `RobotArm`; without another word the joints come to rest where they would be after `LOOKAHEAD`."""
        self._require(not self.state().fault, "follow")
        self._following = True
        target = angles + LOOKAHEAD * rates
        self._require(self._control.servoJ(target.tolist(), 0.0, 0.0, self.period, LOOKAHEAD, GAIN), "follow")

    def set_tool(self, mass: float, centre: Array) -> None:
        """See `RobotArm`."""
        told = (
            centre if centre.any() else np.full(3, 1e-9)
        )  # the package takes zeros for the centre that was set before
        self._require(self._control.setPayload(mass, told.tolist()), "take the payload")

    def stop(self) -> None:
        """See `RobotArm`.

        Raises:
            ConnectionError: if the arm no longer answers.
        """
        self.state()  # the package would connect again and again, and not return
        if self._following:
            self._control.servoStop(SERVO_STOP)
        else:
            self._control.stopJ(JOINT_STOP)
        self._following = False

    def close(self) -> None:
        """See `RobotArm`."""
        with contextlib.suppress(ConnectionError):  # an arm that does not answer is not told to stop
            self.stop()
            self._control.stopScript()
        self._control.disconnect()
        self.sensor.close()

    def _require(self, done: bool, what: str) -> None:
        if not done:
            fault = self.state().fault or "its controller refuses"
            raise ConnectionError(f"{self.sensor.where}: the arm does not {what}: {fault}")
