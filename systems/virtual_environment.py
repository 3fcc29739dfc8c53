"""The virtual environment: operator, haptic device, virtual coupling, peg and hole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import VectorLogSink

from models.hardware import DEVICE_PRESETS
from models.scenario import Scenario
from systems.haptics.coupling_margins import require_margins
from systems.haptics.haptic_device import HapticDevice
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.passivity_observer import PassivityObserver
from systems.haptics.virtual_fixture import MakeFixture, VirtualFixture
from systems.math.rotation import from_rotation_vector
from systems.operators.simulated_operator import SimulatedOperator
from systems.plant.body_pose import BodyPose
from systems.plant.contact_plant import AddVirtualPlant, ContactPlant
from systems.recording.demonstration_recorder import DemonstrationRecorder
from systems.visualization.scene import AddVisualization


@dataclass(frozen=True)
class VirtualEnvironment:
    """A built diagram and the parts that a run reads."""

    diagram: Diagram
    contact: ContactPlant
    log: VectorLogSink
    energy_log: VectorLogSink
    device: HapticDevice
    observer: PassivityObserver
    X_HP_start: RigidTransform

    def set_start(self, context: Context) -> None:
        """Puts the peg at the scenario's start; ``context`` is the diagram's."""
        plant = self.contact.plant
        plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(context), self.contact.peg, self.X_HP_start)

    def peg_pose(self, context: Context) -> RigidTransform:
        """X_HP in the diagram's ``context``."""
        plant = self.contact.plant
        return self.contact.peg.EvalPoseInWorld(plant.GetMyContextFromRoot(context))

    def energy(self, context: Context) -> NDArray[np.float64]:
        """[energy that the hand has put in, the lowest so far] in J, in the diagram's ``context``."""
        return np.asarray(self.observer.GetOutputPort("energy").Eval(self.observer.GetMyContextFromRoot(context)))

    def touch(self, context: Context) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """The middle of the contact (m) and the contact force on the peg (N), both in W; None out of contact."""
        plant = self.contact.plant
        own = plant.GetMyContextFromRoot(context)
        results = plant.get_contact_results_output_port().Eval(own)
        if results.num_hydroelastic_contacts() == 0:
            return None
        middle = results.hydroelastic_contact_info(0).contact_surface().centroid()
        wrench = plant.get_generalized_contact_forces_output_port(self.contact.peg.model_instance()).Eval(own)
        return np.asarray(middle), np.asarray(wrench[3:])

    def felt(self, context: Context) -> tuple[NDArray[np.float64], float]:
        """The rendered wrench [torque; force], and what was asked for over the most that the device gives now."""
        own = self.device.GetMyContextFromRoot(context)
        return np.asarray(self.device.GetOutputPort("rendered_wrench").Eval(own)), self.device.load(own)


def start_pose(scenario: Scenario) -> RigidTransform:
    """X_HP of a resolved scenario's start: the tilted axis passes the pivot at the scenario's offset.

    The pivot of the free peg is the centre of the mouth.
    """
    tilt, offset = scenario.start.tilt, scenario.start.offset
    if tilt is None or offset is None:
        raise ValueError("scenario.start is not resolved: tilt or offset is missing; use resolve_scenario first")
    R_HP = from_rotation_vector(np.array([*tilt, 0.0]))
    pivot = scenario.rig.pivot_height or 0.0 if scenario.fixture == "rig" else 0.0
    reach = scenario.start.height - pivot  # from the pivot along the axis to the tip
    return RigidTransform(R_HP, np.array([*offset, pivot]) + reach * R_HP.col(2))


def show_start(scenario: Scenario, *, meshcat: Meshcat) -> None:
    """Draws a resolved scenario's peg and hole into ``meshcat`` as they stand at the start."""
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, scenario)
    AddVisualization(builder=builder, contact=contact, meshcat=meshcat, contact_forces=False)
    simulator = Simulator(builder.Build())
    plant_context = contact.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    contact.plant.SetFreeBodyPose(plant_context, contact.peg, start_pose(scenario))
    simulator.Initialize()  # takes away what was drawn before, and draws


