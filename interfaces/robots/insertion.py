"""Insertions with an arm through its protocol: it sees joint angles and a sensor, and nothing else."""

from __future__ import annotations

import copy
import time
from typing import NoReturn

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from experiments.trial.ended_trial import EndedTrial, Looks
from experiments.trial.force_metrics import force_figures
from experiments.trial.motion_metrics import motion_figures
from interfaces.robots.robot_arm import ArmState, RobotArm
from interfaces.sensors.tool import Tool, identify_tool
from interfaces.sensors.wrench_stream import WrenchStream
from models.scenario import TRIAL_STREAM, Scenario, resolve_scenario
from skill.arrays import Array
from skill.data.axes import AXES
from skill.data.outcome import Ending, Outcome
from skill.policy.rig_policy import RigPolicy
from systems.arm.arm_bodies import PERIOD
from systems.arm.arm_diagram import stopping_of
from systems.arm.arm_law import ArmLaw
from systems.arm.kinematics import FLANGE_TO_SENSOR, ArmKinematics
from systems.arm.tip import HEIGHT, tip_step
from systems.arm.tip_servo import height_along, tip_at, tip_pose
from systems.law.faults import Fault
from systems.law.wrench_sensor import wrench_at_tip
from systems.plant.contact_forces import JOINED_SIZE, MAX_JOINED
from systems.plant.held_peg import rig_angles

READY_HEIGHT = 0.03
"""Height of the tip over the mouth between insertions, m."""

AIR_HEIGHT = 0.15
"""Height of the tip over the mouth where the arm turns the tool, m."""

JOINT_SPEED = 0.6
"""Of motions in free air, rad/s."""

RETREAT_SPEED = 0.03
"""Of the tip out of the hole, m/s."""

LOOK_TILT = 0.8
"""Angle by which the arm turns the tool to find its weight, rad."""

REST_TIME, LOOK_TIME = 0.3, 0.3
"""Time before and during which readings at rest are averaged, s."""

SILENCE = 0.02
"""Time on the clock of the arm without a new reading of the sensor after which the arm is stopped, s."""

PATIENCE = 1.0
"""Time for which a new state of the arm is waited for, s; without commands the arm stops by itself long before."""

LONGEST_STEP = 0.01
"""Longest time that one step of the law covers, s; what is longer does not count: a reading that stays the same for so
long would pass for that of a stuck sensor."""

FORCE_LIMIT = 80.0
"""Measured force at which the arm is stopped at once, N: twice the load that the force guard keeps."""

SIDE_LIMIT = 0.005
"""Distance of the peg's axis from the believed mouth at which the arm is stopped, m."""

NO_LOOKS = Looks(np.zeros(0, dtype=np.int64), np.zeros((0, MAX_JOINED, JOINED_SIZE)))


