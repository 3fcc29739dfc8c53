"""Kinematics of an arm: where its tip is, and which joint motion moves it to a pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, Frame, JacobianWrtVariable

import models
from models.arm import FR3, UR5E
from models.scenario import Scenario
from skill.arrays import Array
from systems.math.rotation import rotation_vector

FLANGE_TO_SENSOR = 0.04
"""Distance of the sensor's origin from the flange, m."""

DAMPING = 1e-6
"""Of the least squares of joint motions, in units of the Jacobian's squares."""


@dataclass(frozen=True)
class ArmModel:
    """An arm that a scenario may name.

    Attributes:
        file: in ``models/``.
        posture: (n,), joint angles near which the tip stands over the hole, rad.
        rotor_inertia: (n,), of the motors, kg m^2.
        gear_ratio: (n,).
    """

    file: str
    posture: tuple[float, ...]
    rotor_inertia: tuple[float, ...]
    gear_ratio: tuple[float, ...]


ARMS = {
    FR3: ArmModel(
        "fr3.sdf",
        posture=(0.0, -0.2, 0.0, -2.4, 0.0, 2.2, 0.785),
        # Franka Robotics' franka_description, as the inertias of the model.
        rotor_inertia=(4.206399e-5,) * 2 + (3.211626e-5,) * 5,
        gear_ratio=(120.0,) * 4 + (80.0,) * 3,
    ),
    UR5E: ArmModel(
        "ur5e.sdf",
        posture=(2.87, -1.37, 2.08, -2.28, -1.57, -1.84),
        # 0.1 kg m^2 at the joints, as in MuJoCo Menagerie's UR5e, which calls it untuned; none is published [choice].
        rotor_inertia=(9.8e-6,) * 6,
        gear_ratio=(101.0,) * 6,
    ),
}


def add_arm_model(plant: MultibodyPlant, scenario: Scenario) -> Frame:
    """Adds the arm of a scenario to a plant whose world is W, and returns the frame of the tip of the peg at rest.

    The origin of W is the centre of the mouth where one believes it to be, its z axis points up.
    """
    model = ARMS[scenario.carrier]
    Parser(plant).AddModels(str(Path(models.__file__).parent / model.file))
    plant.WeldFrames(
        plant.world_frame(),
        plant.GetFrameByName("link0"),
        RigidTransform(-np.array(scenario.arm.hole)),
    )
    flange = plant.GetFrameByName("flange")
    reach = FLANGE_TO_SENSOR + scenario.sensor.height
    # The peg's z axis points from its tip to the flange.
    X_FP = RigidTransform(RollPitchYaw(np.pi, 0.0, 0.0), [0.0, 0.0, reach])
    return plant.AddFrame(FixedOffsetFrame("tip", flange, X_FP))


class ArmKinematics:
    """The kinematics that a controller knows.

    Args:
        scenario: of an arm.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._plant = MultibodyPlant(0.0)
        self._tip = add_arm_model(self._plant, scenario)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self.model = ARMS[scenario.carrier]
        self.posture = np.array(self.model.posture)

    def tip(self, q: Array) -> RigidTransform:
        """Returns X_WP of the peg at rest on its compliance, at joint angles (n,), rad."""
        self._plant.SetPositions(self._context, q)
        return self._tip.CalcPoseInWorld(self._context)

    def flange(self, q: Array) -> RigidTransform:
        """Returns X_WF of the flange at joint angles (n,), rad."""
        self._plant.SetPositions(self._context, q)
        return self._plant.GetFrameByName("flange").CalcPoseInWorld(self._context)

    def jacobian(self, q: Array) -> Array:
        """Returns the Jacobian (6, n) of angular velocity and velocity of the tip in W."""
        self._plant.SetPositions(self._context, q)
        world = self._plant.world_frame()
        found: Array = self._plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kV, self._tip, np.zeros(3), world, world
        )
        return found

    def motion_to(self, q: Array, X_WP: RigidTransform) -> Array:
        """Returns the joint motion (n,), rad, that moves the tip from angles (n,) to a pose, to first order."""
        X, J = self.tip(q), self.jacobian(q)
        twist = np.concatenate(
            [rotation_vector(X_WP.rotation() @ X.rotation().inverse()), X_WP.translation() - X.translation()]
        )
        found: Array = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), twist)
        return found

    def weight_torques(self, q: Array, held_weight: float) -> Array:
        """Returns the torques (n,), N m, that carry the arm and a weight (N) at its tip at joint angles (n,), rad."""
        held = held_weight * self.jacobian(q)[5]
        found: Array = held - self._plant.CalcGravityGeneralizedForces(self._context)
        return found

    def inertia(self, q: Array) -> Array:
        """Returns the inertia (n,) of each joint with the arm beyond it and its rotor, kg m^2, the others held."""
        self._plant.SetPositions(self._context, q)
        rotors = np.array(self.model.rotor_inertia) * np.array(self.model.gear_ratio) ** 2
        return np.asarray(np.diag(self._plant.CalcMassMatrix(self._context)) + rotors)

    def stiffness(self, q: Array, joint_stiffness: float) -> Array:
        """Returns the stiffness (6,) about and along each axis of W at the tip, N m/rad and N/m, of stiff joints."""
        J = self.jacobian(q)
        return np.asarray(joint_stiffness / np.einsum("ij,ij->i", J, J))

    def angles_at(self, X_WP: RigidTransform) -> Array:
        """Returns joint angles (n,), rad, with the tip at a pose, near the posture of the arm.

        Raises:
            ValueError: if the arm does not reach it.
        """
        q = self.posture.copy()
        for _ in range(50):
            step = self.motion_to(q, X_WP)
            q += step * min(1.0, 0.3 / max(np.abs(step).max(), 1e-12))
            if np.abs(step).max() < 1e-12:
                break
        lower, upper = self._plant.GetPositionLowerLimits(), self._plant.GetPositionUpperLimits()
        if np.abs(self.motion_to(q, X_WP)).max() > 1e-9 or (q < lower).any() or (q > upper).any():
            raise ValueError(
                f"the arm does not reach the point {np.round(1e3 * X_WP.translation(), 1)} mm over the hole; place the"
                " hole elsewhere (arm.hole)"
            )
        return q
