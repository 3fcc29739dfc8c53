"""The diagram of an arm that carries the peg over a fixed hole, behind the same law of control as the rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder

from models.scenario import Scenario
from skill.data.axes import AXES
from skill.policy.rig_policy import RigPolicy
from systems.arm.arm_bodies import PERIOD, AddArm, ArmBodies
from systems.arm.kinematics import ArmKinematics
from systems.arm.tip_servo import TipMotion, TipServo, height_along, tip_at, tip_pose
from systems.law.force_guard import StoppingModel
from systems.law.wiring import AddLaw, AddSensor, ConnectMonitors, check_geometry, check_start
from systems.plant.contact_forces import Contact
from systems.plant.held_peg import Compliance, HeldPeg
from systems.recording.run_recorder import AddRunRecorder
from systems.rig_diagram import RigDiagram


@dataclass(frozen=True)
class ArmPlant:
    """An arm with its peg, for `RigDiagram`.

    Attributes:
        scenario: resolved.
        bodies: of the arm.
        peg: on the compliance.
        servo: of the tip.
    """

    scenario: Scenario
    bodies: ArmBodies
    peg: HeldPeg
    servo: TipServo

    def set_start(self, context: Context, *, carriage: float, angles: Sequence[float]) -> None:
        """See `RigPlant`."""
        turned = np.append(angles, np.zeros(len(AXES) - len(angles)))
        height = carriage - self.scenario.sensor.height
        q = self.servo.set_start(context, turned, height)
        own = self.bodies.plant.GetMyMutableContextFromRoot(context)
        self.bodies.plant.SetPositions(own, q)
        self.bodies.plant.SetVelocities(own, np.zeros_like(q))
        X_WP = tip_pose(turned, tip_at(height))
        sag = X_WP.rotation().inverse() @ np.array([0.0, 0.0, -self.peg.compliance.weight])
        bent = X_WP.rotation() @ (sag / self.peg.compliance.stiffness[3:])
        self.peg.set_start(context, RigidTransform(X_WP.rotation(), X_WP.translation() + bent))

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """See `RigPlant`: sets friction and place of the hole."""
        self.peg.set_trial(context, trial)

    def tip_height(self, context: Context) -> float:
        """See `RigPlant`: along the axis of the peg, from the mouth."""
        return height_along(self.peg.pose(context))

    def peg_in_hole(self, context: Context) -> RigidTransform:
        """See `RigPlant`."""
        return self.peg.peg_in_hole(context)

    def contact_extent(self, context: Context) -> float:
        """See `RigPlant`."""
        return self.peg.contact_extent(context)

    def contacts(self, context: Context) -> list[Contact]:
        """See `RigPlant`."""
        return self.peg.contacts(context)


def stopping_of(scenario: Scenario, kinematics: ArmKinematics, delay: float = 0.0) -> StoppingModel:
    """Returns how an arm stops, from the stiffness of its joints and of its compliance in series.

    A contact that stops the tip at the speed v stops the held mass, which the spring k of the arm carries, and bends
    this spring further until the command stops: F = v (sqrt(k m) + k t); likewise for a turn about the mouth.

    Args:
        scenario: of the arm.
        kinematics: of the arm.
        delay: beyond those of the sensor and of the arm, s.
    """
    arm, sensor = scenario.arm, scenario.sensor
    q = kinematics.angles_at(tip_pose(np.zeros(3), tip_at(scenario.start.height)))
    if arm.impedance is None:
        joints = kinematics.stiffness(q, arm.joint_stiffness)
    else:
        joints = np.repeat(arm.impedance[::-1], 3)
    c = Compliance.of(arm, 0.0)
    turning, _, _, _, _, axial = (1.0 / (1.0 / joints + 1.0 / c.stiffness)).tolist()
    delay += sensor.delay + sensor.time_constant + sensor.period + arm.delay + PERIOD
    reach = scenario.geometry.reach
    return StoppingModel(
        period=sensor.period,
        delay=delay,
        deceleration=arm.max_acceleration,
        feed_impact=math.sqrt(axial * c.inertia[5]) + axial * delay,
        turn_impact=(math.sqrt(turning * c.inertia[0]) + turning * delay) / reach,
    )


def MakeArm(scenario: Scenario, policy: RigPolicy) -> RigDiagram:
    """Builds the diagram of a resolved scenario whose carrier is an arm.

    Args:
        scenario: resolved.
        policy: that acts.

    Raises:
        ValueError: if the scenario is not resolved, the policy was trained for another peg or hole, the arm does not
            reach the start, or it has a Cartesian impedance.
    """
    if scenario.arm.impedance is not None:
        raise ValueError("scenario.arm.impedance is set: this arm is simulated behind its protocol only, by `twin`")
    check_start(scenario)
    check_geometry(scenario, policy)
    builder = DiagramBuilder()
    kinematics = ArmKinematics(scenario)
    bodies = AddArm(builder, scenario, kinematics, holds=True)
    stopping = stopping_of(scenario, kinematics)
    peg = builder.AddNamedSystem("held_peg", HeldPeg(scenario, period=PERIOD))
    weight = peg.compliance.weight
    servo = builder.AddNamedSystem("tip_servo", TipServo(scenario, kinematics, held_weight=weight))
    p_FP = bodies.tip.GetFixedPoseInBodyFrame().translation()
    motion = builder.AddNamedSystem("tip_motion", TipMotion(scenario, kinematics, flange=bodies.flange, p_FP=p_FP))
    law = AddLaw(builder, scenario, policy, stopping=stopping, steppers=())
    sensor = AddSensor(builder, scenario, peg.GetOutputPort("reaction_forces"), weld=0, weight=weight)
    builder.Connect(sensor.GetOutputPort("wrench"), law.monitor.GetInputPort("raw_wrench"))
    builder.Connect(motion.GetOutputPort("depth"), law.monitor.GetInputPort("raw_depth"))
    ConnectMonitors(builder, law, None)
    for name in (*(f"target_{axis}" for axis in AXES), "feed_speed"):
        builder.Connect(law.force_guard.GetOutputPort(name), servo.GetInputPort(name))
    builder.Connect(law.monitor.GetOutputPort("wrench"), servo.GetInputPort("wrench"))
    for reader in (servo, motion):
        builder.Connect(bodies.state, reader.GetInputPort("joint_state"))
    builder.Connect(servo.GetOutputPort("desired"), bodies.desired)
    builder.Connect(servo.GetOutputPort("torques"), bodies.torques)
    builder.Connect(motion.GetOutputPort("anchor"), peg.GetInputPort("anchor"))
    builder.Connect(peg.GetOutputPort("held_wrench"), motion.GetInputPort("held_wrench"))
    builder.Connect(motion.GetOutputPort("forces"), bodies.plant.get_applied_spatial_force_input_port())
    recorder = AddRunRecorder(
        builder=builder,
        ports={**law.recorded(AXES), ("carriage", *AXES): peg.GetOutputPort("as_on_rig")},
        period=scenario.controller.period,
        home=0.0,
    )
    plant = ArmPlant(scenario, bodies, peg, servo)
    diagram = builder.Build()
    diagram.set_name("arm")
    return RigDiagram(diagram, plant, recorder, law, sensor, steppers=(), scenario=scenario)
