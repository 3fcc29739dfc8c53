"""The law of control: what stands between a sensor and the motors, whatever carries the peg.

Functions with a builder are named as Drake's are: ``MakeX`` builds a diagram, ``AddX`` adds systems to it, and
``ConnectX`` only connects them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from models.control import wrench_factor
from models.scenario import Scenario
from skill.data.geometry import PegHoleGeometry, fit_difference
from skill.policy.rig_policy import RigPolicy
from skill.replaced_wrench import ReplacedWrench
from systems.law.drive_monitor import DriveMonitor
from systems.law.estimator import READINGS, PolicyEstimator
from systems.law.faults import Fault
from systems.law.force_guard import ForceGuard, GuardLimits, StoppingModel
from systems.law.policy_controller import ControllerLimits, PolicyController
from systems.law.sensor_monitor import SensorLimits, SensorMonitor
from systems.law.watchdog import COMMANDS, RetractLimits, Watchdog
from systems.law.wrench_sensor import WrenchSensor


@dataclass(frozen=True)
class Law:
    """The systems of a law, from the monitor of the sensor to the force guard."""

    monitor: SensorMonitor
    estimator: PolicyEstimator
    controller: PolicyController
    watchdog: Watchdog
    force_guard: ForceGuard

    def recorded(self, axes: Sequence[str]) -> dict[tuple[str, ...], OutputPort]:
        """Returns the ports that a run records, by the names of their elements."""
        return {
            ("fx", "fy", "fz", "mx", "my", "mz"): self.monitor.GetOutputPort("wrench"),
            ("depth",): self.monitor.GetOutputPort("depth"),
            **{(name,): self.estimator.GetOutputPort(name) for name in READINGS},
            ("feed_speed",): self.force_guard.GetOutputPort("feed_speed"),
            **{(f"target_{name}",): self.force_guard.GetOutputPort(f"target_{name}") for name in axes},
            **{(name,): self.controller.GetOutputPort(name) for name in ("back_off", "support", "turning")},
            ("fault",): self.watchdog.GetOutputPort("fault"),
        }

    # Every ``context`` is that of the diagram.

    def peak_load(self, context: Context) -> float:
        """Returns the largest load (N) that the sensor has measured."""
        return self.force_guard.peak_load(self.force_guard.GetMyContextFromRoot(context))

    def fault(self, context: Context) -> Fault:
        """Returns the fault that has been detected."""
        own = self.watchdog.GetMyContextFromRoot(context)
        return Fault(int(self.watchdog.GetOutputPort("fault").Eval(own)[0]))

    def failure(self, context: Context) -> str:
        """Returns why the policy failed, or "" if it has not."""
        return self.controller.failure(self.controller.GetMyContextFromRoot(context))

    def tried(self, context: Context) -> str:
        """Returns what the policy has tried if it has nothing new to try, else ""."""
        return self.controller.tried(self.controller.GetMyContextFromRoot(context))

    def stopped(self, context: Context) -> bool:
        """Returns whether the watchdog has retracted the peg after a fault and stopped."""
        return bool(self.watchdog.GetOutputPort("stopped").Eval(self.watchdog.GetMyContextFromRoot(context))[0])


def AddLaw(
    builder: DiagramBuilder,
    scenario: Scenario,
    policy: RigPolicy,
    *,
    stopping: StoppingModel,
    steppers: Sequence[str],
) -> Law:
    """Adds the systems of a law and connects them with each other.

    Args:
        builder: of the diagram.
        scenario: resolved.
        policy: that acts.
        stopping: how what carries the peg stops.
        steppers: names of the axes that have steppers.
    """
    sensor, control = scenario.sensor, scenario.controller
    if control.wrench != "true":
        policy = ReplacedWrench(policy, control.wrench, wrench_factor(control.wrench), scenario.geometry.reach)
    law = Law(
        monitor=builder.AddNamedSystem(
            "sensor_monitor", SensorMonitor(limits=SensorLimits.of(scenario), period=sensor.period)
        ),
        estimator=builder.AddNamedSystem(
            "policy_estimator", PolicyEstimator(estimator=policy.estimator(), period=control.period)
        ),
        controller=builder.AddNamedSystem(
            "policy_controller",
            PolicyController(policy=policy, limits=ControllerLimits.of(scenario, policy.period_)),
        ),
        watchdog=builder.AddNamedSystem("watchdog", Watchdog(RetractLimits.of(scenario), steppers)),
        force_guard=builder.AddNamedSystem(
            "force_guard", ForceGuard(limits=GuardLimits.of(scenario), stopping=stopping)
        ),
    )
    for reader in (law.estimator, law.controller, law.force_guard):
        ConnectMeasurement(builder, law, reader)
    builder.Connect(law.estimator.GetOutputPort("estimate"), law.controller.GetInputPort("estimate"))
    for name in ("target_pitch", "target_yaw"):
        builder.Connect(law.force_guard.GetOutputPort(name), law.controller.GetInputPort(name))
    for name in COMMANDS:
        builder.Connect(law.controller.GetOutputPort(name), law.watchdog.GetInputPort(name))
    for name in (*COMMANDS, "blind"):
        builder.Connect(law.watchdog.GetOutputPort(name), law.force_guard.GetInputPort(name))
    builder.Connect(law.controller.GetOutputPort("failed"), law.watchdog.GetInputPort("controller_failed"))
    return law


def AddSensor(
    builder: DiagramBuilder, scenario: Scenario, reaction_forces: OutputPort, *, weld: int, weight: float
) -> WrenchSensor:
    """Adds the sensor between what carries the peg and the peg.

    Args:
        builder: of the diagram.
        scenario: resolved.
        reaction_forces: with that of the sensor.
        weld: index of the sensor in the reaction forces.
        weight: of what hangs on the sensor, which it does not report, N.
    """
    tare = np.array([0.0, 0.0, weight, 0.0, 0.0, 0.0])  # the reaction in free air
    sensor: WrenchSensor = builder.AddNamedSystem(
        "wrench_sensor", WrenchSensor(parameters=scenario.sensor, seed=scenario.seed, weld=weld, tare=tare)
    )
    builder.Connect(reaction_forces, sensor.GetInputPort("reaction_forces"))
    return sensor


def ConnectMeasurement(builder: DiagramBuilder, law: Law, reader: LeafSystem) -> None:
    """Connects the monitored wrench and depth to a system that reads both."""
    for name in ("wrench", "depth"):
        builder.Connect(law.monitor.GetOutputPort(name), reader.GetInputPort(name))


def ConnectMonitors(builder: DiagramBuilder, law: Law, drive_monitor: DriveMonitor | None) -> None:
    """Connects the monitors of sensor and drive with the watchdog; an arm has no monitor of a drive."""
    system = drive_monitor or builder.AddNamedSystem("no_drive_monitor", ConstantVectorSource([0.0]))
    drive_fault = system.GetOutputPort("fault" if drive_monitor else "y0")
    builder.Connect(law.monitor.GetOutputPort("fault"), law.watchdog.GetInputPort("sensor_monitor_fault"))
    builder.Connect(drive_fault, law.watchdog.GetInputPort("drive_monitor_fault"))


def check_start(scenario: Scenario) -> None:
    """Checks that a trial can start as a scenario says.

    Raises:
        ValueError: if the scenario is not resolved, or starts in the hole.
    """
    if scenario.start.tilt is None:
        raise ValueError("scenario.start.tilt is missing: the scenario is not resolved; use resolve_scenario first")
    if scenario.start.depth > 0.0:
        raise ValueError(
            f"scenario.start.depth is {scenario.start.depth:g} m; expected 0 on the rig, which checks its sensor in"
            " free air before the first touch"
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
