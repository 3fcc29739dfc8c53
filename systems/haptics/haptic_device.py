"""Models the haptic device: its position measurement and its force limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import HapticDeviceParameters
from systems.math.rotation import from_rotation_vector, rotation_vector

VELOCITY_BANDWIDTH = 60.0  # in units of Hz, of the low-pass on the differentiated pose


@dataclass(frozen=True)
class DeviceState:
    """State of the device; `as_list` and `from_vector` convert it to and from a discrete state (14,).

    Attributes:
        position: Measured position of the probe (3,), in H, m.
        turn: Measured rotation vector of the probe (3,), in H, rad.
        velocity: Low-passed [angular velocity; velocity] of the probe (6,), in H, rad/s and m/s.
        mean_squares: Low-passed [torque^2, force^2] of the rendered wrench (2,), (N m)^2 and N^2.
    """

    position: NDArray[np.float64]
    turn: NDArray[np.float64]
    velocity: NDArray[np.float64]
    mean_squares: NDArray[np.float64]

    @classmethod
    def from_vector(cls, v: NDArray[np.float64]) -> DeviceState:
        """The inverse of `as_list`."""
        return cls(position=v[0:3], turn=v[3:6], velocity=v[6:12], mean_squares=v[12:14])

    def as_list(self) -> list[float]:
        """[*position, *turn, *velocity, *mean_squares]."""
        return [
            *self.position.tolist(),
            *self.turn.tolist(),
            *self.velocity.tolist(),
            *self.mean_squares.tolist(),
        ]


class HapticDevice(LeafSystem):
    """
    .. pydrake_system::

        name: HapticDevice
        input_ports:
        - hand_pose
        - virtual_wrench
        output_ports:
        - probe_pose
        - probe_velocity
        - rendered_wrench

    A sampled device with six degrees of freedom. Every servo period it reads the pose X_HD of the hand, clamped to a
    spherical workspace about its start and quantised to the resolution of the encoders, and holds it. The velocity is
    the differentiated reading after a first-order low-pass.

    The motors limit the wrench [torque; force]. With F the force and E the first-order mean of |F|^2 over the thermal
    time constant,

        |F| <= sqrt(s^2 + (p^2 - s^2) max(0, 1 - E/s^2)).

    This limit falls from the peak force p of cold motors to the sustained force s when the mean has reached s^2. The
    torque has the same limit with its own p and s. If ``virtual_wrench`` exceeds a limit, the whole wrench is scaled
    down, so that its direction is kept. Wrenches and velocities have the angular part first and are expressed in H.

    Args:
        parameters: Parameters of the device.
        X_HD_start: Pose of the probe at the start, the centre of the workspace.
    """

    def __init__(self, *, parameters: HapticDeviceParameters, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._parameters = parameters
        self._origin = X_HD_start.translation().copy()
        self._blend = 1.0 - np.exp(-2.0 * np.pi * VELOCITY_BANDWIDTH * parameters.servo_period)
        self._hand_pose = self.DeclareAbstractInputPort("hand_pose", Value[RigidTransform]())
        self._virtual_wrench = self.DeclareVectorInputPort("virtual_wrench", 6)
        start = DeviceState(
            position=X_HD_start.translation(),
            turn=rotation_vector(X_HD_start.rotation()),
            velocity=np.zeros(6),
            mean_squares=np.zeros(2),
        )
        self._state = self.DeclareDiscreteState(start.as_list())
        self.DeclarePeriodicDiscreteUpdateEvent(parameters.servo_period, 0.0, self._update)
        state_only = {self.discrete_state_ticket(self._state)}
        self._probe_pose = self.DeclareAbstractOutputPort(
            "probe_pose", Value[RigidTransform], self._calc_pose, state_only
        )
        self._probe_velocity = self.DeclareVectorOutputPort("probe_velocity", 6, self._calc_velocity, state_only)
        self._rendered_wrench = self.DeclareVectorOutputPort(
            "rendered_wrench", 6, self._calc_wrench, {*state_only, self._virtual_wrench.ticket()}
        )

    def load(self, context: Context) -> float:
        """Returns the ratio of ``virtual_wrench`` to its present limit; above 1 the wrench is scaled down.

        Args:
            context: Context of this system.
        """
        return self._load(self._virtual_wrench.Eval(context), self._present(context).mean_squares)

    def limit(self, wrench: NDArray[np.float64], mean_squares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the wrench that the motors render for a commanded wrench.

        Args:
            wrench: Commanded wrench [torque; force] (6,), N m and N.
            mean_squares: See `DeviceState`.
        """
        return wrench / max(1.0, self._load(wrench, mean_squares))

    def _load(self, wrench: NDArray[np.float64], mean_squares: NDArray[np.float64]) -> float:
        p = self._parameters
        torque, force = wrench[:3], wrench[3:]
        load = 0.0
        for part, mean, peak, sustained in (
            (torque, mean_squares[0], p.peak_torque, p.sustained_torque),
            (force, mean_squares[1], p.peak_force, p.sustained_force),
        ):
            if peak == 0.0:  # the scenario commands none
                continue
            cold = max(0.0, 1.0 - mean / sustained**2)
            maximum = math.sqrt(sustained**2 + (peak**2 - sustained**2) * cold)
            load = max(load, math.sqrt(part @ part) / maximum)
        return load

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p = self._parameters
        old = self._present(context)
        X_HD = self._hand_pose.Eval(context)
        offset = X_HD.translation() - self._origin
        reach = math.sqrt(offset @ offset)
        if reach > p.workspace_radius:
            offset = offset * (p.workspace_radius / reach)
        position = np.rint((self._origin + offset) / p.position_resolution) * p.position_resolution
        turn = np.rint(rotation_vector(X_HD.rotation()) / p.angle_resolution) * p.angle_resolution
        R_old, R_new = from_rotation_vector(old.turn), from_rotation_vector(turn)
        raw = np.concatenate([rotation_vector(R_new @ R_old.inverse()), position - old.position]) / p.servo_period
        rendered = self._rendered_wrench.Eval(context)
        torque, force = rendered[:3], rendered[3:]
        squares = np.array([torque @ torque, force @ force])
        forget = p.servo_period / p.thermal_time_constant
        new = DeviceState(
            position=position,
            turn=turn,
            velocity=old.velocity + self._blend * (raw - old.velocity),
            mean_squares=old.mean_squares + forget * (squares - old.mean_squares),
        )
        discrete_state.get_mutable_vector(self._state).SetFromVector(new.as_list())

    def _present(self, context: Context) -> DeviceState:
        return DeviceState.from_vector(context.get_discrete_state(self._state).value())

    def _calc_pose(self, context: Context, output: Value) -> None:
        state = self._present(context)
        output.set_value(RigidTransform(from_rotation_vector(state.turn), state.position))

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._present(context).velocity)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.limit(self._virtual_wrench.Eval(context), self._present(context).mean_squares))
