"""The 3-DOF rig: a peg on a DC feed drive, a hole on two steppers, and a controller that feels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Multiplexer

from models.scenario import Scenario
from systems.control.contact_state_estimator import ContactStateEstimator
from systems.control.faults import Fault
from systems.control.policy import RigPolicy
from systems.control.policy_controller import PolicyController
from systems.control.sensor_monitor import SensorMonitor
from systems.control.watchdog import COMMANDS, Watchdog
from systems.hardware.dc_motor import DcMotor
from systems.hardware.depth_encoder import DepthEncoder
from systems.hardware.stepper_motor import StepperMotor
from systems.hardware.wrench_sensor import WrenchSensor, wrench_at_tip
from systems.plant.contact_plant import AddRigPlant
from systems.plant.rig_plant import RigPlant
from systems.recording.run_recorder import RunRecorder
from systems.visualization.scene import CAMERA, FRAME, TARGET, AddVisualization
from systems.visualization.state_display import StateDisplay, plate_pose


@dataclass(frozen=True)
class RigDiagram:
    """A built diagram and the parts that a run reads.

    Attributes:
        diagram: what a Simulator runs.
        contact: the plant and its bodies.
        recorder: of what the rig measures, commands and does.
        controller: the skill's.
        watchdog: between controller and motors.
        start: of the carriage, m, and of pitch and yaw, rad.
        tare: (6,), what the sensor's weld holds in free air: force (N), then moment (N m), in P.
        sensor_height: of that weld above the tip, m.
    """

    diagram: Diagram
    contact: RigPlant
    recorder: RunRecorder
    controller: PolicyController
    watchdog: Watchdog
    start: tuple[float, float, float]
    tare: NDArray[np.float64]
    sensor_height: float

    def set_start(self, context: Context) -> None:
        """Puts carriage and gimbal at the scenario's start; ``context`` is the diagram's."""
        carriage, pitch, yaw = self.start
        self.contact.set_start(context, carriage=carriage, pitch=pitch, yaw=yaw)

    def contact_wrench(self, context: Context) -> NDArray[np.float64]:
        """The true wrench (6,) on the peg about its tip, in P: force (N), then moment (N m); for measuring a run.

        The inertia of the peg is in it too; at the rig's speeds that is a small part of a newton.
        """
        port = self.contact.reaction_forces
        reaction = port.Eval(port.get_system().GetMyContextFromRoot(context))[self.contact.sensor]
        held = np.concatenate([reaction.translational(), reaction.rotational()])
        return wrench_at_tip(self.tare - held, self.sensor_height)

    def fault(self, context: Context) -> Fault:
        """The fault that the rig has noticed; ``context`` is the diagram's."""
        own = self.watchdog.GetMyContextFromRoot(context)
        return Fault(int(self.watchdog.GetOutputPort("fault").Eval(own)[0]))

    def failure(self, context: Context) -> str:
        """Why the policy failed, "" if it did not; ``context`` is the diagram's."""
        return self.controller.failure(self.controller.GetMyContextFromRoot(context))

    def stopped(self, context: Context) -> bool:
        """Whether the watchdog has drawn the peg back after a fault and stands still."""
        return bool(self.watchdog.GetOutputPort("stopped").Eval(self.watchdog.GetMyContextFromRoot(context))[0])


def MakeRig(scenario: Scenario, skill: RigPolicy, *, meshcat: Meshcat | None = None) -> RigDiagram:
    """Builds the diagram of a resolved scenario; it simulates nothing.

    Args:
        scenario: resolved; its start's tilt is that of the peg relative to the hole.
        skill: fitted or loaded; or a control law of one's own (see `systems.control.policy`).
        meshcat: where to draw; None draws nothing.

    Raises:
        ValueError: if the scenario is not resolved, or the skill was trained for another peg or hole.
    """
    builder = DiagramBuilder()
    contact = AddRigPlant(builder, scenario)
    if meshcat is not None:
        AddVisualization(builder=builder, contact=contact, meshcat=meshcat)
    return WireRig(builder, scenario, skill, contact, meshcat=meshcat)


