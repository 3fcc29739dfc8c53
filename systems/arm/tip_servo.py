"""The motion of an arm's tip: what it is commanded, where it is, and how the peg loads the arm."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.scenario import Scenario
from skill.arrays import Array
from skill.data.axes import AXES
from systems.arm.arm_bodies import PERIOD
from systems.arm.kinematics import ArmKinematics
from systems.arm.tip import HEIGHT, SIZE, X, Y, tip_step


def tip_pose(angles: Array, tip: Array) -> RigidTransform:
    """Returns X_WP of a peg over a hole that is turned by three angles (rad), as the rig's.

    An arm turns the peg instead, by the inverse rotation about the centre of the mouth.

    Args:
        angles: (3,).
        tip: (SIZE,) of `systems.arm.tip`, its height and where the mouth is.
    """
    pitch, yaw, clocking = angles
    R_WH = RotationMatrix(RollPitchYaw(pitch, 0.0, 0.0)) @ RotationMatrix(RollPitchYaw(0.0, yaw, 0.0))
    R_HP = (R_WH @ RotationMatrix.MakeZRotation(clocking)).inverse()
    return RigidTransform(R_HP, R_HP @ np.array([0.0, 0.0, tip[HEIGHT]]) + np.array([tip[X], tip[Y], 0.0]))


def tip_at(height: float) -> Array:
    """Returns the state of a tip (SIZE,) at rest at a height (m) over the mouth that the scenario names."""
    found = np.zeros(SIZE)
    found[HEIGHT] = height
    return found


def height_along(X_WP: RigidTransform) -> float:
    """Returns the height of a tip over the mouth where one believes it to be, along the axis of the peg, m."""
    return float(X_WP.rotation().matrix()[:, 2] @ X_WP.translation())


class TipServo(LeafSystem):
    """
    .. pydrake_system::

        name: TipServo
        input_ports:
        - target_pitch
        - target_yaw
        - target_clocking
        - feed_speed
        - wrench
        - joint_state
        output_ports:
        - desired
        - torques

    Moves the joints of an arm so that the tip follows the commands of the force guard: ``target_*``, the angles of the
    hole relative to the start (rad), which the peg turns by the inverse of, and ``feed_speed`` (m/s). It yields to the
    measured ``wrench`` as in `tip_step`. ``desired`` (2n,) is the angles and rates of the joints, rad and rad/s, after
    the delay of the arm. ``torques`` (n,) compensates for the weight of the arm and of what it holds, with the relative
    error of the scenario.

    Args:
        scenario: resolved, of an arm.
        kinematics: of the arm.
        held_weight: of what the arm holds, N.
    """

    def __init__(self, scenario: Scenario, kinematics: ArmKinematics, *, held_weight: float) -> None:
        super().__init__()
        self._arm, self._kinematics, self._weight = scenario.arm, kinematics, held_weight
        self._targets = [self.DeclareVectorInputPort(f"target_{name}", 1) for name in AXES]
        self._feed = self.DeclareVectorInputPort("feed_speed", 1)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        n = len(self._kinematics.posture)
        self._joints = self.DeclareVectorInputPort("joint_state", 2 * n)
        self._rows = 2 + round(scenario.arm.delay / PERIOD)  # joint angles, the newest first
        self._start = self.DeclareAbstractParameter(Value[object](np.zeros(3)))
        self._angles = self.DeclareDiscreteState(self._rows * n)
        self._tip = self.DeclareDiscreteState(SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, self._update)
        self.DeclareVectorOutputPort("desired", 2 * n, self._calc_desired, {self.discrete_state_ticket(self._angles)})
        self.DeclareVectorOutputPort("torques", n, self._calc_torques, {self._joints.ticket()})

    def set_start(self, context: Context, angles: Array, height: float) -> Array:
        """Puts the command at a start, at rest, and returns the joint angles (n,) there; ``context`` is the root's."""
        own = self.GetMyMutableContextFromRoot(context)
        tip = tip_at(height)
        q = self._kinematics.angles_at(tip_pose(angles, tip))
        own.get_mutable_abstract_parameter(self._start).set_value(np.array(angles))
        own.SetDiscreteState(self._angles, np.tile(q, self._rows))
        own.SetDiscreteState(self._tip, tip)
        return q

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        tip = np.array(context.get_discrete_state(self._tip).value())
        rows = np.array(context.get_discrete_state(self._angles).value()).reshape(self._rows, -1)
        start = context.get_abstract_parameter(self._start).get_value()
        angles = start + np.array([port.Eval(context)[0] for port in self._targets])
        push = tip_pose(angles, tip).rotation() @ self._wrench.Eval(context)[:3]
        tip = tip_step(self._arm, PERIOD, tip, self._feed.Eval(context)[0], push[:2])
        q = rows[0] + self._kinematics.motion_to(rows[0], tip_pose(angles, tip))
        discrete_state.set_value(self._tip, tip)
        discrete_state.set_value(self._angles, np.vstack([q, rows[:-1]]).ravel())

    def _calc_desired(self, context: Context, output: BasicVector) -> None:
        newer, older = np.array(context.get_discrete_state(self._angles).value()).reshape(self._rows, -1)[-2:]
        output.SetFromVector(np.concatenate([newer, (newer - older) / PERIOD]))

    def _calc_torques(self, context: Context, output: BasicVector) -> None:
        joints = self._joints.Eval(context)
        found = self._kinematics.weight_torques(joints[: len(joints) // 2], self._weight)
        output.SetFromVector((1.0 + self._arm.gravity_error) * found)


class TipMotion(LeafSystem):
    """
    .. pydrake_system::

        name: TipMotion
        input_ports:
        - joint_state
        - held_wrench
        output_ports:
        - anchor
        - depth
        - forces

    From the joints of an arm (angles and rates, rad and rad/s) the motion of its tip: ``anchor`` (13,), for a
    `HeldPeg`, and the measured ``depth`` of the tip (m), which does not know how the compliance is bent. ``forces`` are
    those of what the arm holds on its flange, the opposite of ``held_wrench`` (6,), torque and force at the tip in W.

    Args:
        scenario: of an arm.
        kinematics: of the arm.
        flange: index of the body that carries the flange.
        p_FP: (3,), the tip in the frame of this body, m.
    """

    def __init__(self, scenario: Scenario, kinematics: ArmKinematics, *, flange: BodyIndex, p_FP: Array) -> None:
        super().__init__()
        self._kinematics, self._resolution = kinematics, scenario.arm.depth_resolution
        self._flange, self._p_FP = flange, p_FP
        n = len(self._kinematics.posture)
        self._joints = self.DeclareVectorInputPort("joint_state", 2 * n)
        self._held = self.DeclareVectorInputPort("held_wrench", 6)
        joints = {self._joints.ticket()}
        self.DeclareVectorOutputPort("anchor", 13, self._calc_anchor, joints)
        self.DeclareVectorOutputPort("depth", 1, self._calc_depth, joints)
        self.DeclareAbstractOutputPort(
            "forces",
            lambda: AbstractValue.Make([ExternallyAppliedSpatialForce()]),
            self._calc_forces,
            {self._held.ticket()},
        )

    def _calc_anchor(self, context: Context, output: BasicVector) -> None:
        q, v = np.split(self._joints.Eval(context), 2)
        X_WP = self._kinematics.tip(q)
        pose = [*X_WP.rotation().ToQuaternion().wxyz(), *X_WP.translation()]
        output.SetFromVector([*pose, *(self._kinematics.jacobian(q) @ v)])

    def _calc_depth(self, context: Context, output: BasicVector) -> None:
        q, _ = np.split(self._joints.Eval(context), 2)
        height = height_along(self._kinematics.tip(q))
        output[0] = -round(height / self._resolution) * self._resolution

    def _calc_forces(self, context: Context, output: AbstractValue) -> None:
        held = self._held.Eval(context)
        force = ExternallyAppliedSpatialForce()
        force.body_index, force.p_BoBq_B = self._flange, self._p_FP
        force.F_Bq_W = SpatialForce(tau=-held[:3], f=-held[3:])
        output.set_value([force])
