"""The bodies of an arm, and what drives its joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Frame, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from models.arm import ArmParameters
from models.scenario import Scenario
from skill.arrays import Array
from systems.arm.kinematics import ArmKinematics, add_arm_model
from systems.plant.contact_plant import BLOCK_COLOUR, PEG_COLOUR, block_picture, peg_shape

PERIOD = 1e-3
"""Step of the arm, s."""


@dataclass(frozen=True)
class ArmBodies:
    """A finalised plant of an arm.

    Attributes:
        plant: the plant.
        scene_graph: its scene graph.
        tip: frame of the tip of the peg at rest on its compliance.
    """

    plant: MultibodyPlant
    scene_graph: SceneGraph
    tip: Frame

    @property
    def flange(self) -> BodyIndex:
        """Index of the body that carries the flange."""
        return self.tip.body().index()

    @property
    def arm(self) -> ModelInstanceIndex:
        """Index of the arm in the plant."""
        return self.tip.body().model_instance()

    @property
    def desired(self) -> InputPort:
        """Desired angles and rates (2n,), rad and rad/s."""
        return self.plant.get_desired_state_input_port(self.arm)

    @property
    def torques(self) -> InputPort:
        """Torques beside those of the spring-dampers (n,), N m."""
        return self.plant.get_actuation_input_port(self.arm)

    @property
    def state(self) -> OutputPort:
        """Angles and rates (2n,), rad and rad/s."""
        return self.plant.get_state_output_port(self.arm)


def AddArm(builder: DiagramBuilder, scenario: Scenario, kinematics: ArmKinematics, *, holds: bool) -> ArmBodies:
    """Adds the arm of a scenario, with pictures of peg and block, where one believes the hole to be.

    Args:
        builder: of the diagram.
        scenario: of an arm.
        kinematics: of this arm.
        holds: whether implicit spring-dampers hold the joints at desired angles; otherwise they have torques only.
    """
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, PERIOD)
    tip = add_arm_model(plant, scenario)
    model, stiffness = kinematics.model, scenario.arm.joint_stiffness
    damping = joint_damping(scenario.arm, kinematics)
    joints = [plant.get_joint(index) for index in plant.GetJointIndices(tip.body().model_instance())]
    turning = [joint for joint in joints if joint.num_velocities() > 0]
    for joint, rotor, ratio, d in zip(turning, model.rotor_inertia, model.gear_ratio, damping, strict=True):
        drive = plant.GetJointActuatorByName(joint.name())
        drive.set_default_rotor_inertia(rotor)
        drive.set_default_gear_ratio(ratio)
        if holds:
            drive.set_controller_gains(PdControllerGains(p=stiffness, d=d))
    g = scenario.geometry
    X_PC, shape = peg_shape(g)
    X_BC = tip.GetFixedPoseInBodyFrame() @ X_PC
    plant.RegisterVisualGeometry(tip.body(), X_BC, shape, "peg_picture", PEG_COLOUR)
    plant.RegisterVisualGeometry(plant.world_body(), RigidTransform(), block_picture(g), "block_picture", BLOCK_COLOUR)
    plant.Finalize()
    return ArmBodies(plant, scene_graph, tip)


def joint_damping(arm: ArmParameters, kinematics: ArmKinematics) -> Array:
    """Returns the damping (n,) of joints that are held, N m s/rad, near the posture of the arm."""
    inertia = kinematics.inertia(kinematics.posture)
    return np.asarray(2.0 * arm.joint_damping * np.sqrt(arm.joint_stiffness * inertia))
