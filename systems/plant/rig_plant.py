"""What the rig's wiring and a trial ask of the bodies, whichever engine moves them."""

from __future__ import annotations

from typing import Protocol

from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, InputPort, OutputPort


class RigPlant(Protocol):
    """Carriage, mount, peg, gimbal and block, as ports of a diagram.

    Every ``context`` is that of the whole diagram.
    """

    @property
    def carriage_force(self) -> InputPort:
        """(1,) of the motor, N, along the feed (up)."""

    @property
    def gimbal_equilibrium(self) -> InputPort:
        """(4,) pitch and yaw, rad, about which the steppers hold, and their rates, rad/s."""

    @property
    def carriage_state(self) -> OutputPort:
        """(2,) position, m, and speed, m/s, of the carriage."""

    @property
    def gimbal_state(self) -> OutputPort:
        """(4,) pitch, yaw, rad, and their rates, rad/s."""

    @property
    def reaction_forces(self) -> OutputPort:
        """A list of SpatialForce; its element `sensor` is that of the mount on the peg, at the mount, in P."""

    @property
    def sensor(self) -> int:
        """Index of the sensor's weld in `reaction_forces`."""

    @property
    def weight(self) -> float:
        """Of the peg, N."""

    def set_start(self, context: Context, *, carriage: float, pitch: float, yaw: float) -> None:
        """Puts carriage (m) and gimbal (rad) there."""

    def tip_height(self, context: Context) -> float:
        """Of the centre of the peg's tip in W, m."""

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """X_HP, the pose of the peg in the block."""
