"""The haptic proxy: a spring-damper between the probe and the virtual peg, and the guide of a virtual fixture."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, LeafSystem, ValueProducer

from models.scenario import CouplingParameters
from systems.haptics.virtual_fixture import VirtualFixture
from systems.math.rotation import cross, rotation_vector


@dataclass(frozen=True)
class PegMotion:
    """Pose of the peg in H, and its [angular velocity; velocity]."""

    X_HP: RigidTransform = field(default_factory=RigidTransform)
    V_HP: NDArray[np.float64] = field(default_factory=lambda: np.zeros(6))


class HapticProxy(LeafSystem):
    """
    .. pydrake_system::

        name: HapticProxy
        input_ports:
        - probe_pose
        - probe_velocity
        - peg_state
        output_ports:
        - peg_forces
        - coupling_wrench
        - probe_wrench

    The virtual coupling. The peg P is pulled towards the probe D by

        F_P = K (p_HD - p_HP) + B (v_HD - v_HP),
        t_P = K_r log(R_HD R_PH) + B_r (w_HD - w_HP),

    a wrench at the tip, in H; the logarithm is a rotation vector, regular below 180 degrees. The probe gets the
    reaction, scaled: -(torque_scale t_P, force_scale F_P). A virtual fixture adds a stiff spring-damper on what it
    forbids (see `VirtualFixture`), with the guide's linear and the coupling's angular gains.

    ``peg_state`` is [quaternion, position, angular velocity, velocity] of a floating peg; H and W coincide in the
    virtual environment. Wrenches and velocities have their angular part first.
    """

    def __init__(self, *, coupling: CouplingParameters, fixture: VirtualFixture, peg: BodyIndex) -> None:
        super().__init__()
        self._coupling = coupling
        self._fixture = fixture
        self._peg = peg
        self._probe_pose = self.DeclareAbstractInputPort("probe_pose", Value[RigidTransform]())
        self._probe_velocity = self.DeclareVectorInputPort("probe_velocity", 6)
        self._peg_state = self.DeclareVectorInputPort("peg_state", 13)
        # The peg's pose and velocity, unpacked once a step for all outputs.
        self._motion = self.DeclareCacheEntry(
            "peg_motion",
            ValueProducer(allocate=lambda: AbstractValue.Make(PegMotion()), calc=self._calc_motion),
            {self._peg_state.ticket()},
        )
        inputs = {self._probe_pose.ticket(), self._probe_velocity.ticket(), self._peg_state.ticket()}
        self._peg_forces = self.DeclareAbstractOutputPort(
            "peg_forces",
            lambda: AbstractValue.Make([ExternallyAppliedSpatialForce()]),
            self._calc_peg_forces,
            inputs,
        )
        self._coupling_wrench = self.DeclareVectorOutputPort("coupling_wrench", 6, self._calc_coupling, inputs)
        self._probe_wrench = self.DeclareVectorOutputPort("probe_wrench", 6, self._calc_probe_wrench, inputs)

    def coupling_wrench(
        self,
        *,
        X_HD: RigidTransform,
        V_HD: NDArray[np.float64],
        X_HP: RigidTransform,
        V_HP: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """[torque; force] of the coupling on the peg, at the tip, in H."""
        c = self._coupling
        R_HD, R_HP = X_HD.rotation(), X_HP.rotation()
        torque = c.angular_stiffness * rotation_vector(R_HD @ R_HP.inverse()) + c.angular_damping * (
            V_HD[:3] - V_HP[:3]
        )
        force = c.stiffness * (X_HD.translation() - X_HP.translation()) + c.damping * (V_HD[3:] - V_HP[3:])
        return np.concatenate([torque, force])

    def guide_wrench(self, *, X_HP: RigidTransform, V_HP: NDArray[np.float64]) -> NDArray[np.float64]:
        """[torque; force] of the fixture's guide on the peg, at the tip, in H."""
        deviation = self._fixture.deviation(X_HP)
        if deviation is None:
            return np.zeros(6)
        c = self._coupling
        lever = deviation.p_HQ - X_HP.translation()
        velocity = V_HP[3:] + cross(V_HP[:3], lever)
        if deviation.free_axis_H is not None:
            velocity = velocity - (velocity @ deviation.free_axis_H) * deviation.free_axis_H
        force = -c.guide_stiffness * deviation.d_HQ - c.guide_damping * velocity
        held = deviation.guides_rotation
        spin = held.T @ (held @ V_HP[:3])
        torque = -c.angular_stiffness * deviation.theta_H - c.angular_damping * spin
        return np.concatenate([torque + cross(lever, force), force])

    def _calc_motion(self, context: Context, output: AbstractValue) -> None:
        state = self._peg_state.Eval(context)
        quaternion = Quaternion(state[:4] / math.sqrt(state[:4] @ state[:4]))
        output.set_value(PegMotion(RigidTransform(RotationMatrix(quaternion), state[4:7]), state[7:13].copy()))

    def _peg_motion(self, context: Context) -> tuple[RigidTransform, NDArray[np.float64]]:
        motion = self._motion.Eval(context)
        return motion.X_HP, motion.V_HP

    def _calc_coupling(self, context: Context, output: BasicVector) -> None:
        X_HP, V_HP = self._peg_motion(context)
        output.SetFromVector(
            self.coupling_wrench(
                X_HD=self._probe_pose.Eval(context),
                V_HD=self._probe_velocity.Eval(context),
                X_HP=X_HP,
                V_HP=V_HP,
            )
        )

    def _calc_probe_wrench(self, context: Context, output: BasicVector) -> None:
        wrench = self._coupling_wrench.Eval(context)
        scale = np.repeat([self._coupling.torque_scale, self._coupling.force_scale], 3)
        output.SetFromVector(-scale * wrench)

    def _calc_peg_forces(self, context: Context, output: Value) -> None:
        X_HP, V_HP = self._peg_motion(context)
        wrench = self._coupling_wrench.Eval(context) + self.guide_wrench(X_HP=X_HP, V_HP=V_HP)
        force = ExternallyAppliedSpatialForce()
        force.body_index = self._peg
        force.p_BoBq_B = np.zeros(3)
        force.F_Bq_W = SpatialForce(tau=wrench[:3], f=wrench[3:])
        output.set_value([force])
