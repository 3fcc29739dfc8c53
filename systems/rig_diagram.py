"""A built diagram of the rig, its parts, and what one trial changes in it."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Self

from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from models.scenario import Scenario
from skill.arrays import Array
from systems.control.force_guard import ForceGuard
from systems.control.policy_controller import PolicyController
from systems.control.watchdog import Watchdog
from systems.hardware.stepper_motor import StepperMotor
from systems.hardware.wrench_sensor import WrenchSensor
from systems.law import Law
from systems.plant.rig_plant import PegCarrier, stepper_axes
from systems.recording.run_recorder import RunRecorder
from systems.steps.faults import Fault


@dataclass(frozen=True)
class RigDiagram:
    """A built diagram and the parts that a run reads.

    Attributes:
        diagram: the diagram, for a Simulator.
        plant: the plant and its bodies.
        recorder: recorder of measurements, commands and motions.
        controller: the system that runs the policy.
        watchdog: the system between controller and motors.
        force_guard: the system that limits the load, before the motors.
        sensor: the force/torque sensor.
        steppers: of the block, in the order of `stepper_axes`; an arm has none.
        scenario: of which the diagram was built.
    """

    diagram: Diagram
    plant: PegCarrier
    recorder: RunRecorder
    controller: PolicyController
    watchdog: Watchdog
    force_guard: ForceGuard
    sensor: WrenchSensor
    steppers: tuple[StepperMotor, ...]
    scenario: Scenario

    @classmethod
    def of(
        cls,
        builder: DiagramBuilder,
        name: str,
        plant: PegCarrier,
        recorder: RunRecorder,
        law: Law,
        *,
        steppers: tuple[StepperMotor, ...],
        scenario: Scenario,
    ) -> Self:
        """Builds the diagram and names it; the other arguments are its parts."""
        diagram = builder.Build()
        diagram.set_name(name)
        return cls(
            diagram,
            plant,
            recorder,
            law.controller,
            law.watchdog,
            force_guard=law.force_guard,
            sensor=law.sensor,
            steppers=steppers,
            scenario=scenario,
        )

    def set_start(self, context: Context) -> None:
        """Moves carriage and gimbal to the start of the scenario; ``context`` is the diagram's."""
        self.plant.set_start(context, carriage=_home(self.scenario), angles=start_angles(self.scenario))

    def set_trial(self, context: Context, trial: Scenario) -> None:
        """Replaces in a new context all that one trial has of its own, and moves carriage and gimbal to its start.

        The diagram then simulates the same, bit for bit, as one that is built from ``trial``.

        Args:
            context: of the diagram, as Drake has created it.
            trial: the scenario of this diagram, resolved with another seed.

        Raises:
            ValueError: if the scenario differs in more than `resolve_scenario` draws.
        """
        _check_same_rig(self.scenario, trial)
        stopping = self.plant.set_trial(context, trial)
        self.force_guard.set_stopping(self.force_guard.GetMyMutableContextFromRoot(context), stopping)
        self.sensor.set_seed(self.sensor.GetMyMutableContextFromRoot(context), trial.seed)
        angles = start_angles(trial)
        for stepper, angle in zip(self.steppers, angles, strict=False):  # an arm has no steppers
            stepper.set_start_angle(stepper.GetMyMutableContextFromRoot(context), angle)
        self.plant.set_start(context, carriage=_home(trial), angles=angles)

    def poses(self, context: Context) -> tuple[RigidTransform, RigidTransform]:
        """Returns the poses X_WP of the peg and X_WH of the block for a picture; ``context`` is the diagram's.

        Their relative pose is exact. The mount lets both move sideways by micrometres, which is left out.
        """
        X_WP = RigidTransform([0.0, 0.0, self.plant.tip_height(context)])
        return X_WP, X_WP @ self.plant.peg_in_hole(context).inverse()

    def contact_wrench(self, context: Context) -> Array:
        """Returns the true wrench (6,) on the peg about its tip, in P: force (N), then moment (N m).

        It serves the evaluation of a run. It includes the inertial force of the peg, which is a small part of a newton
        at the speeds of the rig.
        """
        return self.sensor.contact_wrench(self.sensor.GetMyContextFromRoot(context))

    def peak_measured_load(self, context: Context) -> float:
        """Returns the largest load (N) that the sensor has measured; ``context`` is the diagram's."""
        return self.force_guard.peak_load(self.force_guard.GetMyContextFromRoot(context))

    def fault(self, context: Context) -> Fault:
        """Returns the fault that the rig has detected; ``context`` is the diagram's."""
        own = self.watchdog.GetMyContextFromRoot(context)
        return Fault(int(self.watchdog.GetOutputPort("fault").Eval(own)[0]))

    def failure(self, context: Context) -> str:
        """Returns why the policy failed, or "" if it has not; ``context`` is the diagram's."""
        return self.controller.failure(self.controller.GetMyContextFromRoot(context))

    def tried(self, context: Context) -> str:
        """Returns what the policy has tried if it has nothing new to try, else ""; ``context`` is the diagram's."""
        return self.controller.tried(self.controller.GetMyContextFromRoot(context))

    def stopped(self, context: Context) -> bool:
        """Returns whether the watchdog has retracted the peg after a fault and stopped."""
        return bool(self.watchdog.GetOutputPort("stopped").Eval(self.watchdog.GetMyContextFromRoot(context))[0])


def start_angles(scenario: Scenario) -> tuple[float, ...]:
    """Returns the angles of the axes of the block at the start of a resolved scenario, rad; see `stepper_axes`."""
    assert scenario.start.tilt is not None
    # Tilting the peg by theta relative to the hole is the same as turning the hole by -theta.
    angles = (*scenario.start.tilt, scenario.start.clocking or 0.0)
    return tuple(-angle for angle in angles[: len(stepper_axes(scenario))])


def _home(scenario: Scenario) -> float:
    """Position of the carriage at the start, m."""
    return scenario.sensor.height + scenario.start.height


def _check_same_rig(built: Scenario, trial: Scenario) -> None:
    """Refuses a scenario that differs in more than `resolve_scenario` draws."""
    same = copy.deepcopy(trial)
    same.seed, same.operator = built.seed, built.operator
    same.start.tilt, same.start.offset = built.start.tilt, built.start.offset
    same.start.clocking, same.arm.hole_offset = built.start.clocking, built.arm.hole_offset
    same.rig.pivot_height, same.contact.friction = built.rig.pivot_height, built.contact.friction
    if trial.start.tilt is None or trial.rig.pivot_height is None or same != built:
        raise ValueError(
            "the scenario is not resolved, or not that of the diagram; expected one that differs only in what"
            " resolve_scenario draws"
        )
