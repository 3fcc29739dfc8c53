"""The diagram of the 3-DOF rig: a peg on a DC feed drive, a hole on two steppers, and their controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Multiplexer

from models.arm import RIG
from models.scenario import Scenario
from skill.policy.rig_policy import RigPolicy
from systems.arm.arm_diagram import MakeArm
from systems.law.dc_motor import DcMotor
from systems.law.depth_encoder import DepthEncoder
from systems.law.drive_monitor import DriveLimits, DriveMonitor
from systems.law.force_guard import StoppingModel
from systems.law.stepper_motor import StepperMotor
from systems.law.wiring import (
    AddLaw,
    AddSensor,
    ConnectMeasurement,
    ConnectMonitors,
    Law,
    check_geometry,
    check_start,
)
from systems.law.wrench_sensor import WrenchSensor
from systems.plant.contact_plant import AddRigPlant, HydroelasticRig, NominalBodies
from systems.plant.exact_plant import ExactPlant
from systems.plant.rig_plant import stepper_axes
from systems.recording.run_recorder import AddRunRecorder
from systems.rig_diagram import RigDiagram, start_angles

RigPlant = HydroelasticRig | ExactPlant
"""Carriage, mount, peg, gimbal and block. Both have the same ports, and the queries of a `PegCarrier`."""


def MakeRig(scenario: Scenario, skill: RigPolicy) -> RigDiagram:
    """Builds the diagram of a resolved scenario, of the rig or of the arm that carries the peg instead.

    Args:
        scenario: resolved; the tilt of its start is that of the peg relative to the hole.
        skill: the policy, such as a skill or a control law (see `systems.law.control_law`).

    Raises:
        ValueError: if the scenario is not resolved, or the policy was trained for another peg or hole.
    """
    if scenario.carrier != RIG:
        return MakeArm(scenario, skill)
    builder = DiagramBuilder()
    plant = AddEngine(builder, scenario)
    return WireRig(builder, scenario, skill, plant)


def AddEngine(builder: DiagramBuilder, scenario: Scenario) -> RigPlant:
    """Adds the mechanics of the rig in the engine that a resolved scenario names."""
    if scenario.contact.engine == "drake":
        return AddRigPlant(builder, scenario)
    plant: ExactPlant = builder.AddNamedSystem("plant", ExactPlant(scenario))
    return plant


def WireRig(
    builder: DiagramBuilder,
    scenario: Scenario,
    skill: RigPolicy,
    plant: RigPlant,
) -> RigDiagram:
    """Adds sensors, motors and controller to a plant, and builds the diagram; see `MakeRig`."""
    check_start(scenario)
    check_geometry(scenario, skill)
    angles = dict(zip(stepper_axes(scenario), start_angles(scenario), strict=True))
    known = NominalBodies.of(scenario)  # not those of the plant, which no rig knows
    law = AddLaw(
        builder,
        scenario,
        skill,
        stopping=StoppingModel.of(scenario, mass=known.mass, inertia=known.turning_inertia),
        steppers=tuple(angles),
    )
    drives = _AddDrives(builder, scenario, angles=angles)
    sensor = AddSensor(builder, scenario, plant.reaction_forces, weld=plant.sensor, weight=plant.weight)
    _ConnectMonitors(builder, plant, law, sensor, drives)
    _ConnectMotors(builder, plant, law, drives)
    recorder = AddRunRecorder(
        builder=builder,
        ports={
            **law.recorded(tuple(drives.steppers)),
            **{
                (f"{name}_taken", f"{name}_lost"): stepper.GetOutputPort("step_counts")
                for name, stepper in drives.steppers.items()
            },
            ("carriage", "carriage_speed"): plant.carriage_state,
            **{(name,): drives.gimbal_angles.get_output_port(k) for k, name in enumerate(drives.steppers)},
        },
        period=scenario.controller.period,
        home=scenario.sensor.height,
    )
    steppers = tuple(drives.steppers.values())
    diagram = builder.Build()
    diagram.set_name("rig")
    return RigDiagram(diagram, plant, recorder, law, sensor, steppers=steppers, scenario=scenario)


@dataclass(frozen=True)
class _Drives:
    """The motors of the rig, their encoders and their monitors."""

    encoder: DepthEncoder
    drive_monitor: DriveMonitor
    motor: DcMotor
    steppers: dict[str, StepperMotor]  # in the order of `stepper_axes`
    gimbal_angles: Demultiplexer  # their angles and rates


def _AddDrives(builder: DiagramBuilder, scenario: Scenario, *, angles: dict[str, float]) -> _Drives:
    step, resolution = scenario.contact.time_step, scenario.rig.encoder_resolution
    return _Drives(
        encoder=builder.AddNamedSystem(
            "depth_encoder", DepthEncoder(home=scenario.sensor.height, resolution=resolution)
        ),
        drive_monitor=builder.AddNamedSystem("drive_monitor", DriveMonitor(DriveLimits.of(scenario))),
        motor=builder.AddNamedSystem("dc_motor", DcMotor(parameters=scenario.feed, period=step)),
        steppers={
            name: builder.AddNamedSystem(
                f"{name}_stepper", StepperMotor(parameters=scenario.stepper, period=step, start_angle=angle)
            )
            for name, angle in angles.items()
        },
        gimbal_angles=builder.AddNamedSystem("gimbal_angles", Demultiplexer(2 * len(angles))),
    )


def _ConnectMonitors(builder: DiagramBuilder, plant: RigPlant, law: Law, sensor: WrenchSensor, drives: _Drives) -> None:
    builder.Connect(plant.carriage_state, drives.encoder.GetInputPort("carriage_state"))
    builder.Connect(sensor.GetOutputPort("wrench"), law.monitor.GetInputPort("raw_wrench"))
    builder.Connect(drives.encoder.GetOutputPort("depth"), law.monitor.GetInputPort("raw_depth"))
    ConnectMonitors(builder, law, drives.drive_monitor)
    ConnectMeasurement(builder, law, drives.drive_monitor)
    for name in ("current", "travel"):
        builder.Connect(drives.motor.GetOutputPort(name), drives.drive_monitor.GetInputPort(name))
    for name, stepper in drives.steppers.items():
        builder.Connect(stepper.GetOutputPort("shaft"), law.watchdog.GetInputPort(f"{name}_shaft"))


def _ConnectMotors(builder: DiagramBuilder, plant: RigPlant, law: Law, drives: _Drives) -> None:
    for reader, port in ((drives.motor, "speed_command"), (drives.drive_monitor, "feed_speed")):
        builder.Connect(law.force_guard.GetOutputPort("feed_speed"), reader.GetInputPort(port))
    builder.Connect(drives.drive_monitor.GetOutputPort("feed_enabled"), drives.motor.GetInputPort("enabled"))
    builder.Connect(plant.carriage_state, drives.motor.GetInputPort("carriage_state"))
    builder.Connect(drives.motor.GetOutputPort("carriage_force"), plant.carriage_force)
    n = len(drives.steppers)
    rates = builder.AddNamedSystem("at_rest", ConstantVectorSource(np.zeros(n)))
    equilibrium = builder.AddNamedSystem("equilibrium", Multiplexer([1] * n + [n]))
    builder.Connect(plant.gimbal_state, drives.gimbal_angles.get_input_port())
    for k, (name, stepper) in enumerate(drives.steppers.items()):
        builder.Connect(law.force_guard.GetOutputPort(f"target_{name}"), stepper.GetInputPort("target_angle"))
        builder.Connect(drives.gimbal_angles.get_output_port(k), stepper.GetInputPort("measured_angle"))
        builder.Connect(stepper.GetOutputPort("equilibrium_angle"), equilibrium.get_input_port(k))
    builder.Connect(rates.get_output_port(), equilibrium.get_input_port(n))
    builder.Connect(equilibrium.get_output_port(), plant.gimbal_equilibrium)
