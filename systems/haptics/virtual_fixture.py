"""Virtual fixtures: stiff guides that take freedoms from the virtual peg.

A fixture is anything with a method ``deviation``; the proxy pulls the deviation to zero with a spring-damper. To add
one, write a class with that method and pass it to `MakeVirtualEnvironment`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from systems.math.rotation import rotation_between, rotation_vector


@dataclass(frozen=True)
class Deviation:
    """How far the peg has strayed from the fixture.

    Attributes:
        p_HQ: point of the peg on which the guide acts, in H (m).
        d_HQ: displacement of that point that the guide has to undo, in H (m).
        theta_H: rotation that the guide has to undo, a rotation vector in H (rad).
        free_axis_H: unit axis along which the guide lets Q slide, or None.
        guides_rotation: basis (k, 3) of the directions in which the guide holds the orientation.
    """

    p_HQ: NDArray[np.float64]
    d_HQ: NDArray[np.float64]
    theta_H: NDArray[np.float64]
    free_axis_H: NDArray[np.float64] | None
    guides_rotation: NDArray[np.float64]


class VirtualFixture(Protocol):
    """What the proxy asks of a fixture."""

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """The deviation of a peg at X_HP; None where the fixture leaves every freedom."""


class FreeFixture:
    """All six freedoms."""

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """None: there is nothing to undo."""
        return None


class RigFixture:
    """The rig's three freedoms: the peg's axis passes through the gimbal's pivot, and the peg does not spin.

    Args:
        pivot_height: of the pivot above the centre of the mouth, on the hole's axis, m.
    """

    def __init__(self, pivot_height: float = 0.0) -> None:
        self._p_HPivot = np.array([0.0, 0.0, pivot_height])

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """Distance of the axis from the pivot, and spin about the axis."""
        axis = X_HP.rotation().col(2)
        tip = X_HP.translation() - self._p_HPivot
        d = tip - (tip @ axis) * axis
        # The part of the rotation that is left when the shortest tilt from z to the axis is taken away.
        tilt = rotation_between(np.array([0.0, 0.0, 1.0]), axis)
        spin = (rotation_vector(X_HP.rotation()) - tilt) @ axis
        return Deviation(
            p_HQ=self._p_HPivot, d_HQ=d, theta_H=spin * axis, free_axis_H=axis, guides_rotation=axis[None, :]
        )


class AxialFixture:
    """One freedom: along the axis of the hole."""

    def deviation(self, X_HP: RigidTransform) -> Deviation | None:
        """Sideways displacement of the tip, and the whole rotation."""
        tip = X_HP.translation()
        return Deviation(
            p_HQ=tip,
            d_HQ=np.array([tip[0], tip[1], 0.0]),
            theta_H=rotation_vector(X_HP.rotation()),
            free_axis_H=np.array([0.0, 0.0, 1.0]),
            guides_rotation=np.eye(3),
        )


def MakeFixture(name: str, *, pivot_height: float) -> VirtualFixture:
    """The fixture that a scenario names: `free`, `rig` or `axial`; ``pivot_height`` (m) is the rig's."""
    fixtures: dict[str, VirtualFixture] = {
        "free": FreeFixture(),
        "rig": RigFixture(pivot_height),
        "axial": AxialFixture(),
    }
    if name not in fixtures:
        raise ValueError(f"fixture is {name!r}, expected one of {sorted(fixtures)}")
    return fixtures[name]