def MakeVirtualEnvironment(
    scenario: Scenario,
    *,
    fixture: VirtualFixture | None = None,
    operator: LeafSystem | None = None,
    meshcat: Meshcat | None = None,
    contact_forces: bool = True,
) -> VirtualEnvironment:
    """Builds the diagram of a resolved scenario; it simulates nothing.

    Args:
        scenario: resolved (see `resolve_scenario`).
        fixture: a user's own; by default the one that the scenario names.
        operator: whoever moves the probe, with an output ``hand_pose`` and, if wanted, inputs ``peg_pose`` and
            ``rendered_wrench``; by default the simulated operator.
        meshcat: where to draw; None draws nothing.
        contact_forces: whether Drake's visualizer of them draws too.

    Raises:
        ValueError: if the scenario is not resolved, or its coupling is not stable (see `coupling_margins`).
    """
    require_margins(scenario)
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, scenario)
    plant, peg = contact.plant, contact.peg
    X_HP_start = start_pose(scenario)
    start = scenario.start
    if operator is None:
        operator = SimulatedOperator(
            operator=scenario.operator,
            seed=scenario.seed,
            start_height=start.height,
            tilt=start.tilt or [0.0, 0.0],
            offset=start.offset or [0.0, 0.0],
        )
    builder.AddNamedSystem("operator", operator)
    parameters = DEVICE_PRESETS[scenario.device]
    device = builder.AddNamedSystem("haptic_device", HapticDevice(parameters=parameters, X_HD_start=X_HP_start))
    proxy = builder.AddNamedSystem(
        "haptic_proxy",
        HapticProxy(
            coupling=scenario.coupling,
            fixture=fixture
            if fixture is not None
            else MakeFixture(scenario.fixture, pivot_height=scenario.rig.pivot_height or 0.0),
            peg=peg.index(),
        ),
    )
    recorder, log = DemonstrationRecorder.AddToBuilder(
        builder=builder, period=scenario.recorder.period, X_HP_start=X_HP_start
    )
    observer, energy_log = PassivityObserver.AddToBuilder(
        builder=builder,
        period=parameters.servo_period,
        log_period=scenario.recorder.period,
        X_HD_start=X_HP_start,
    )
    sight = builder.AddNamedSystem("sight", BodyPose(peg.index()))
    peg_state = plant.get_state_output_port(peg.model_instance())
    contact_wrench = plant.get_generalized_contact_forces_output_port(peg.model_instance())

    builder.Connect(plant.get_body_poses_output_port(), sight.GetInputPort("body_poses"))
    for perceived, name in (
        (sight.GetOutputPort("pose"), "peg_pose"),
        (device.GetOutputPort("rendered_wrench"), "rendered_wrench"),
    ):
        if operator.HasInputPort(name):
            builder.Connect(perceived, operator.GetInputPort(name))
    builder.Connect(operator.GetOutputPort("hand_pose"), device.GetInputPort("hand_pose"))
    builder.Connect(proxy.GetOutputPort("probe_wrench"), device.GetInputPort("virtual_wrench"))
    builder.Connect(device.GetOutputPort("probe_pose"), proxy.GetInputPort("probe_pose"))
    builder.Connect(device.GetOutputPort("probe_velocity"), proxy.GetInputPort("probe_velocity"))
    builder.Connect(peg_state, proxy.GetInputPort("peg_state"))
    builder.Connect(proxy.GetOutputPort("peg_forces"), plant.get_applied_spatial_force_input_port())
    builder.Connect(peg_state, recorder.GetInputPort("peg_state"))
    builder.Connect(contact_wrench, recorder.GetInputPort("contact_wrench"))
    builder.Connect(device.GetOutputPort("probe_pose"), recorder.GetInputPort("probe_pose"))
    builder.Connect(device.GetOutputPort("probe_pose"), observer.GetInputPort("probe_pose"))
    builder.Connect(device.GetOutputPort("rendered_wrench"), observer.GetInputPort("rendered_wrench"))
    if meshcat is not None:
        AddVisualization(builder=builder, contact=contact, meshcat=meshcat, contact_forces=contact_forces)
    diagram = builder.Build()
    diagram.set_name("virtual_environment")
    return VirtualEnvironment(diagram, contact, log, energy_log, device, observer, X_HP_start)
