"""An arm that takes joint torques, with its peg and its sensor, as a controller of one's own or a protocol meets it."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, MeshcatVisualizer, MeshcatVisualizerParams
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from models.scenario import Scenario
from skill.arrays import Array
from systems.arm.arm_bodies import PERIOD, AddArm, joint_damping
from systems.arm.kinematics import ArmKinematics
from systems.arm.tip_servo import TipMotion
from systems.law.wiring import AddSensor
from systems.law.wrench_sensor import wrench_at_tip
from systems.plant.held_peg import HeldPeg

PICTURE_PERIOD = 1 / 32  # in units of s
FRICTION = 0.2
"""Of a joint that moves, N m, as in Franka Robotics' franka_description."""

FRICTION_RATE = 5e-3
"""Rate at which the friction of a joint has tanh(1) of its size, rad/s."""


class TorqueArm:
    """An arm under gravity that advances a millisecond at a time.

    A joint with the rate v loses the torque `FRICTION` tanh(v / `FRICTION_RATE`), beside the damping of its model.

    Attributes:
        kinematics: that a controller knows.
        scenario: resolved.
        stiffness, damping: (n,), of the joints where they hold a position, N m/rad and N m s/rad.

    Args:
        scenario: resolved, of an arm.
        meshcat: where to draw; None draws nothing.
    """

    def __init__(self, scenario: Scenario, *, meshcat: Meshcat | None = None) -> None:
        self.scenario, self.kinematics = scenario, ArmKinematics(scenario)
        builder = DiagramBuilder()
        self._bodies = AddArm(builder, scenario, self.kinematics, holds=False)
        self._peg: HeldPeg = builder.AddNamedSystem("held_peg", HeldPeg(scenario, period=PERIOD))
        p_FP = self._bodies.tip.GetFixedPoseInBodyFrame().translation()
        motion = TipMotion(scenario, self.kinematics, flange=self._bodies.flange, p_FP=p_FP)
        builder.AddNamedSystem("tip_motion", motion)
        builder.Connect(self._bodies.state, motion.GetInputPort("joint_state"))
        builder.Connect(motion.GetOutputPort("anchor"), self._peg.GetInputPort("anchor"))
        builder.Connect(self._peg.GetOutputPort("held_wrench"), motion.GetInputPort("held_wrench"))
        builder.Connect(motion.GetOutputPort("forces"), self._bodies.plant.get_applied_spatial_force_input_port())
        self._sensor = AddSensor(builder, scenario, self._peg.GetOutputPort("reaction_forces"), weld=0, weight=0.0)
        builder.ExportInput(self._bodies.torques, "torques")
        if meshcat is not None:
            parameters = MeshcatVisualizerParams(publish_period=PICTURE_PERIOD)
            MeshcatVisualizer.AddToBuilder(builder, self._bodies.scene_graph, meshcat, parameters)
        diagram = builder.Build()
        diagram.set_name("arm")
        self._simulator = Simulator(diagram)
        self._context = self._simulator.get_mutable_context()
        self._own = self._bodies.plant.GetMyMutableContextFromRoot(self._context)
        self._torques = diagram.GetInputPort("torques").FixValue(self._context, np.zeros(len(self.kinematics.posture)))
        self.damping = joint_damping(scenario.arm, self.kinematics)
        self.stiffness = np.full(len(self.damping), scenario.arm.joint_stiffness)
        self._step = 0

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self._step * PERIOD

    @property
    def angles(self) -> Array:
        """Angles of the joints (n,), rad."""
        return np.array(self._bodies.plant.GetPositions(self._own))

    @property
    def rates(self) -> Array:
        """Rates of the joints (n,), rad/s."""
        return np.array(self._bodies.plant.GetVelocities(self._own))

    @property
    def held_weight(self) -> float:
        """Weight of what hangs on the sensor, N."""
        return self._peg.compliance.weight

    def set_start(self, angles: Array) -> None:
        """Puts the joints at angles (n,), rad, at rest, with the peg on its compliance."""
        self._bodies.plant.SetPositions(self._own, angles)
        self._bodies.plant.SetVelocities(self._own, np.zeros_like(angles))
        self._peg.set_start(self._context, self.kinematics.tip(angles))

    def set_trial(self, trial: Scenario) -> None:
        """Sets friction and pose of the hole of another resolved scenario: the tilt of its start is that of the hole.

        An arm does not know this tilt; a rig has it in its peg.
        """
        assert trial.start.tilt is not None
        pitch, yaw = (-angle for angle in trial.start.tilt)
        clocking = RotationMatrix.MakeZRotation(-(trial.start.clocking or 0.0))
        R_WH = RotationMatrix(RollPitchYaw(pitch, 0.0, 0.0)) @ RotationMatrix(RollPitchYaw(0.0, yaw, 0.0)) @ clocking
        self._peg.set_trial(self._context, trial)
        self._peg.set_hole(self._context, RigidTransform(R_WH, [*(trial.arm.hole_offset or (0.0, 0.0)), 0.0]))

    def advance(self, torques: Array) -> None:
        """Applies motor torques (n,), N m, for a millisecond."""
        v = self.rates
        left = torques - FRICTION * np.tanh(v / FRICTION_RATE)
        self._torques.GetMutableData().get_mutable_value().SetFromVector(left)
        self._step += 1
        self._simulator.AdvanceTo(self.time)

    def peg_in_hole(self) -> RigidTransform:
        """Returns X_HP."""
        return self._peg.peg_in_hole(self._context)

    def contact_force(self) -> float:
        """Returns the sum of the normal forces on the peg, N."""
        return self._peg.contact_extent(self._context)

    def reading(self) -> Array:
        """Returns what the sensor reads (6,), N and N m: the force of the world on what hangs on it, with the weight.

        It is about the origin of the sensor, along the axes of the peg.
        """
        own = self._sensor.GetMyContextFromRoot(self._context)
        about_tip = np.array(self._sensor.GetOutputPort("wrench").Eval(own))
        return wrench_at_tip(about_tip, -self.scenario.sensor.height)

    def world_wrench(self) -> Array:
        """Returns the true wrench (6,) of the world on what hangs on the sensor, about the tip, along the axes of W.

        It includes the weight and the inertial force.
        """
        own = self._peg.GetMyContextFromRoot(self._context)
        held = np.array(self._peg.GetOutputPort("held_wrench").Eval(own))
        return np.array([*-held[3:], *-held[:3]])