class ArmSession:
    """An arm, its sensor, and a hole where the scenario says that it is.

    Every method that moves the arm raises a `ConnectionError` where the arm or the sensor stops answering, or a limit
    of force or place is passed in an insertion or a retreat; the arm is stopped before.

    Attributes:
        tool: what hangs on the sensor.
        scenario: resolved.

    Args:
        arm: the arm.
        sensor: its sensor; the axes of its frame S are those of the peg, z from the tip to the flange.
        scenario: of the arm; what it draws for a simulated hole has no effect.
    """

    def __init__(self, arm: RobotArm, sensor: WrenchStream, scenario: Scenario) -> None:
        known = copy.deepcopy(scenario)
        known.start.tilt, known.start.clocking, known.arm.hole_offset = [0.0, 0.0], 0.0, [0.0, 0.0]
        self.scenario = resolve_scenario(known, seed=0, stream=TRIAL_STREAM)
        self._arm, self._sensor, self._kinematics = arm, sensor, ArmKinematics(self.scenario)
        self.tool = Tool(0.0, np.zeros(3), np.zeros(6), 0.0, 0.0)
        self._command = arm.state().angles
        self._fresh = (-1.0, 0.0)  # time of the newest reading, and of the arm when it came
        self._raised = 0.0  # height by which everything is above its place, m
        self._commanded = np.zeros(3), tip_at(self.scenario.start.height)  # angles and tip of the last command
        self._depth = 0.0  # last measured depth of the tip, m

    def find_tool(self) -> Tool:
        """Turns the tool in free air, finds what hangs on the sensor, and tells the arm.

        Raises:
            ValueError: if the readings are not those of a weight. The message says what explains them.
        """
        tilts = [(0.0, 0.0), (LOOK_TILT, 0.0), (-LOOK_TILT, 0.0), (0.0, LOOK_TILT), (0.0, -LOOK_TILT)]
        upright = tip_pose(np.zeros(3), tip_at(AIR_HEIGHT))
        rotations, readings = [], []
        for about_x, about_y in tilts:
            self._move_to(RigidTransform(RollPitchYaw(about_x, about_y, 0.0), upright.translation()))
            rotations.append(self._kinematics.tip(self._arm.state().angles).rotation().matrix())
            readings.append(self._mean_reading())
        found = identify_tool(rotations, readings)
        found.check()
        self.tool = found
        # From S to the frame of the flange: half a turn about x.
        self._arm.set_tool(found.mass, np.array([1.0, -1.0, -1.0]) * found.centre + [0.0, 0.0, FLANGE_TO_SENSOR])
        return found

    def reading_along_base(self) -> Array:
        """Returns the mean force (3,) that the sensor reads, along the axes of the base, with weight and bias."""
        R_WS = self._kinematics.tip(self._arm.state().angles).rotation().matrix()
        return np.asarray(R_WS @ self._mean_reading()[:3])

    def approach(self, raised: float = 0.0) -> None:
        """Moves over the hole, and takes what the sensor reads there, without the weight, as its bias.

        Args:
            raised: height by which all that follows is above its place, m; for a motion in free air only.
        """
        self._raised = raised
        self._move_to(self._above(READY_HEIGHT))
        R_WS = self._kinematics.tip(self._arm.state().angles).rotation().matrix()
        self.tool = self.tool.with_bias(self._mean_reading(), R_WS)
        self._move_to(self._above(self.scenario.start.height))

    def insert(self, policy: RigPolicy, number: int) -> EndedTrial:
        """Performs an insertion from above the mouth; see `approach`.

        Where the arm is stopped, the insertion has ``Outcome.FAILED``, and its detail says why.

        Args:
            policy: that acts.
            number: of the insertion, for the record.
        """
        s = self.scenario
        law = ArmLaw(s, policy, stopping_of(s, self._kinematics, delay=self._arm.period))
        wrenches: list[Array] = []
        tips: list[Array] = []
        try:
            ending = self._perform(law, wrenches, tips)
        except ConnectionError as error:
            if law.time == 0.0:
                raise  # there is nothing to record
            ending = Ending(Outcome.FAILED, str(error))
        samples = law.samples()
        if ending.outcome is Outcome.INSERTED:  # the hole is as askew as the peg in it, which a replay shows
            samples[list(AXES)] -= samples[list(AXES)].iloc[-1]
        return EndedTrial(
            number=number,
            scenario=s,
            outcome=ending.outcome,
            detail=ending.detail,
            fault=law.law.fault(law.context),
            failure=law.law.failure(law.context),
            time=law.time,
            depth=self._depth,
            samples=samples,
            forces=force_figures(wrenches, s.geometry.reach, PERIOD, 0.0, law.law.peak_load(law.context)),
            motion=motion_figures(tips, PERIOD, s.geometry.hole_depth),
            penetration=0.0,
            looks=NO_LOOKS,
        )

    def _perform(self, law: ArmLaw, wrenches: list[Array], tips: list[Array]) -> Ending:
        """Moves as the law says until the insertion ends, and returns how."""
        tip, ending = tip_at(self.scenario.start.height), None
        state = self._arm.state()
        followed = state.time
        while ending is None:
            state, seconds = self._next_state(state)
            X_WP = self._tip(state)
            wrench, depth = self._contact(state, X_WP), -height_along(X_WP)
            self._depth = depth
            law.advance(seconds, wrench, depth, np.array([-depth, *rig_angles(X_WP.rotation().matrix())]))
            for _ in range(round(seconds / PERIOD)):
                wrenches.append(wrench)
                tips.append(X_WP.translation())
            angles, feed = law.commands()
            push = X_WP.rotation() @ law.wrench()[:3]
            tip = tip_step(self.scenario.arm, seconds, tip, feed, push[:2])
            self._commanded = angles, tip
            followed = self._follow(tip_pose(angles, tip), state, followed)
            ending = self._ending(law, depth)
        return ending

    def retreat(self) -> None:
        """Draws the peg out of the hole along its axis, and stays over the hole."""
        (angles, tip), state = self._commanded, self._arm.state()
        tip, followed = tip.copy(), state.time
        while tip[HEIGHT] < READY_HEIGHT:
            state, seconds = self._next_state(state)
            self._contact(state, self._tip(state))
            tip[HEIGHT] += RETREAT_SPEED * seconds
            followed = self._follow(tip_pose(angles, tip), state, followed)
        self._arm.stop()

    def _ending(self, law: ArmLaw, depth: float) -> Ending | None:
        """Returns how the insertion has ended, if it has."""
        s, own = self.scenario, law.law
        if own.stopped(law.context):
            return Ending(Outcome.FAULT)
        tried = own.tried(law.context)
        if tried and own.fault(law.context) is Fault.NONE:
            return Ending(Outcome.JAMMED, tried)
        if depth >= s.full_depth:
            return Ending(Outcome.INSERTED)
        return Ending(Outcome.TIME_OVER) if law.time >= s.trial.time_limit else None

    def _above(self, height: float) -> RigidTransform:
        return RigidTransform([0.0, 0.0, self._raised]) @ tip_pose(np.zeros(3), tip_at(height))

    def _tip(self, state: ArmState) -> RigidTransform:
        """Returns X_WP, with the mouth of the hole raised as in `approach`."""
        return RigidTransform([0.0, 0.0, -self._raised]) @ self._kinematics.tip(state.angles)

    def _move_to(self, X_WP: RigidTransform) -> None:
        tip = self._kinematics.tip(self._arm.state().angles).translation()
        if tip[2] < 0.0 and np.hypot(tip[0], tip[1]) < 2.0 * SIDE_LIMIT:
            self._halt("the peg is in the hole, out of which joints do not move it; draw it out by hand")
        self._command = self._kinematics.angles_at(X_WP)
        self._arm.move_to(self._command, JOINT_SPEED)

    def _follow(self, X_WP: RigidTransform, state: ArmState, last: float) -> float:
        """Commands a pose of the tip if the arm takes the next one; returns the time of the last command, s."""
        seconds = state.time - last
        if seconds < self._arm.period - 0.5 * PERIOD:
            return last
        raised = RigidTransform([0.0, 0.0, self._raised]) @ X_WP
        step = self._kinematics.motion_to(self._command, raised)
        self._command = self._command + step
        self._arm.follow(self._command, step / seconds)
        return state.time

    def _next_state(self, last: ArmState) -> tuple[ArmState, float]:
        """Waits for the next state, and returns it and the time since the last one as whole periods, s."""
        began = time.monotonic()
        while True:
            state = self._arm.state()
            if state.fault:
                self._halt(state.fault)
            steps = round((state.time - last.time) / PERIOD)
            if steps > 0:
                return state, PERIOD * min(steps, round(LONGEST_STEP / PERIOD))
            if time.monotonic() - began > PATIENCE:
                self._halt("the arm sends no new state")
            time.sleep(0.2 * PERIOD)

    def _contact(self, state: ArmState, X_WP: RigidTransform) -> Array:
        """Returns the wrench (6,) of the contact on the peg about its tip, in P."""
        wrench = self.tool.contact(self._reading(state), X_WP.rotation().matrix())
        force = float(np.linalg.norm(wrench[:3]))
        if not force <= FORCE_LIMIT:  # nor is a force that is no number
            self._halt(f"a force of {force:.0f} N, beyond {FORCE_LIMIT:g} N")
        axis, p = X_WP.rotation().col(2), X_WP.translation()
        aside = float(np.linalg.norm(p - axis * (p @ axis)))
        if not aside <= SIDE_LIMIT:
            self._halt(f"the peg is {1e3 * aside:.1f} mm beside the hole, beyond {1e3 * SIDE_LIMIT:g} mm")
        return wrench_at_tip(wrench, self.scenario.sensor.height)

    def _reading(self, state: ArmState) -> Array:
        """Returns the newest reading (6,) at a state of the arm."""
        reading = self._sensor.latest()
        if reading is None or not reading.sound:
            self._halt(f"the sensor has no sound reading ({self._sensor.counts().text()})")
        if reading.time != self._fresh[0]:
            self._fresh = (reading.time, state.time)
        elif state.time - self._fresh[1] > SILENCE:
            self._halt(f"the sensor is silent ({self._sensor.counts().text()})")
        return reading.wrench

    def _halt(self, reason: str) -> NoReturn:
        self._arm.stop()
        raise ConnectionError(f"stopped: {reason}")

    def _mean_reading(self) -> Array:
        """Returns the mean reading (6,) at rest."""
        start = state = self._arm.state()
        readings = []
        while state.time - start.time < REST_TIME + LOOK_TIME:
            state, _ = self._next_state(state)
            reading = self._reading(state)
            if state.time - start.time >= REST_TIME:
                readings.append(reading)
        return np.asarray(np.mean(readings, axis=0))
