"""The haptic device: what it can measure of the hand, and what it can give back."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import HapticDeviceParameters
from systems.math.rotation import from_rotation_vector, rotation_vector

VELOCITY_BANDWIDTH = 60.0  # in units of Hz, of the low-pass on the differentiated pose


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

    A sampled six-degree-of-freedom device. Every servo period it reads the pose of the hand, X_HD, quantised to the
    encoders' resolution and clamped to a spherical workspace about its start, and holds it; its velocity is the
    differentiated reading behind a first-order low-pass.

    The wrench [torque; force] asked for on ``virtual_wrench`` is scaled as a whole, so that its direction is kept,
    to what the motors give: with F the force and E a first-order mean of F^2 over the thermal time constant,

        |F| <= sqrt(s^2 + (p^2 - s^2) max(0, 1 - E/s^2)),

    from the peak p when cold down to the sustained s when the mean has reached s^2; torque likewise, and the
    smaller of the two scales holds for both. Angular parts come first in every wrench and velocity; all are
    expressed in H.
    """

    def __init__(self, *, parameters: HapticDeviceParameters, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._parameters = parameters
        self._origin = X_HD_start.translation().copy()
        self._hand_pose = self.DeclareAbstractInputPort("hand_pose", Value[RigidTransform]())
        self._virtual_wrench = self.DeclareVectorInputPort("virtual_wrench", 6)
        # [position, rotation vector, angular velocity, velocity, mean torque^2, mean force^2]
        start = np.concatenate(
            [X_HD_start.translation(), rotation_vector(X_HD_start.rotation()), np.zeros(6), np.zeros(2)]
        )
        self._state = self.DeclareDiscreteState(start)
        self.DeclarePeriodicDiscreteUpdateEvent(parameters.servo_period, 0.0, self._update)
        state_only = {self.discrete_state_ticket(self._state)}
        self._probe_pose = self.DeclareAbstractOutputPort(
            "probe_pose", Value[RigidTransform], self._calc_pose, state_only
        )
        self._probe_velocity = self.DeclareVectorOutputPort("probe_velocity", 6, self._calc_velocity, state_only)
        self._rendered_wrench = self.DeclareVectorOutputPort(
            "rendered_wrench", 6, self._calc_wrench, {*state_only, self._virtual_wrench.ticket()}
        )

    def read_pose(self, X_HD: RigidTransform) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Position (m) and rotation vector (rad) as the encoders report them."""
        p = self._parameters
        offset = X_HD.translation() - self._origin
        reach = math.sqrt(offset @ offset)
        if reach > p.workspace_radius:
            offset = offset * (p.workspace_radius / reach)
        position = self._origin + offset
        return (
            np.round(position / p.position_resolution) * p.position_resolution,
            np.round(rotation_vector(X_HD.rotation()) / p.angle_resolution) * p.angle_resolution,
        )

    def load(self, context: Context) -> float:
        """What is asked for over the most that the motors give now; above 1 the wrench is scaled down."""
        means = context.get_discrete_state(self._state).value()[12:14]
        return self._load(self._virtual_wrench.Eval(context), means)

    def limit(self, wrench: NDArray[np.float64], mean_squares: NDArray[np.float64]) -> NDArray[np.float64]:
        """The wrench [torque; force] that the motors give when ``wrench`` is asked for."""
        return wrench / max(1.0, self._load(wrench, mean_squares))

    def _load(self, wrench: NDArray[np.float64], mean_squares: NDArray[np.float64]) -> float:
        p = self._parameters
        load = 0.0
        for part, mean, peak, sustained in (
            (wrench[:3], mean_squares[0], p.peak_torque, p.sustained_torque),
            (wrench[3:], mean_squares[1], p.peak_force, p.sustained_force),
        ):
            cold = max(0.0, 1.0 - mean / sustained**2)
            maximum = math.sqrt(sustained**2 + (peak**2 - sustained**2) * cold)
            load = max(load, math.sqrt(part @ part) / maximum)
        return load

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p = self._parameters
        old = context.get_discrete_state(self._state).value()
        position, turn = self.read_pose(self._hand_pose.Eval(context))
        R_old, R_new = from_rotation_vector(old[3:6]), from_rotation_vector(turn)
        raw = np.concatenate([rotation_vector(R_new @ R_old.inverse()), position - old[0:3]]) / p.servo_period
        blend = 1.0 - np.exp(-2.0 * np.pi * VELOCITY_BANDWIDTH * p.servo_period)
        wrench = self._rendered_wrench.Eval(context)
        squares = np.array([wrench[:3] @ wrench[:3], wrench[3:] @ wrench[3:]])
        forget = p.servo_period / p.thermal_time_constant
        discrete_state.get_mutable_vector(self._state).SetFromVector(
            np.concatenate(
                [
                    position,
                    turn,
                    old[6:12] + blend * (raw - old[6:12]),
                    old[12:] + forget * (squares - old[12:]),
                ]
            )
        )

    def _calc_pose(self, context: Context, output: Value) -> None:
        state = context.get_discrete_state(self._state).value()
        output.set_value(RigidTransform(from_rotation_vector(state[3:6]), state[0:3]))

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[6:12])

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        means = context.get_discrete_state(self._state).value()[12:14]
        output.SetFromVector(self.limit(self._virtual_wrench.Eval(context), means))
