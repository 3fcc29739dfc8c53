"""The rig as one compiled loop: the steps of the exact engine, of the hardware and of the law, without a diagram.

It is the diagram of `systems.rig` with the exact engine and a skill: the same steps, at the same times and in the same
order. As in Drake's Simulator, the updates that are due at a time are computed from the state before them, the
controller's first; rows and the monitor see the state before the updates of their time. Two multiples of different
periods that differ by round-off are two times, as they are for the Simulator.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from compiled import compiled
from models.contact_search import Bodies, deepest_overlap
from models.scenario import Scenario
from skill.arrays import Array
from skill.data.outcome import Outcome
from skill.data.rig_run import LOGGED_COLUMNS
from skill.features.measurement import load_of_components
from skill.skill_step import SkillNumbers, skill_step
from systems.law import dc_motor, drive_monitor, sensor_monitor, stepper_motor, watchdog
from systems.law.back_off import BackOffState
from systems.law.dc_motor import Drive, carriage_force, counted_travel, dc_motor_step
from systems.law.drive_monitor import DriveLimits, drive_monitor_step, is_enabled
from systems.law.force_guard import (
    CLOCKING,
    FEED_SPEED,
    PEAK,
    PITCH,
    YAW,
    GuardLimits,
    StoppingModel,
    force_guard_step,
)
from systems.law.force_guard import SIZE as GUARD_SIZE
from systems.law.limits import drive_limits, retract_limits, sensor_limits
from systems.law.policy_controller import ControllerLimits, ControllerState, policy_controller_step
from systems.law.sensor_monitor import SensorLimits, sensor_monitor_step, sound_depth, sound_wrench
from systems.law.stepper_motor import Axis, equilibrium_angle, shaft_angles, stepper_step
from systems.law.watchdog import RetractLimits, is_blind, is_stopped, passed_command, watchdog_step
from systems.law.wrench_sensor import SENSOR_NOISE, Sensor, drawn_bias, wrench_at_tip, wrench_sensor_step
from systems.math.noise import standard_normals
from systems.plant.contact_forces import FORCE, JOINED_SIZE, MAX_JOINED, join_contacts, needs_contacts
from systems.plant.contact_plant import DIVERGENCE_FORCE, NominalBodies
from systems.plant.exact_contact import STEPS
from systems.plant.exact_plant import FREEDOMS, Mechanics, advance_rig, tip_in_hole
from systems.rig_diagram import start_angles

TIME_OVER, INSERTED, FAULT, JAMMED, DIVERGED, FAILED = range(6)
OUTCOMES = (Outcome.TIME_OVER, Outcome.INSERTED, Outcome.FAULT, Outcome.JAMMED, Outcome.DIVERGED, Outcome.FAILED)
"""How the loop ends; `FAILED` if the policy returned an action that is not finite."""


class RigNumbers(NamedTuple):
    """A rig with the exact engine for compiled functions; parameters of its parts.

    Attributes:
        bodies, mechanics: of the engine.
        sensor_period, plant_period, control_period: s.
        sensor, drive, axis: of the hardware; all steppers have the same axis.
        steppers: how many there are, 2 or 3.
        encoder_resolution: of the depth, m.
        weight: of the peg, N.
        home: position of the carriage where the tip is level with the mouth, m.
        start: (4,), carriage (m), pitch, yaw and clocking (rad).
        full_depth: at which the peg is inserted, m.
        time_limit: s.
        guard, stopping, readings, feed, retract, control: limits of the steps of the law.
    """

    bodies: Bodies
    mechanics: Mechanics
    sensor_period: float
    plant_period: float
    control_period: float
    sensor: Sensor
    drive: Drive
    axis: Axis
    steppers: int
    encoder_resolution: float
    weight: float
    home: float
    start: Array
    full_depth: float
    time_limit: float
    guard: GuardLimits
    stopping: StoppingModel
    readings: SensorLimits
    feed: DriveLimits
    retract: RetractLimits
    control: ControllerLimits

    @classmethod
    def of(cls, scenario: Scenario, mechanics: Mechanics, known: NominalBodies, policy_period: float) -> Self:
        """Returns the rig of a resolved scenario.

        Args:
            scenario: resolved.
            mechanics: of this scenario; `Mechanics.of` takes long, and a trial changes the pivot only.
            known: of this scenario.
            policy_period: duration of an action, s.
        """
        step = scenario.contact.time_step
        m = mechanics._replace(pivot=float(scenario.rig.pivot_height or 0.0))
        angles = start_angles(scenario)
        return cls(
            bodies=Bodies.of(scenario),
            mechanics=m,
            sensor_period=scenario.sensor.period,
            plant_period=step,
            control_period=scenario.controller.period,
            sensor=Sensor.of(scenario.sensor),
            drive=Drive.of(scenario.feed, period=step),
            axis=Axis.of(scenario.stepper, period=step),
            steppers=len(angles),
            encoder_resolution=scenario.rig.encoder_resolution,
            weight=m.peg_mass * m.gravity,
            home=scenario.sensor.height,
            start=np.array([scenario.sensor.height + scenario.start.height, *angles, *[0.0] * (3 - len(angles))]),
            full_depth=scenario.full_depth,
            time_limit=scenario.trial.time_limit,
            guard=GuardLimits.of(scenario),
            stopping=StoppingModel.of(scenario, mass=known.mass, inertia=known.turning_inertia),
            readings=sensor_limits(scenario),
            feed=drive_limits(scenario),
            retract=retract_limits(scenario),
            control=ControllerLimits.of(scenario, policy_period),
        )


class Trace(NamedTuple):
    """What a trial leaves, with a row for each controller period and one for each step of the plant.

    Attributes:
        rows: (M, columns), `LOGGED_COLUMNS`.
        seen: (L,), numbers of contacts when the monitor looked.
        contacts: (L, MAX_JOINED, JOINED_SIZE), these contacts, see `join_contacts`.
        penetration: deepest overlap of the bodies at the same times, m.
        tips: (N, 3), centre of the tip in H.
        wrenches: (N, 6), true contact wrench on the peg about the tip; that of the first step does not count.
        peak_contact: largest force of a single contact, N.
        peak_load: largest measured load, N.
        outcome: how it ended, a number of `OUTCOMES`.
        fault: number of the fault.
        time: of the end, s.
        depth: of the tip at the end, m.
        back_off: state of the back-off at the end.
    """

    rows: Array
    seen: NDArray[np.int64]
    contacts: Array
    penetration: float
    tips: Array
    wrenches: Array
    peak_contact: float
    peak_load: float
    outcome: int
    fault: int
    time: float
    depth: float
    back_off: BackOffState


def roll_out(rig: RigNumbers, scenario: Scenario, skill: SkillNumbers) -> Trace:
    """Performs the trial of a resolved scenario; ``rig`` is that of this scenario."""
    ticks = 1 + round(rig.time_limit / rig.sensor_period)
    noise = standard_normals(scenario.seed, SENSOR_NOISE, ticks, 12)
    return perform(rig, skill, ControllerState(), noise, drawn_bias(scenario.sensor, scenario.seed))


class Contacts(NamedTuple):
    """Contacts of the step that would follow, and the overlap of the bodies, m; see `Trace`."""

    number: int
    contacts: Array
    overlap: float


@compiled
def _contacts(rig: RigNumbers, q: Array, v: Array, force: float, equilibrium: Array) -> Contacts:
    """Returns the contacts at positions and velocities of the engine; see `ExactPlant.contacts`."""
    later, speeds, m = q.copy(), v.copy(), rig.mechanics
    _, found, points, normals, forces = advance_rig(
        rig.bodies, m, later, speeds, force, equilibrium, rig.plant_period / STEPS, 1
    )
    R, tip = tip_in_hole(m, q)
    p = -m.pivot * R[:, 2]
    p[2] += m.pivot
    count, contacts = join_contacts(points[:found], normals[:found], forces[:found], R, p, tip[2], rig.bodies.chamfer)
    return Contacts(count, contacts, deepest_overlap(rig.bodies, tip, R[0], R[1]))


@compiled
def _depth(rig: RigNumbers, position: float) -> float:
    """Returns the depth that the encoder counts at a position of the carriage."""
    return round((rig.home - position) / rig.encoder_resolution) * rig.encoder_resolution


@compiled
def perform(rig: RigNumbers, skill: SkillNumbers, control: ControllerState, noise: Array, bias: Array) -> Trace:
    """Performs a trial.

    Args:
        rig: the rig.
        skill: that acts.
        control: state of the controller at the start.
        noise: (ticks, 12), of the sensor.
        bias: (6,), of the sensor.
    """
    limit, h = rig.time_limit, rig.plant_period
    M, N = 3 + int(limit / rig.control_period), 3 + int(limit / h)
    rows, n_rows = np.zeros((M, len(LOGGED_COLUMNS))), 0
    seen, contacts, n_seen = np.zeros(M, np.int64), np.zeros((M, MAX_JOINED, JOINED_SIZE)), 0
    tips, wrenches, n_steps = np.zeros((N, 3)), np.zeros((N, 6)), 0
    largest_load, largest_extent, peak_contact, penetration = 0.0, 0.0, 0.0, 0.0
    next_look, last_step = 0.0, -1

    q, v = np.zeros(FREEDOMS), np.zeros(FREEDOMS)
    q[0], q[3:] = rig.start[0], rig.start[1:]
    held, extent = np.zeros(6), 0.0
    held[2] = rig.weight
    tare = held.copy()
    sensor = np.zeros(12 + 6 * (rig.sensor.delay + 1))
    monitor, drive_state = np.zeros(sensor_monitor.SIZE), np.zeros(drive_monitor.SIZE)
    dog, guard, motor = np.zeros(watchdog.SIZE), np.zeros(GUARD_SIZE), np.zeros(dc_motor.SIZE)
    n_axes = rig.steppers
    axes, shafts = np.zeros((3, stepper_motor.SIZE)), np.zeros((n_axes, 2))
    memory = skill.memory.copy()
    failed = False

    periods = np.array([rig.sensor_period, h, rig.control_period])
    ticks = np.zeros(3, np.int64)
    row_tick = 0
    time, outcome = 0.0, TIME_OVER
    equilibrium, measured = np.zeros(3), np.zeros(7)
    while True:
        # What the outputs show at this time.
        depth = _depth(rig, q[0])
        reading = wrench_at_tip(sensor[-6:].copy(), rig.sensor.height)
        wrench, sound = sound_wrench(rig.readings, monitor, reading), sound_depth(monitor, depth)
        for k in range(n_axes):
            equilibrium[k] = rig.start[1 + k] + equilibrium_angle(rig.axis, axes[k])
        force = carriage_force(rig.drive, motor[dc_motor.CURRENT], v[0])
        logs = time == row_tick * rig.control_period
        acts = time == ticks[2] * periods[2]
        if logs or acts:
            measured[:6], measured[6] = wrench, -sound
            answer = skill_step(skill, memory, measured)
        if logs:
            rows[n_rows, :24] = np.array(  # in the order of `LOGGED_COLUMNS`, in tuples short enough for numba
                (
                    time, wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5], sound,
                    float(answer.state), 1.0 if answer.known else 0.0,
                    guard[PITCH], guard[YAW], guard[FEED_SPEED],
                    control.back_off.mode, control.support, dog[watchdog.FAULT],
                    axes[0, stepper_motor.TAKEN], axes[0, stepper_motor.LOST],
                    axes[1, stepper_motor.TAKEN], axes[1, stepper_motor.LOST],
                    q[0] - rig.home, q[3], q[4],
                    control.turning,
                )
            )  # fmt: skip
            rows[n_rows, 24:] = np.array(
                (guard[CLOCKING], axes[2, stepper_motor.TAKEN], axes[2, stepper_motor.LOST], q[5])
            )
            n_rows += 1
            row_tick += 1

        # The monitor of the trial.
        ended = False
        if time >= next_look - 1e-9:
            next_look += rig.control_period
            look = _contacts(rig, q, v, force, equilibrium)
            seen[n_seen], contacts[n_seen] = look.number, look.contacts
            penetration = max(penetration, look.overlap)
            n_seen += 1
            if look.number > 0:
                peak_contact = max(peak_contact, look.contacts[0, FORCE])
            if is_stopped(rig.retract, dog):
                outcome, ended = FAULT, True
            elif control.given_up != 0.0 and dog[watchdog.FAULT] == 0.0:
                outcome, ended = JAMMED, True
        step = math.ceil(time / h - 1e-6)
        if not ended and step != last_step:
            last_step = step
            true = wrench_at_tip(tare - held, rig.sensor.height)
            size = math.sqrt(true[0] ** 2 + true[1] ** 2 + true[2] ** 2)
            deep = rig.mechanics.sensor - q[0]
            if not (np.isfinite(true).all() and math.isfinite(deep)) or size > DIVERGENCE_FORCE:
                outcome, ended = DIVERGED, True
            else:
                tips[n_steps], wrenches[n_steps] = tip_in_hole(rig.mechanics, q)[1], true
                n_steps += 1
                if time > 0.0:
                    load = load_of_components(true[0], true[1], true[2], true[3], true[4], true[5], rig.guard.lever)
                    if needs_contacts(load, extent, largest_load, largest_extent):
                        largest_load, largest_extent = max(load, largest_load), max(extent, largest_extent)
                        look = _contacts(rig, q, v, force, equilibrium)
                        if look.number > 0:
                            peak_contact = max(peak_contact, look.contacts[0, FORCE])
                if deep >= rig.full_depth:
                    outcome, ended = INSERTED, True
        if ended or time >= limit:
            break

        # The updates of this time, from the state before them.
        if acts:
            if not (failed or control.given_up != 0.0):
                if np.isfinite(answer.turn).all() and math.isfinite(answer.spin + answer.feed + answer.support):
                    control = policy_controller_step(
                        rig.control,
                        control,
                        answer.turn,
                        answer.spin,
                        answer.feed,
                        answer.support,
                        wrench,
                        sound,
                        answer.known,
                        float(answer.state),
                        guard[PITCH],
                        guard[YAW],
                    )
                else:
                    outcome = FAILED
                    break
            ticks[2] += 1
        samples, drives = time == ticks[0] * periods[0], time == ticks[1] * periods[1]
        new_sensor, new_monitor, new_guard = sensor, monitor, guard
        new_drive, new_motor, new_axes, new_dog = drive_state, motor, axes, dog
        current, travel = motor[dc_motor.CURRENT], counted_travel(rig.drive, q[0])
        if samples:
            new_sensor = wrench_sensor_step(rig.sensor, sensor, held - tare, bias, noise[ticks[0]])
            new_monitor = sensor_monitor_step(rig.readings, monitor, reading, depth, time)
            new_guard = force_guard_step(
                rig.guard,
                rig.stopping,
                guard,
                wrench,
                sound,
                passed_command(rig.retract, dog, watchdog.PITCH_RATE, control.pitch_rate),
                passed_command(rig.retract, dog, watchdog.YAW_RATE, control.yaw_rate),
                passed_command(rig.retract, dog, watchdog.CLOCKING_RATE, control.clocking_rate),
                passed_command(rig.retract, dog, watchdog.FEED, control.feed_speed),
                passed_command(rig.retract, dog, watchdog.UNWINDING, control.unwinding) > 0.0,
                is_blind(dog),
            )
            ticks[0] += 1
        if acts:
            for k in range(n_axes):
                shafts[k] = shaft_angles(rig.axis, axes[k], q[3 + k] - rig.start[1 + k])
            faults = np.zeros(2)
            faults[0], faults[1] = monitor[sensor_monitor.FAULT], drive_state[drive_monitor.FAULT]
            new_dog = watchdog_step(rig.retract, dog, faults, failed, shafts)
            memory = answer.memory
        if drives:
            command = guard[FEED_SPEED]
            new_drive = drive_monitor_step(rig.feed, drive_state, command, wrench, sound, current, travel)
            new_motor = dc_motor_step(rig.drive, motor, command, v[0], is_enabled(drive_state))
            new_axes = axes.copy()
            for k in range(n_axes):
                new_axes[k] = stepper_step(rig.axis, axes[k], guard[PITCH + k], q[3 + k] - rig.start[1 + k])
            held, found, _, _, forces = advance_rig(
                rig.bodies, rig.mechanics, q, v, force, equilibrium, h / STEPS, STEPS
            )
            extent = forces[:found].sum()
            ticks[1] += 1
        sensor, monitor, guard = new_sensor, new_monitor, new_guard
        drive_state, motor, axes, dog = new_drive, new_motor, new_axes, new_dog
        time = min((ticks * periods).min(), row_tick * rig.control_period, limit)
    return Trace(
        rows[:n_rows],
        seen[:n_seen],
        contacts[:n_seen],
        penetration,
        tips[:n_steps],
        wrenches[:n_steps],
        peak_contact,
        guard[PEAK],
        outcome,
        int(dog[watchdog.FAULT]),
        time,
        rig.mechanics.sensor - q[0],
        control.back_off,
    )
