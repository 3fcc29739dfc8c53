"""The diagram of the servo: operator, device and coupling at 1 kHz, against the local model of the contact."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem

from models.hardware import DEVICE_PRESETS
from models.scenario import Scenario
from systems.haptics.haptic_device import HapticDevice
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.passivity_observer import PassivityObserver
from systems.haptics.virtual_fixture import fixture_of
from systems.servo.local_contact import LocalContact, Springs
from systems.servo.local_peg import LocalPeg
from systems.servo.multirate_margins import require_multirate_margins
from systems.servo.probe import Probe
from systems.servo.stale_contact_fade import StaleContactFade
from systems.virtual_environment import connect_device

PEG = BodyIndex(1)
"""Stands for the peg in the proxy's forces; the servo has no plant."""


class Servo:
    """A built diagram of the servo, and its simulation.

    Args:
        diagram: with the systems ``operator``, ``haptic_device``, ``haptic_proxy``, ``local_peg``, ``fade`` and
            ``passivity_observer``.
        period: of a tick, s.
    """

    def __init__(self, diagram: Diagram, period: float) -> None:
        self.diagram, self.period = diagram, period
        self._device: HapticDevice = diagram.GetSubsystemByName("haptic_device")
        self._observer, self._fade = (diagram.GetSubsystemByName(name) for name in ("passivity_observer", "fade"))
        self._simulator = Simulator(diagram)
        self._context = self._simulator.get_mutable_context()
        self._ticks = 0
        self._model_time = 0.0

    @property
    def time(self) -> float:
        """Time at the end of the last tick, s."""
        return self._ticks * self.period

    def start(self, X_HP_start: RigidTransform) -> None:
        """Starts with a free peg at rest."""
        self.set_contact(LocalContact(0.0, X_HP_start, np.zeros(6), Springs.none()))
        self.set_closed(True)
        self._simulator.Initialize()

    def set_contact(self, contact: LocalContact) -> None:
        """Replaces the local model of the contact from the next tick on."""
        self._model_time = contact.time
        self.diagram.GetInputPort("contact").FixValue(self._context, Value(contact))

    def set_closed(self, closed: bool) -> None:
        """Says whether the force may act from the next tick on; after False it returns slowly."""
        self.diagram.GetInputPort("closed").FixValue(self._context, [float(closed)])

    def tick(self) -> None:
        """Simulates one tick.

        Raises:
            OSError: from the device.
        """
        self._ticks += 1
        self._simulator.AdvanceTo(self.time)

    def probe(self) -> Probe:
        """Returns what the simulation must know now."""
        device = self._device.GetMyContextFromRoot(self._context)
        energy = self._observer.GetOutputPort("energy").Eval(self._observer.GetMyContextFromRoot(self._context))
        gain = self._fade.GetOutputPort("gain").Eval(self._fade.GetMyContextFromRoot(self._context))
        return Probe(
            time=self.time,
            X_HD=self._device.GetOutputPort("probe_pose").Eval(device),
            V_HD=self._device.GetOutputPort("probe_velocity").Eval(device),
            wrench=self._device.GetOutputPort("rendered_wrench").Eval(device),
            load=self._device.load(device),
            energy=float(energy[0]),
            min_energy=float(energy[1]),
            gain=float(gain[0]),
            age=self.time - self._model_time,
        )


def MakeServo(scenario: Scenario, *, operator: LeafSystem, X_HP_start: RigidTransform) -> Servo:
    """Builds the servo of a resolved scenario.

    Args:
        scenario: resolved.
        operator: system with an output ``hand_pose`` and an optional input ``rendered_wrench``.
        X_HP_start: pose of the peg, and of the probe, at the start.

    Raises:
        ValueError: if the coupling of the scenario is not stable (see `multirate_margins`).
    """
    require_multirate_margins(scenario)
    parameters = DEVICE_PRESETS[scenario.device]
    period = parameters.servo_period
    builder = DiagramBuilder()
    builder.AddNamedSystem("operator", operator)
    device = builder.AddNamedSystem("haptic_device", HapticDevice(parameters=parameters, X_HD_start=X_HP_start))
    proxy = builder.AddNamedSystem(
        "haptic_proxy", HapticProxy(coupling=scenario.coupling, fixture=fixture_of(scenario), peg=PEG)
    )
    peg = builder.AddNamedSystem("local_peg", LocalPeg(scenario=scenario, period=period, X_HP_start=X_HP_start))
    fade = builder.AddNamedSystem("fade", StaleContactFade(period=period))
    observer = builder.AddNamedSystem("passivity_observer", PassivityObserver(period=period, X_HD_start=X_HP_start))

    connect_device(builder, operator=operator, device=device, proxy=proxy, observer=observer)
    builder.Connect(peg.GetOutputPort("peg_state"), proxy.GetInputPort("peg_state"))
    builder.Connect(proxy.GetOutputPort("peg_forces"), peg.GetInputPort("peg_forces"))
    builder.Connect(proxy.GetOutputPort("probe_wrench"), fade.GetInputPort("virtual_wrench"))
    builder.Connect(fade.GetOutputPort("faded_wrench"), device.GetInputPort("virtual_wrench"))
    builder.ExportInput(peg.GetInputPort("contact"), "contact")
    builder.ConnectInput("contact", fade.GetInputPort("contact"))
    builder.ExportInput(fade.GetInputPort("closed"), "closed")
    diagram = builder.Build()
    diagram.set_name("servo")
    return Servo(diagram, period)
