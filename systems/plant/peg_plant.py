"""Defines the interface of the virtual environment's mechanics, which is the same for every physics engine."""

from __future__ import annotations

from typing import Protocol

from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, InputPort, OutputPort

from skill.arrays import Array


class PegPlant(Protocol):
    """Ports and queries of a free peg and a fixed block, without gravity; H and W coincide.

    Every ``context`` is the root context of the diagram.
    """

    @property
    def index(self) -> BodyIndex:
        """Index of the peg in the forces on it."""

    @property
    def peg_forces(self) -> InputPort:
        """List of ExternallyAppliedSpatialForce."""

    @property
    def peg_state(self) -> OutputPort:
        """Quaternion of R_HP, p_HP (m), angular velocity (rad/s) and velocity (m/s) of the tip in H, (13,)."""

    @property
    def contact_wrench(self) -> OutputPort:
        """Torque (N m) and force (N) of the contact on the peg, at its tip, in H, (6,)."""

    @property
    def pose(self) -> OutputPort:
        """X_HP."""

    def set_start(self, context: Context, X_HP: RigidTransform) -> None:
        """Puts the peg at a pose, at rest."""

    def peg_pose(self, context: Context) -> RigidTransform:
        """Returns X_HP."""

    def contact_force(self, context: Context) -> tuple[Array, Array] | None:
        """Returns a point of the contact (m) and the contact force on the peg (N), in W, or None without contact."""
