"""The law of control: what stands between a sensor and the motors, whatever carries the peg."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, LeafSystem, OutputPort
from pydrake.systems.primitives import ConstantVectorSource

from models.scenario import Scenario
from skill.data.geometry import PegHoleGeometry, fit_difference
from skill.policy import RigPolicy
from systems.control.estimator import READINGS, PolicyEstimator
from systems.control.force_guard import ForceGuard
from systems.control.policy_controller import PolicyController
from systems.control.sensor_monitor import SensorMonitor
from systems.control.watchdog import COMMANDS, MONITORS, Watchdog
from systems.hardware.wrench_sensor import WrenchSensor
from systems.steps.force_guard import GuardLimits, StoppingModel
from systems.steps.limits import retract_limits, sensor_limits
from systems.steps.policy_controller import ControllerLimits


@dataclass(frozen=True)
class Law:
    """The systems of a law, from the sensor to the force guard."""

    sensor: WrenchSensor
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


def AddLaw(
    builder: DiagramBuilder,
    scenario: Scenario,
    policy: RigPolicy,
    *,
    stopping: StoppingModel,
    weld: int,
    weight: float,
    steppers: Sequence[str],
) -> Law:
    """Adds the systems of a law and connects them with each other.

    Args:
        builder: of the diagram.
        scenario: resolved.
        policy: that acts.
        stopping: how what carries the peg stops.
        weld: index of the sensor in the reaction forces.
        weight: of what hangs on the sensor, N.
        steppers: names of the axes that have steppers.
    """
    sensor, control = scenario.sensor, scenario.controller
    tare = np.array([0.0, 0.0, weight, 0.0, 0.0, 0.0])  # the reaction in free air
    law = Law(
        sensor=builder.AddNamedSystem(
            "wrench_sensor", WrenchSensor(parameters=sensor, seed=scenario.seed, weld=weld, tare=tare)
        ),
        monitor=builder.AddNamedSystem(
            "sensor_monitor", SensorMonitor(limits=sensor_limits(scenario), period=sensor.period)
        ),
        estimator=builder.AddNamedSystem(
            "policy_estimator", PolicyEstimator(estimator=policy.estimator(), period=control.period)
        ),
        controller=builder.AddNamedSystem(
            "policy_controller",
            PolicyController(policy=policy, limits=ControllerLimits.of(scenario, policy.period_)),
        ),
        watchdog=builder.AddNamedSystem("watchdog", Watchdog(retract_limits(scenario), steppers)),
        force_guard=builder.AddNamedSystem(
            "force_guard", ForceGuard(limits=GuardLimits.of(scenario), stopping=stopping)
        ),
    )
    builder.Connect(law.sensor.GetOutputPort("wrench"), law.monitor.GetInputPort("raw_wrench"))
    for reader in (law.estimator, law.controller, law.force_guard):
        connect_measurement(builder, law, reader)
    builder.Connect(law.estimator.GetOutputPort("estimate"), law.controller.GetInputPort("estimate"))
    for name in ("target_pitch", "target_yaw"):
        for reader in (law.estimator, law.controller):
            builder.Connect(law.force_guard.GetOutputPort(name), reader.GetInputPort(name))
    for name in COMMANDS:
        builder.Connect(law.controller.GetOutputPort(name), law.watchdog.GetInputPort(name))
    for name in (*COMMANDS, "blind"):
        builder.Connect(law.watchdog.GetOutputPort(name), law.force_guard.GetInputPort(name))
    builder.Connect(law.controller.GetOutputPort("failed"), law.watchdog.GetInputPort("controller_failed"))
    return law


def connect_measurement(builder: DiagramBuilder, law: Law, reader: LeafSystem) -> None:
    """Connects the monitored wrench and depth to a system that reads both."""
    for name in ("wrench", "depth"):
        builder.Connect(law.monitor.GetOutputPort(name), reader.GetInputPort(name))


def connect_carrier(
    builder: DiagramBuilder,
    law: Law,
    *,
    reaction_forces: OutputPort,
    depth: OutputPort,
    monitors: Mapping[str, LeafSystem],
) -> None:
    """Connects what carries the peg to a law: its measurements, and the monitors that it has beside the sensor's.

    Args:
        builder: of the diagram.
        law: from `AddLaw`.
        reaction_forces: with that of the sensor.
        depth: as measured, m.
        monitors: systems with an output ``fault``, by their inputs of the watchdog; a missing one finds no fault.
    """
    builder.Connect(reaction_forces, law.sensor.GetInputPort("reaction_forces"))
    builder.Connect(depth, law.monitor.GetInputPort("raw_depth"))
    present = {MONITORS[0]: law.monitor, **monitors}
    for name in MONITORS:
        if name in present:
            fault = present[name].GetOutputPort("fault")
        else:
            fault = builder.AddNamedSystem(f"no_{name}", ConstantVectorSource([0.0])).get_output_port()
        builder.Connect(fault, law.watchdog.GetInputPort(name))


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
