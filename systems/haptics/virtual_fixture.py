"""Defines virtual fixtures: stiff guides that remove degrees of freedom from the virtual peg.

A fixture is an object with a method ``deviation``; the proxy drives the deviation to zero with a spring-damper. To add
a fixture, write a class with this method and pass an instance to `MakeVirtualEnvironment`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from models.scenario import AXIAL_FIXTURE, FREE_FIXTURE, RIG_FIXTURE, Scenario
from systems.math.rotation import clocking_angle, rotation_vector


@dataclass(frozen=True)
class Deviation:
    """Deviation of the peg from the constraint of a fixture.

    Attributes:
        p_HQ: Point Q of the peg on which the guide acts (3,), in H, m.
        d_HQ: Displacement of Q that the guide opposes (3,), in H, m.
        theta_H: Rotation that the guide opposes, a rotation vector (3,) in H, rad.
        free_axis_H: Unit axis (3,) along which Q slides freely, or None.
        guides_rotation: Orthonormal basis (k, 3) of the rotation axes about which the guide acts, in H.
    """

    p_HQ: NDArray[np.float64]
    d_HQ: NDArray[np.float64]
    theta_H: NDArray[np.float64]
    free_axis_H: NDArray[np.float64] | None
    guides_rotation: NDArray[np.float64]


class VirtualFixture(Protocol):
    """Interface of a fixture."""

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """Returns the deviation of a peg at X_HP, or None if the fixture constrains nothing."""


class FreeFixture:
    """Leaves all six degrees of freedom."""

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """Returns None."""
        return None


class RigFixture:
    """Leaves the rig's three degrees of freedom, or four with a clocking stage: the peg's axis passes the pivot.

    Args:
        pivot_height: Height of the gimbal's pivot above the centre of the mouth, on the hole's axis, m.
        clocking_stage: Whether the peg may turn about its axis.
    """

    def __init__(self, pivot_height: float = 0.0, *, clocking_stage: bool = False) -> None:
        self._p_HPivot = np.array([0.0, 0.0, pivot_height])
        self._free = clocking_stage

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """Returns the distance of the peg's axis from the pivot, and the angle about the axis."""
        axis = X_HP.rotation().col(2)
        tip = X_HP.translation() - self._p_HPivot
        d = tip - (tip @ axis) * axis
        held = np.zeros((0, 3)) if self._free else axis[None, :]
        theta = np.zeros(3) if self._free else clocking_angle(X_HP.rotation()) * axis
        return Deviation(p_HQ=self._p_HPivot, d_HQ=d, theta_H=theta, free_axis_H=axis, guides_rotation=held)


class AxialFixture:
    """Leaves one degree of freedom, along the axis of the hole."""

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """Returns the lateral displacement of the tip, and the whole rotation."""
        tip = X_HP.translation()
        return Deviation(
            p_HQ=tip,
            d_HQ=np.array([tip[0], tip[1], 0.0]),
            theta_H=rotation_vector(X_HP.rotation()),
            free_axis_H=np.array([0.0, 0.0, 1.0]),
            guides_rotation=np.eye(3),
        )


def MakeFixture(scenario: Scenario) -> VirtualFixture:
    """Returns the virtual fixture of a resolved scenario."""
    rig = scenario.rig
    fixtures: dict[str, VirtualFixture] = {
        FREE_FIXTURE: FreeFixture(),
        RIG_FIXTURE: RigFixture(rig.pivot_height or 0.0, clocking_stage=rig.clocking_stage),
        AXIAL_FIXTURE: AxialFixture(),
    }
    return fixtures[scenario.fixture]
