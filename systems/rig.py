"""The diagram of the 3-DOF rig: a peg on a DC feed drive, a hole on two steppers, and their controller."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Multiplexer

from models.scenario import Scenario
from skill.data.geometry import PegHoleGeometry, fit_difference
from skill.policy import RigPolicy
from systems.control.drive_monitor import DriveMonitor
from systems.control.estimator import READINGS, PolicyEstimator
from systems.control.force_guard import ForceGuard
from systems.control.policy_controller import PolicyController
from systems.control.self_check import SelfCheck
from systems.control.sensor_monitor import SensorMonitor
from systems.control.watchdog import COMMANDS, MONITORS, Watchdog
from systems.hardware.dc_motor import DcMotor
from systems.hardware.depth_encoder import DepthEncoder
from systems.hardware.stepper_motor import StepperMotor
from systems.hardware.wrench_sensor import WrenchSensor
from systems.plant.contact_plant import AddRigPlant
from systems.plant.exact_plant import ExactPlant
from systems.plant.rig_plant import RigPlant, stepper_axes
from systems.recording.run_recorder import AddRunRecorder, RunRecorder
from systems.rig_diagram import RigDiagram, start_angles
from systems.steps.force_guard import GuardLimits, StoppingModel
from systems.steps.limits import check_limits, drive_limits, retract_limits, sensor_limits
from systems.steps.policy_controller import ControllerLimits
from systems.visualization.meshcat_scene import FRAME
from systems.visualization.plant_display import RigDisplay
from systems.visualization.state_display import StateDisplay


def MakeRig(scenario: Scenario, skill: RigPolicy, *, meshcat: Meshcat | None = None) -> RigDiagram:
    """Builds the diagram of a resolved scenario.

    Args:
        scenario: resolved; the tilt of its start is that of the peg relative to the hole.
        skill: the policy, such as a skill or a control law (see `systems.control.control_law`).
        meshcat: where to draw; None draws nothing.

    Raises:
        ValueError: if the scenario is not resolved, or the policy was trained for another peg or hole.
    """
    builder = DiagramBuilder()
    plant = AddEngine(builder, scenario)
    if meshcat is not None:
        RigDisplay.AddToBuilder(builder, scenario, plant, meshcat, FRAME)
    return WireRig(builder, scenario, skill, plant, meshcat=meshcat)


def AddEngine(builder: DiagramBuilder, scenario: Scenario) -> RigPlant:
    """Adds the mechanics of the rig in the engine that a resolved scenario names.

    Raises:
        ModuleNotFoundError: if MuJoCo is named and not installed.
    """
    match scenario.contact.engine:
        case "exact":
            return ExactPlant.AddToBuilder(builder, scenario)
        case "mujoco":
            from systems.plant.mujoco_plant import MujocoPlant

            return MujocoPlant.AddToBuilder(builder, scenario)
        case _:
            return AddRigPlant(builder, scenario)


def WireRig(
    builder: DiagramBuilder,
    scenario: Scenario,
    skill: RigPolicy,
    plant: RigPlant,
    *,
    meshcat: Meshcat | None = None,
) -> RigDiagram:
    """Adds sensors, motors, controller and a display of the state to a plant, and builds the diagram; see `MakeRig`."""
    if scenario.start.tilt is None:
        raise ValueError("scenario.start.tilt is missing: the scenario is not resolved; use resolve_scenario first")
    if scenario.start.depth > 0.0:
        raise ValueError(
            f"scenario.start.depth is {scenario.start.depth:g} m; expected 0 on the rig, which checks its sensor in"
            " free air before the first touch"
        )
    check_geometry(scenario, skill)
    angles = dict(zip(stepper_axes(scenario), start_angles(scenario), strict=True))
    parts = _add_parts(builder, scenario, skill, plant, angles=angles)
    _connect_sensors(builder, plant, parts)
    _connect_controller(builder, parts)
    _connect_motors(builder, plant, parts)
    if meshcat is not None:
        _add_state_display(builder, scenario, skill, plant, parts, meshcat)
    recorder = _add_recorder(builder, scenario, plant, parts)
    diagram = builder.Build()
    diagram.set_name("rig")
    return RigDiagram(
        diagram,
        plant,
        recorder,
        parts.controller,
        parts.watchdog,
        force_guard=parts.force_guard,
        sensor=parts.sensor,
        steppers=tuple(parts.steppers.values()),
        scenario=scenario,
    )


@dataclass(frozen=True)
class _Parts:
    """The systems of the rig, except for the plant and the recorder."""

    sensor: WrenchSensor
    encoder: DepthEncoder
    estimator: PolicyEstimator
    controller: PolicyController
    monitor: SensorMonitor
    drive_monitor: DriveMonitor
    self_check: SelfCheck
    watchdog: Watchdog
    force_guard: ForceGuard
    motor: DcMotor
    steppers: dict[str, StepperMotor]  # in the order of `stepper_axes`
    gimbal_angles: Demultiplexer  # their angles and rates


def _add_parts(
    builder: DiagramBuilder,
    scenario: Scenario,
    policy: RigPolicy,
    plant: RigPlant,
    *,
    angles: dict[str, float],
) -> _Parts:
    sensor, control, step = scenario.sensor, scenario.controller, scenario.contact.time_step
    tare = np.array([0.0, 0.0, plant.weight, 0.0, 0.0, 0.0])  # the reaction in free air
    resolution = scenario.rig.encoder_resolution
    return _Parts(
        sensor=builder.AddNamedSystem(
            "wrench_sensor", WrenchSensor(parameters=sensor, seed=scenario.seed, weld=plant.sensor, tare=tare)
        ),
        encoder=builder.AddNamedSystem("depth_encoder", DepthEncoder(home=sensor.height, resolution=resolution)),
        estimator=builder.AddNamedSystem(
            "policy_estimator", PolicyEstimator(estimator=policy.estimator(), period=control.period)
        ),
        controller=builder.AddNamedSystem(
            "policy_controller",
            PolicyController(policy=policy, limits=ControllerLimits.of(scenario, policy.period_)),
        ),
        monitor=builder.AddNamedSystem(
            "sensor_monitor", SensorMonitor(limits=sensor_limits(scenario), period=sensor.period)
        ),
        drive_monitor=builder.AddNamedSystem("drive_monitor", DriveMonitor(drive_limits(scenario))),
        self_check=builder.AddNamedSystem(
            "self_check",
            SelfCheck(check_limits(scenario, mass=plant.moving_mass, peg_weight=plant.weight), tuple(angles)),
        ),
        watchdog=builder.AddNamedSystem("watchdog", Watchdog(retract_limits(scenario), tuple(angles))),
        force_guard=builder.AddNamedSystem(
            "force_guard",
            ForceGuard(
                limits=GuardLimits.of(scenario),
                stopping=StoppingModel.of(scenario, mass=plant.moving_mass, inertia=plant.turning_inertia),
            ),
        ),
        motor=builder.AddNamedSystem("dc_motor", DcMotor(parameters=scenario.feed, period=step)),
        steppers={
            name: builder.AddNamedSystem(
                f"{name}_stepper", StepperMotor(parameters=scenario.stepper, period=step, start_angle=angle)
            )
            for name, angle in angles.items()
        },
        gimbal_angles=builder.AddNamedSystem("gimbal_angles", Demultiplexer(2 * len(angles))),
    )


def _connect_sensors(builder: DiagramBuilder, plant: RigPlant, parts: _Parts) -> None:
    builder.Connect(plant.reaction_forces, parts.sensor.GetInputPort("reaction_forces"))
    builder.Connect(plant.carriage_state, parts.encoder.GetInputPort("carriage_state"))
    builder.Connect(parts.sensor.GetOutputPort("wrench"), parts.monitor.GetInputPort("raw_wrench"))
    builder.Connect(parts.encoder.GetOutputPort("depth"), parts.monitor.GetInputPort("raw_depth"))
    for reader in (parts.estimator, parts.controller, parts.drive_monitor, parts.self_check, parts.force_guard):
        for name in ("wrench", "depth"):
            builder.Connect(parts.monitor.GetOutputPort(name), reader.GetInputPort(name))


def _connect_controller(builder: DiagramBuilder, parts: _Parts) -> None:
    builder.Connect(parts.estimator.GetOutputPort("estimate"), parts.controller.GetInputPort("estimate"))
    for name in ("target_pitch", "target_yaw"):
        for reader in (parts.estimator, parts.controller):
            builder.Connect(parts.force_guard.GetOutputPort(name), reader.GetInputPort(name))
    for name in COMMANDS:
        builder.Connect(parts.controller.GetOutputPort(name), parts.watchdog.GetInputPort(name))
    for name in (*COMMANDS, "blind"):
        builder.Connect(parts.watchdog.GetOutputPort(name), parts.force_guard.GetInputPort(name))
    builder.Connect(parts.controller.GetOutputPort("failed"), parts.watchdog.GetInputPort("controller_failed"))
    reporters: tuple[LeafSystem, ...] = (parts.monitor, parts.drive_monitor, parts.self_check)
    for reporter, port in zip(reporters, MONITORS, strict=True):
        builder.Connect(reporter.GetOutputPort("fault"), parts.watchdog.GetInputPort(port))
    for name in ("current", "travel"):
        for monitor in (parts.drive_monitor, parts.self_check):
            builder.Connect(parts.motor.GetOutputPort(name), monitor.GetInputPort(name))
    for name, stepper in parts.steppers.items():
        builder.Connect(stepper.GetOutputPort("shaft"), parts.watchdog.GetInputPort(f"{name}_shaft"))
        builder.Connect(stepper.GetOutputPort("shaft"), parts.self_check.GetInputPort(f"{name}_shaft"))


def _connect_motors(builder: DiagramBuilder, plant: RigPlant, parts: _Parts) -> None:
    builder.Connect(parts.force_guard.GetOutputPort("feed_speed"), parts.motor.GetInputPort("speed_command"))
    builder.Connect(parts.force_guard.GetOutputPort("feed_speed"), parts.drive_monitor.GetInputPort("feed_speed"))
    builder.Connect(parts.drive_monitor.GetOutputPort("feed_enabled"), parts.motor.GetInputPort("enabled"))
    builder.Connect(plant.carriage_state, parts.motor.GetInputPort("carriage_state"))
    builder.Connect(parts.motor.GetOutputPort("carriage_force"), plant.carriage_force)
    n = len(parts.steppers)
    rates = builder.AddNamedSystem("at_rest", ConstantVectorSource(np.zeros(n)))
    equilibrium = builder.AddNamedSystem("equilibrium", Multiplexer([1] * n + [n]))
    builder.Connect(plant.gimbal_state, parts.gimbal_angles.get_input_port())
    for k, (name, stepper) in enumerate(parts.steppers.items()):
        builder.Connect(parts.force_guard.GetOutputPort(f"target_{name}"), stepper.GetInputPort("target_angle"))
        builder.Connect(parts.gimbal_angles.get_output_port(k), stepper.GetInputPort("measured_angle"))
        builder.Connect(stepper.GetOutputPort("equilibrium_angle"), equilibrium.get_input_port(k))
    builder.Connect(rates.get_output_port(), equilibrium.get_input_port(n))
    builder.Connect(equilibrium.get_output_port(), plant.gimbal_equilibrium)


def _add_state_display(
    builder: DiagramBuilder,
    scenario: Scenario,
    policy: RigPolicy,
    plant: RigPlant,
    parts: _Parts,
    meshcat: Meshcat,
) -> None:
    display = builder.AddNamedSystem(
        "state_display",
        StateDisplay(
            meshcat=meshcat,
            n_states=len(policy.state_names()),
            geometry=scenario.geometry,
            home=scenario.sensor.height,
            period=FRAME,
        ),
    )
    builder.Connect(parts.estimator.GetOutputPort("state"), display.GetInputPort("state"))
    builder.Connect(plant.carriage_state, display.GetInputPort("carriage_state"))


def _add_recorder(builder: DiagramBuilder, scenario: Scenario, plant: RigPlant, parts: _Parts) -> RunRecorder:
    return AddRunRecorder(
        builder=builder,
        ports={
            ("fx", "fy", "fz", "mx", "my", "mz"): parts.monitor.GetOutputPort("wrench"),
            ("depth",): parts.monitor.GetOutputPort("depth"),
            **{(name,): parts.estimator.GetOutputPort(name) for name in READINGS},
            ("feed_speed",): parts.force_guard.GetOutputPort("feed_speed"),
            **{(f"target_{name}",): parts.force_guard.GetOutputPort(f"target_{name}") for name in parts.steppers},
            **{(name,): parts.controller.GetOutputPort(name) for name in ("back_off", "support", "turning")},
            ("fault",): parts.watchdog.GetOutputPort("fault"),
            **{
                (f"{name}_taken", f"{name}_lost"): stepper.GetOutputPort("step_counts")
                for name, stepper in parts.steppers.items()
            },
            ("carriage", "carriage_speed"): plant.carriage_state,
            **{(name,): parts.gimbal_angles.get_output_port(k) for k, name in enumerate(parts.steppers)},
        },
        period=scenario.controller.period,
        home=scenario.sensor.height,
    )


def check_geometry(scenario: Scenario, policy: RigPolicy) -> None:
    """Checks that a policy was made for the peg and hole of a scenario, if it says for which, and for its axes.

    Raises:
        ValueError: if it was made for another peg or hole, or turns about an axis that the rig does not have.
    """
    if policy.metadata_.get("clocking") and not scenario.rig.clocking_stage:
        raise ValueError(
            "the skill turns the hole about its axis, but the rig has no clocking stage; set rig.clocking_stage of the"
            " scenario to true, or train a skill without it"
        )
    trained = PegHoleGeometry.find(policy.metadata_, "the skill")
    if trained is None:
        return  # foreign demonstrations need not state their geometry
    difference = fit_difference(asdict(trained), asdict(scenario.geometry))
    if difference:
        raise ValueError(
            f"the skill was trained for {difference} as in the scenario; train a skill with demonstrations of this"
            " geometry"
        )