def WireRig(
    builder: DiagramBuilder,
    scenario: Scenario,
    skill: RigPolicy,
    contact: RigPlant,
    *,
    meshcat: Meshcat | None = None,
) -> RigDiagram:
    """Adds sensor, motors, controller and a display of the state to a plant and builds the diagram; see `MakeRig`."""
    if scenario.start.tilt is None:
        raise ValueError("scenario.start.tilt is missing: the scenario is not resolved; use resolve_scenario first")
    _check_geometry(scenario, skill)
    period = scenario.contact.time_step
    # The peg tilted by theta relative to the hole is the hole turned by -theta.
    pitch, yaw = -scenario.start.tilt[0], -scenario.start.tilt[1]
    tare = np.array([0.0, 0.0, contact.weight, 0.0, 0.0, 0.0])
    sensor = builder.AddNamedSystem(
        "wrench_sensor",
        WrenchSensor(parameters=scenario.sensor, seed=scenario.seed, weld=contact.sensor, tare=tare),
    )
    encoder = builder.AddNamedSystem(
        "depth_encoder", DepthEncoder(home=scenario.sensor.height, resolution=scenario.rig.encoder_resolution)
    )
    estimator = builder.AddNamedSystem(
        "contact_state_estimator",
        ContactStateEstimator(skill=skill, period=scenario.controller.period),
    )
    controller = builder.AddNamedSystem(
        "policy_controller",
        PolicyController(skill=skill, parameters=scenario.controller, peg_radius=scenario.geometry.peg_radius),
    )
    check = builder.AddNamedSystem(
        "sensor_monitor",
        SensorMonitor(
            sensor=scenario.sensor, top_speed=scenario.feed.no_load_speed, resolution=scenario.rig.encoder_resolution
        ),
    )
    watchdog = builder.AddNamedSystem("watchdog", Watchdog(parameters=scenario.controller, motor=scenario.feed))
    motor = builder.AddNamedSystem("dc_motor", DcMotor(parameters=scenario.feed, period=period))
    steppers = {
        name: builder.AddNamedSystem(
            f"{name}_stepper", StepperMotor(parameters=scenario.stepper, period=period, start_angle=angle)
        )
        for name, angle in (("pitch", pitch), ("yaw", yaw))
    }
    carriage_state = contact.carriage_state
    gimbal_state = builder.AddNamedSystem("gimbal_angles", Demultiplexer(4))
    rest = builder.AddNamedSystem("at_rest", ConstantVectorSource(np.zeros(2)))
    equilibrium = builder.AddNamedSystem("equilibrium", Multiplexer([1, 1, 2]))

    wrench = check.GetOutputPort("wrench")
    depth = check.GetOutputPort("depth")
    builder.Connect(contact.reaction_forces, sensor.GetInputPort("reaction_forces"))
    builder.Connect(carriage_state, encoder.GetInputPort("carriage_state"))
    builder.Connect(sensor.GetOutputPort("wrench"), check.GetInputPort("raw_wrench"))
    builder.Connect(encoder.GetOutputPort("depth"), check.GetInputPort("raw_depth"))
    for system in (estimator, controller, watchdog):
        builder.Connect(wrench, system.GetInputPort("wrench"))
        builder.Connect(depth, system.GetInputPort("depth"))
    builder.Connect(estimator.GetOutputPort("probabilities"), controller.GetInputPort("probabilities"))
    builder.Connect(estimator.GetOutputPort("known"), controller.GetInputPort("known"))
    for name in COMMANDS:
        builder.Connect(controller.GetOutputPort(name), watchdog.GetInputPort(name))
    builder.Connect(controller.GetOutputPort("failed"), watchdog.GetInputPort("controller_failed"))
    builder.Connect(check.GetOutputPort("fault"), watchdog.GetInputPort("measurement_fault"))
    builder.Connect(motor.GetOutputPort("current"), watchdog.GetInputPort("current"))
    builder.Connect(watchdog.GetOutputPort("feed_speed"), motor.GetInputPort("speed_command"))
    builder.Connect(carriage_state, motor.GetInputPort("carriage_state"))
    builder.Connect(motor.GetOutputPort("carriage_force"), contact.carriage_force)
    builder.Connect(contact.gimbal_state, gimbal_state.get_input_port())
    for k, (name, stepper) in enumerate(steppers.items()):
        builder.Connect(watchdog.GetOutputPort(f"target_{name}"), stepper.GetInputPort("target_angle"))
        builder.Connect(stepper.GetOutputPort("step_counts"), watchdog.GetInputPort(f"{name}_counts"))
        builder.Connect(gimbal_state.get_output_port(k), stepper.GetInputPort("measured_angle"))
        builder.Connect(stepper.GetOutputPort("equilibrium_angle"), equilibrium.get_input_port(k))
    builder.Connect(rest.get_output_port(), equilibrium.get_input_port(2))
    builder.Connect(equilibrium.get_output_port(), contact.gimbal_equilibrium)
    if meshcat is not None:
        display = builder.AddNamedSystem(
            "state_display",
            StateDisplay(
                meshcat=meshcat,
                names=skill.state_names(),
                geometry=scenario.geometry,
                home=scenario.sensor.height,
                period=FRAME,
                X_WL=plate_pose(CAMERA, TARGET),
            ),
        )
        builder.Connect(estimator.GetOutputPort("state"), display.GetInputPort("state"))
        builder.Connect(carriage_state, display.GetInputPort("carriage_state"))
    recorder = RunRecorder.AddToBuilder(
        builder=builder,
        ports={
            ("fx", "fy", "fz", "mx", "my", "mz"): wrench,
            ("depth",): depth,
            ("state",): estimator.GetOutputPort("state"),
            ("known",): estimator.GetOutputPort("known"),
            **{(n,): watchdog.GetOutputPort(n) for n in COMMANDS},
            **{(n,): controller.GetOutputPort(n) for n in ("guard", "support")},
            ("fault",): watchdog.GetOutputPort("fault"),
            **{(f"{n}_taken", f"{n}_lost"): s.GetOutputPort("step_counts") for n, s in steppers.items()},
            ("carriage", "carriage_speed"): carriage_state,
            ("pitch",): gimbal_state.get_output_port(0),
            ("yaw",): gimbal_state.get_output_port(1),
        },
        period=scenario.controller.period,
        home=scenario.sensor.height,
    )
    diagram = builder.Build()
    diagram.set_name("rig")
    return RigDiagram(
        diagram,
        contact,
        recorder,
        controller,
        watchdog,
        start=(scenario.sensor.height + scenario.start.height, pitch, yaw),
        tare=tare,
        sensor_height=scenario.sensor.height,
    )


def _check_geometry(scenario: Scenario, skill: RigPolicy) -> None:
    trained = skill.metadata_.get("geometry")
    if trained is None:
        return  # demonstrations from elsewhere need not say
    for name in ("peg_radius", "hole_radius", "hole_depth", "chamfer"):
        found, wanted = trained.get(name), getattr(scenario.geometry, name)
        if found != wanted:
            raise ValueError(
                f"the skill was trained for geometry.{name} = {found} m, the scenario has {wanted} m;"
                " train a skill with demonstrations of this geometry"
            )
