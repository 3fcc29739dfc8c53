"""The virtual environment: a diagram of operator, haptic device, virtual coupling, peg and hole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput, VectorLogSink

from models.hardware import DEVICE_PRESETS
from models.scenario import RIG_FIXTURE, Scenario
from skill.arrays import Array
from skill.data.demonstration import COLUMNS
from systems.haptics.coupling_margins import require_margins
from systems.haptics.haptic_device import HapticDevice
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.passivity_observer import PassivityObserver
from systems.haptics.virtual_fixture import fixture_of
from systems.math.rotation import from_rotation_vector
from systems.operators.simulated_operator import SimulatedOperator
from systems.plant.exact_peg import AddPegPlant, PegPlant
from systems.recording.demonstration_recorder import DemonstrationRecorder


@dataclass(frozen=True)
class PegEnvironment:
    """A built diagram in which a probe pulls the peg, and the parts that a run reads.

    The ``context`` of all methods is a context of the diagram.

    Attributes:
        diagram: the whole diagram.
        plant: of peg and hole.
        log: log of the recorded channels.
        X_HP_start: pose of the peg at the start.
    """

    diagram: Diagram
    plant: PegPlant
    log: VectorLogSink
    X_HP_start: RigidTransform

    def set_start(self, context: Context) -> None:
        """Moves the peg to the start of the scenario."""
        self.plant.set_start(context, self.X_HP_start)

    def min_energy(self, context: Context) -> float:
        """Returns the minimum, so far, of the energy that the hand has put in, J."""
        raise NotImplementedError

    def last_sample(self, context: Context) -> dict[str, float]:
        """Returns the newest row of the recording by its columns (`COLUMNS`).

        Raises:
            ValueError: if nothing has been recorded.
        """
        log = self.log.FindLog(context)
        if not log.num_samples():
            raise ValueError("nothing has been recorded yet")
        return dict(zip(COLUMNS, [log.sample_times()[-1], *log.data()[:, -1]], strict=True))


@dataclass(frozen=True)
class VirtualEnvironment(PegEnvironment):
    """The environment with operator and device in one diagram.

    Attributes:
        energy_log: log of [total, minimum] of the `PassivityObserver`.
        device: the haptic device.
    """

    energy_log: VectorLogSink
    device: HapticDevice

    def min_energy(self, context: Context) -> float:
        """See `PegEnvironment`."""
        return float(self.energy_log.FindLog(context).data()[1].min())

    def rendered_wrench(self, context: Context) -> Array:
        """Returns what the device renders: (6,), [torque; force] on the hand in H, N m and N."""
        device_context = self.device.GetMyContextFromRoot(context)
        return np.array(self.device.GetOutputPort("rendered_wrench").Eval(device_context))


def start_pose(scenario: Scenario) -> RigidTransform:
    """Returns X_HP at the start of a resolved scenario.

    The axis of the peg has the scenario's tilt and passes the pivot at the scenario's offset; the peg is turned about
    its axis by the scenario's clocking. The pivot of a free peg is the centre of the mouth.

    Raises:
        ValueError: if the scenario is not resolved.
    """
    tilt, offset = scenario.start.tilt, scenario.start.offset
    if tilt is None or offset is None:
        raise ValueError("scenario.start is not resolved: tilt or offset is missing; use resolve_scenario first")
    R_HP = from_rotation_vector(np.array([*tilt, 0.0])) @ RotationMatrix.MakeZRotation(scenario.start.clocking or 0.0)
    pivot = 0.0
    if scenario.fixture == RIG_FIXTURE and scenario.rig.pivot_height is not None:
        pivot = scenario.rig.pivot_height
    distance = scenario.start.tip_height - pivot  # from the pivot along the axis to the tip, m
    return RigidTransform(R_HP, np.array([*offset, pivot]) + distance * R_HP.col(2))


def MakeVirtualEnvironment(scenario: Scenario, *, operator: LeafSystem | None = None) -> VirtualEnvironment:
    """Builds the diagram of a resolved scenario; simulates nothing.

    Args:
        scenario: resolved (see `resolve_scenario`).
        operator: system with an output ``hand_pose``, the pose to which it moves the probe, and optional inputs
            ``peg_pose`` and ``rendered_wrench``; None makes the simulated operator.

    Raises:
        ValueError: if the scenario is not resolved, or its coupling is not stable (see `coupling_margins`).
    """
    require_margins(scenario)
    builder = DiagramBuilder()
    plant = AddPegPlant(builder, scenario)
    X_HP_start = start_pose(scenario)
    if operator is None:
        operator = _make_operator(scenario)
    parameters = DEVICE_PRESETS[scenario.device]
    builder.AddNamedSystem("operator", operator)
    device = builder.AddNamedSystem("haptic_device", HapticDevice(parameters=parameters, X_HD_start=X_HP_start))
    proxy, recorder, log = add_coupling(builder, scenario, plant)
    observer = builder.AddNamedSystem(
        "passivity_observer", PassivityObserver(period=parameters.servo_period, X_HD_start=X_HP_start)
    )
    energy_log = LogVectorOutput(observer.GetOutputPort("energy"), builder, scenario.recorder.period)
    energy_log.set_name("energy_log")
    if operator.HasInputPort("peg_pose"):
        builder.Connect(plant.pose, operator.GetInputPort("peg_pose"))
    connect_device(builder, operator=operator, device=device, proxy=proxy, observer=observer)
    builder.Connect(proxy.GetOutputPort("probe_wrench"), device.GetInputPort("virtual_wrench"))
    builder.Connect(device.GetOutputPort("probe_pose"), recorder.GetInputPort("probe_pose"))
    diagram = builder.Build()
    diagram.set_name("virtual_environment")
    return VirtualEnvironment(diagram, plant, log, X_HP_start, energy_log, device)


def add_coupling(
    builder: DiagramBuilder, scenario: Scenario, plant: PegPlant
) -> tuple[HapticProxy, DemonstrationRecorder, VectorLogSink]:
    """Adds the coupling of the peg to a probe, and the recorder with its log, and connects them to the plant.

    Their ports of the probe remain to be connected.
    """
    proxy = builder.AddNamedSystem(
        "haptic_proxy", HapticProxy(coupling=scenario.coupling, fixture=fixture_of(scenario), peg=plant.index)
    )
    period = scenario.recorder.period
    recorder = builder.AddNamedSystem(
        "demonstration_recorder", DemonstrationRecorder(period=period, X_HP_start=start_pose(scenario))
    )
    log = LogVectorOutput(recorder.GetOutputPort("sample"), builder, period)
    log.set_name("demonstration_log")
    builder.Connect(plant.peg_state, proxy.GetInputPort("peg_state"))
    builder.Connect(proxy.GetOutputPort("peg_forces"), plant.peg_forces)
    builder.Connect(plant.peg_state, recorder.GetInputPort("peg_state"))
    builder.Connect(plant.contact_wrench, recorder.GetInputPort("contact_wrench"))
    return proxy, recorder, log


def _make_operator(scenario: Scenario) -> SimulatedOperator:
    start = scenario.start
    return SimulatedOperator(
        operator=scenario.operator,
        seed=scenario.seed,
        start_height=start.tip_height,
        tilt=start.tilt or [0.0, 0.0],
        offset=start.offset or [0.0, 0.0],
        clocking=start.clocking if scenario.rig.clocking_stage else None,
    )


def connect_device(
    builder: DiagramBuilder,
    *,
    operator: LeafSystem,
    device: HapticDevice,
    proxy: HapticProxy,
    observer: PassivityObserver,
) -> None:
    """Connects the hand of an operator to a device, and its probe to what pulls the peg and to what observes it."""
    probe_pose, rendered = device.GetOutputPort("probe_pose"), device.GetOutputPort("rendered_wrench")
    if operator.HasInputPort("rendered_wrench"):
        builder.Connect(rendered, operator.GetInputPort("rendered_wrench"))
    builder.Connect(operator.GetOutputPort("hand_pose"), device.GetInputPort("hand_pose"))
    builder.Connect(probe_pose, proxy.GetInputPort("probe_pose"))
    builder.Connect(device.GetOutputPort("probe_velocity"), proxy.GetInputPort("probe_velocity"))
    builder.Connect(probe_pose, observer.GetInputPort("probe_pose"))
    builder.Connect(rendered, observer.GetInputPort("rendered_wrench"))
