"""Defines virtual fixtures: stiff guides that remove degrees of freedom from the virtual peg.

A fixture is a function that returns the deviation of a peg at X_HP, or None if it constrains nothing; the proxy drives
the deviation to zero with a spring-damper. To add a fixture, write such a function and name it in `fixture_of`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

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


Fixture = Callable[[RigidTransform], Deviation | None]


def rig_deviation(X_HP: RigidTransform, *, pivot_height: float = 0.0, clocking_stage: bool = False) -> Deviation:
    """Returns the distance of the peg's axis from the pivot, and the angle about the axis.

    This leaves the rig's three degrees of freedom, or four with a clocking stage.

    Args:
        X_HP: Pose of the peg.
        pivot_height: Height of the gimbal's pivot above the centre of the mouth, on the hole's axis, m.
        clocking_stage: Whether the peg may turn about its axis.
    """
    pivot, axis = np.array([0.0, 0.0, pivot_height]), X_HP.rotation().col(2)
    tip = X_HP.translation() - pivot
    d = tip - (tip @ axis) * axis
    held = np.zeros((0, 3)) if clocking_stage else axis[None, :]
    theta = np.zeros(3) if clocking_stage else clocking_angle(X_HP.rotation()) * axis
    return Deviation(p_HQ=pivot, d_HQ=d, theta_H=theta, free_axis_H=axis, guides_rotation=held)


def axial_deviation(X_HP: RigidTransform) -> Deviation:
    """Returns the lateral displacement of the tip, and the whole rotation: the slide along the hole's axis is free."""
    tip = X_HP.translation()
    return Deviation(
        p_HQ=tip,
        d_HQ=np.array([tip[0], tip[1], 0.0]),
        theta_H=rotation_vector(X_HP.rotation()),
        free_axis_H=np.array([0.0, 0.0, 1.0]),
        guides_rotation=np.eye(3),
    )


def fixture_of(scenario: Scenario) -> Fixture:
    """Returns the virtual fixture of a resolved scenario."""
    rig = scenario.rig
    fixtures: dict[str, Fixture] = {
        FREE_FIXTURE: lambda X_HP: None,
        RIG_FIXTURE: partial(rig_deviation, pivot_height=rig.pivot_height or 0.0, clocking_stage=rig.clocking_stage),
        AXIAL_FIXTURE: axial_deviation,
    }
    return fixtures[scenario.fixture]
