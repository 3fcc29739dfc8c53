"""A person's own haptic device: one small protocol, found by name through an entry point.

A package that brings a device declares in its pyproject.toml

    [project.entry-points."haptic_skill.devices"]
    mine = "my_package.my_module:open_device"

and `--driver mine` finds it. `open_device()` takes no argument and returns a `LiveDevice`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from systems.math.rotation import from_rotation_vector, rotation_vector

GROUP = "haptic_skill.devices"


class LiveDevice(Protocol):
    """What the virtual environment asks of a real device, once every servo period (1 ms).

    A device that is gone raises an OSError from either method; the session then ends the demonstration and goes on.
    """

    def read_pose(self) -> RigidTransform:
        """Motion of the handle since the device was opened, in H: metres, and a rotation about the handle's centre."""

    def write_wrench(self, wrench: NDArray[np.float64]) -> None:
        """[torque; force] on the hand (N m, N), expressed in H, to be held until the next one."""

    def close(self) -> None:
        """Lets the device go; its motors are off."""


def find_device(name: str) -> Callable[[], LiveDevice]:
    """The factory of a device that some installed package offers under ``name``.

    Raises:
        ValueError: naming what is offered.
    """
    if name == "spacemouse":
        from systems.operators.space_mouse import SpaceMouse

        return SpaceMouse
    offered = {point.name: point for point in entry_points(group=GROUP)}
    if name not in offered:
        raise ValueError(
            f"device driver '{name}' is not installed; found {sorted([*offered, 'spacemouse'])}; a package offers one"
            f" through the entry point group '{GROUP}'"
        )
    factory: Callable[[], LiveDevice] = offered[name].load()
    return factory


class DeviceOperator(LeafSystem):
    """
    .. pydrake_system::

        name: DeviceOperator
        input_ports:
        - rendered_wrench
        output_ports:
        - hand_pose

    A person at a real device. Every servo period it writes the rendered wrench to the device and reads the handle's
    motion; the hand's pose is the start's, moved by it: p_HD = p_start + p - p_before, R_HD = R R_before^-1 R_start,
    where "before" is the motion up to the start. The device is outside the Context: of two contexts only one can be
    at the controls.
    """

    def __init__(
        self,
        *,
        device: LiveDevice,
        period: float,
        X_HD_start: RigidTransform,
        moved_before: RigidTransform | None = None,
    ) -> None:
        super().__init__()
        self._device = device
        before = moved_before if moved_before is not None else RigidTransform()
        self._R_start = before.rotation().inverse() @ X_HD_start.rotation()
        self._p_start = X_HD_start.translation() - before.translation()
        self._rendered_wrench = self.DeclareVectorInputPort("rendered_wrench", 6)
        begin = np.concatenate([X_HD_start.translation(), rotation_vector(X_HD_start.rotation())])
        self._pose = self.DeclareDiscreteState(begin)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        self.DeclareAbstractOutputPort(
            "hand_pose", Value[RigidTransform], self._calc, {self.discrete_state_ticket(self._pose)}
        )

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        self._device.write_wrench(self._rendered_wrench.Eval(context).copy())
        moved = self._device.read_pose()
        turn = rotation_vector(moved.rotation() @ self._R_start)
        position = self._p_start + moved.translation()
        discrete_state.get_mutable_vector(self._pose).SetFromVector(np.concatenate([position, turn]))

    def _calc(self, context: Context, output: Value) -> None:
        state = context.get_discrete_state(self._pose).value()
        output.set_value(RigidTransform(from_rotation_vector(state[3:]), state[:3]))
