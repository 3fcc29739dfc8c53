"""Connects a real haptic device, which is found by name through an entry point.

A package that provides a device declares in its pyproject.toml

    [project.entry-points."haptic_skill.devices"]
    mine = "my_package.my_module:open_device"

and `--driver mine` selects it; `--driver my_package.my_module:open_device` does without the declaration.
`open_device()` takes no argument and returns a `LiveDevice`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, EventStatus, LeafSystem, State

from models.scenario import Scenario
from systems.math.rotation import from_rotation_vector, rotation_vector

GROUP = "haptic_skill.devices"
SPACE_MOUSE, LOOPBACK, INVERSE3 = "spacemouse", "loopback", "inverse3"
PROVIDED = {
    INVERSE3: "systems.operators.inverse3:Inverse3",
    LOOPBACK: "systems.operators.loopback_device:LoopbackDevice",
    SPACE_MOUSE: "systems.operators.space_mouse:SpaceMouse",
}
"""Import paths of the drivers of this project, by their names."""

DEVICE_SCENARIO = "device"
PRESETS = {INVERSE3: "inverse3"}
"""Presets of the devices of drivers, where the margins depend on them. A scenario with the same name has the preset."""


class LiveDevice(Protocol):
    """Interface of a real device; both methods are called once per servo period (1 ms).

    A device that is disconnected raises an OSError from either method. The session then discards the demonstration and
    continues.
    """

    def read_pose(self) -> RigidTransform:
        """Returns the motion of the handle since the device was opened, in H: translation (m) and rotation."""

    def write_wrench(self, wrench: NDArray[np.float64]) -> None:
        """Applies a wrench to the hand until the next call: [torque; force] (6,), N m and N, in H."""

    def close(self) -> None:
        """Switches the motors off and releases the device."""


def find_device(name: str) -> Callable[[], LiveDevice]:
    """Returns the factory of the device that an installed package provides under ``name``.

    Args:
        name: Of an entry point, or ``module:factory``.

    Raises:
        ValueError: If there is none; the message lists the available names.
    """
    drivers = {point.name: point for point in entry_points(group=GROUP)}
    drivers |= {own: EntryPoint(own, path, GROUP) for own, path in PROVIDED.items()}
    if ":" in name:
        drivers[name] = EntryPoint(name, name, GROUP)
    if name not in drivers:
        raise ValueError(
            f"device driver '{name}' is not installed; found {sorted(drivers)}; a package"
            f" provides a driver through the entry point group '{GROUP}'"
        )
    try:
        factory: Callable[[], LiveDevice] = drivers[name].load()
    except (ImportError, AttributeError, ValueError) as error:
        raise ValueError(f"device driver '{name}': cannot be imported ({error})") from error
    return factory


def default_scenario(driver: str) -> str:
    """Returns the name of the scenario for a driver."""
    return PRESETS.get(driver, DEVICE_SCENARIO)


def check_preset(driver: str, scenario: Scenario) -> None:
    """Checks that a scenario has the preset of a driver's device.

    Raises:
        ValueError: If it has another one.
    """
    preset = PRESETS.get(driver, scenario.device)
    if scenario.device != preset:
        raise ValueError(
            f"scenario.device is '{scenario.device}', expected '{preset}' with --driver {driver}:"
            f" use --scenario {preset}, or one with 'device: {preset}'"
        )


class DeviceOperator(LeafSystem):
    """
    .. pydrake_system::

        name: DeviceOperator
        input_ports:
        - rendered_wrench
        output_ports:
        - hand_pose

    A person with a real device. Every servo period it reads the motion (p, R) of the handle, before the other systems
    change their state, and after them it writes to the device the wrench [torque; force] that this motion gives. The
    pose of the hand is p_HD = p_start + p - p_before, R_HD = R R_before^-1 R_start, where "before" is the motion up to
    the start. The state of the device is not part of the Context, so only one context at a time can use it.

    Args:
        device: The opened device.
        period: Servo period, s.
        X_HD_start: Pose of the probe at the start.
        moved_before: Motion of the handle up to the start; by default none.
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
        start = np.concatenate([X_HD_start.translation(), rotation_vector(X_HD_start.rotation())])
        self._pose = self.DeclareDiscreteState(start)  # position (m) and rotation vector (rad)
        # Unrestricted: the discrete updates of the same time come after it. What is published comes after both.
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._read)
        self.DeclarePerStepPublishEvent(self._write)
        self.DeclareAbstractOutputPort(
            "hand_pose", Value[RigidTransform], self._calc, {self.discrete_state_ticket(self._pose)}
        )

    def _read(self, context: Context, state: State) -> EventStatus:
        moved = self._device.read_pose()
        turn = rotation_vector(moved.rotation() @ self._R_start)
        position = self._p_start + moved.translation()
        state.get_mutable_discrete_state().get_mutable_vector(self._pose).SetFromVector(
            np.concatenate([position, turn])
        )
        return EventStatus.Succeeded()

    def _write(self, context: Context) -> EventStatus:
        self._device.write_wrench(self._rendered_wrench.Eval(context).copy())
        return EventStatus.Succeeded()

    def _calc(self, context: Context, output: Value) -> None:
        position, turn = np.split(context.get_discrete_state(self._pose).value(), 2)
        output.set_value(RigidTransform(from_rotation_vector(turn), position))
