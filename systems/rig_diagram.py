"""A built diagram of the rig, its parts, and what one trial changes in it."""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, Diagram

from models.scenario import Scenario
from models.validation import copied
from skill.arrays import Array
from systems.law.stepper_motor import StepperMotor
from systems.law.wiring import Law
from systems.law.wrench_sensor import WrenchSensor
from systems.plant.rig_plant import PegCarrier, stepper_axes
from systems.recording.run_recorder import RunRecorder


@dataclass(frozen=True)
class RigDiagram:
    """A built diagram and the parts that a run reads.

    Attributes:
        diagram: the diagram, for a Simulator.
        plant: the plant and its bodies.
        recorder: recorder of measurements, commands and motions.
        law: the systems from the sensor's monitor to the force guard.
        sensor: the force/torque sensor.
        steppers: of the block, in the order of `stepper_axes`; an arm has none.
        scenario: of which the diagram was built.
    """

    diagram: Diagram
    plant: PegCarrier
    recorder: RunRecorder
    law: Law
    sensor: WrenchSensor
    steppers: tuple[StepperMotor, ...]
    scenario: Scenario

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
        if not is_same_rig(self.scenario, trial):
            raise ValueError(
                "the scenario is not resolved, or not that of the diagram; expected one that differs only in what"
                " resolve_scenario draws"
            )
        self.plant.set_trial(context, trial)
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


def start_angles(scenario: Scenario) -> tuple[float, ...]:
    """Returns the angles of the axes of the block at the start of a resolved scenario, rad; see `stepper_axes`."""
    assert scenario.start.tilt is not None
    # Tilting the peg by theta relative to the hole is the same as turning the hole by -theta.
    angles = (*scenario.start.tilt, scenario.start.clocking or 0.0)
    return tuple(-angle for angle in angles[: len(stepper_axes(scenario))])


def _home(scenario: Scenario) -> float:
    """Position of the carriage at the start, m."""
    return scenario.sensor.height + scenario.start.height


def is_same_rig(built: Scenario, trial: Scenario) -> bool:
    """Returns whether a resolved scenario differs from another one only in what `resolve_scenario` draws."""
    if trial.start.tilt is None or trial.rig.pivot_height is None:
        return False
    same = copied(trial)
    same.seed, same.operator = built.seed, built.operator
    same.start.tilt, same.start.offset = built.start.tilt, built.start.offset
    same.start.clocking, same.arm.hole_offset = built.start.clocking, built.arm.hole_offset
    same.rig.pivot_height, same.contact.friction = built.rig.pivot_height, built.contact.friction
    return bool(same == built)
