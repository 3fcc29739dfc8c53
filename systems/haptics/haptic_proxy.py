"""Implements the haptic proxy: the virtual coupling of probe and virtual peg, and the guide of a virtual fixture."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, LeafSystem, ValueProducer

from models.scenario import CouplingParameters
from systems.haptics.virtual_fixture import Fixture
from systems.math.rotation import cross, free_body_pose, rotation_vector


@dataclass(frozen=True)
class PegMotion:
    """Pose of the peg in H, and its [angular velocity; velocity] (6,) in H, rad/s and m/s."""

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

    The virtual coupling pulls the peg P towards the probe D with the wrench

        F_P = K (p_HD - p_HP) + B (v_HD - v_HP),
        t_P = K_r log(R_HD R_PH) + B_r (w_HD - w_HP),

    at the tip, in H. The logarithm is a rotation vector, regular below 180 degrees. The probe receives the scaled
    reaction -(torque_scale t_P, force_scale F_P). A virtual fixture adds a spring-damper on the deviation from its
    constraint (see `Deviation`), with the linear gains of the guide and the angular gains of the coupling.

    ``peg_state`` is [quaternion, position, angular velocity, velocity] of the floating peg. H and W coincide in the
    virtual environment. Wrenches and velocities have the angular part first.

    Args:
        coupling: Gains of the coupling and the guide, and the scales.
        fixture: The virtual fixture.
        peg: Index of the peg in the plant.
    """

    def __init__(self, *, coupling: CouplingParameters, fixture: Fixture, peg: BodyIndex) -> None:
        super().__init__()
        self._coupling = coupling
        self._fixture = fixture
        self._peg = peg
        self._scale = np.repeat([coupling.torque_scale, coupling.force_scale], 3)
        self._probe_pose = self.DeclareAbstractInputPort("probe_pose", Value[RigidTransform]())
        self._probe_velocity = self.DeclareVectorInputPort("probe_velocity", 6)
        self._peg_state = self.DeclareVectorInputPort("peg_state", 13)
        # Pose and velocity of the peg, computed once per step for all outputs.
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

    def guide_wrench(self, *, X_HP: RigidTransform, V_HP: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns the wrench [torque; force] (6,) of the fixture's guide on the peg, at the tip, in H.

        Args:
            X_HP: Pose of the peg.
            V_HP: [angular velocity; velocity] of the peg (6,), in H.
        """
        deviation = self._fixture(X_HP)
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
        output.set_value(PegMotion(free_body_pose(state[:7]), state[7:].copy()))

    def _calc_coupling(self, context: Context, output: BasicVector) -> None:
        c, peg = self._coupling, self._motion.Eval(context)
        X_HD, V_HD = self._probe_pose.Eval(context), self._probe_velocity.Eval(context)
        R_HD, R_HP = X_HD.rotation(), peg.X_HP.rotation()
        torque = c.angular_stiffness * rotation_vector(R_HD @ R_HP.inverse()) + c.angular_damping * (
            V_HD[:3] - peg.V_HP[:3]
        )
        force = c.stiffness * (X_HD.translation() - peg.X_HP.translation()) + c.damping * (V_HD[3:] - peg.V_HP[3:])
        output.SetFromVector(np.concatenate([torque, force]))

    def _calc_probe_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(-self._scale * self._coupling_wrench.Eval(context))

    def _calc_peg_forces(self, context: Context, output: Value) -> None:
        peg = self._motion.Eval(context)
        wrench = self._coupling_wrench.Eval(context) + self.guide_wrench(X_HP=peg.X_HP, V_HP=peg.V_HP)
        force = ExternallyAppliedSpatialForce()
        force.body_index = self._peg
        force.p_BoBq_B = np.zeros(3)
        force.F_Bq_W = SpatialForce(tau=wrench[:3], f=wrench[3:])
        output.set_value([force])
