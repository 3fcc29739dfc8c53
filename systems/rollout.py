"""The rig as one compiled loop: the steps of the exact engine, of the hardware and of the law, without a diagram.

It is the diagram of `systems.rig` with the exact engine and a skill: the same steps, at the same times and in the same
order. As in Drake's Simulator, the updates that are due at a time are computed from the state before them, the
controller's first; rows and the monitor see the state before the updates of their time. Two multiples of different
periods that differ by round-off are two times, as they are for the Simulator.

At each time the loop observes (`observe`, `log`), judges whether the trial has ended (`judge`), and updates (`update`).
"""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from compiled import compiled, compiled_within
from models.contact_bodies import Bodies
from models.exact_geometry import NORMAL, POINT, deepest_overlap, pose_of
from models.scenario import Scenario
from skill.arrays import Array, assign
from skill.data.outcome import Outcome
from skill.data.rig_run import LOGGED_COLUMNS
from skill.features.measurement import load_of_components
from skill.skill_step import SkillAnswer, SkillNumbers, skill_step
from systems.law import dc_motor, drive_monitor, sensor_monitor, stepper_motor, watchdog
from systems.law.dc_motor import Drive, carriage_force, counted_travel, dc_motor_step
from systems.law.drive_monitor import DriveLimits, drive_monitor_step, is_enabled
from systems.law.force_guard import (
    CLOCKING,
    FEED_SPEED,
    PITCH,
    YAW,
    GuardLimits,
    StoppingModel,
    force_guard_step,
)
from systems.law.force_guard import SIZE as GUARD_SIZE
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

ROW = np.dtype([(name, float) for name in LOGGED_COLUMNS])
"""A row of what the rig logs."""

GOES_ON = -1
TIME_OVER, INSERTED, FAULT, JAMMED, DIVERGED, FAILED = range(6)
OUTCOMES = (Outcome.TIME_OVER, Outcome.INSERTED, Outcome.FAULT, Outcome.JAMMED, Outcome.DIVERGED, Outcome.FAILED)
"""How a trial ends, `GOES_ON` while it does not; `FAILED` if the policy returned an action that is not finite."""


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
    def of(cls, scenario: Scenario, policy_period: float) -> Self:
        """Returns the rig of a resolved scenario, which takes long; see `ControllerLimits` for ``policy_period``."""
        step, m, known = scenario.contact.time_step, Mechanics.of(scenario), NominalBodies.of(scenario)
        return cls(
            bodies=Bodies.of(scenario),
            mechanics=m,
            sensor_period=scenario.sensor.period,
            plant_period=step,
            control_period=scenario.controller.period,
            sensor=Sensor.of(scenario.sensor),
            drive=Drive.of(scenario.feed, period=step),
            axis=Axis.of(scenario.stepper, period=step),
            steppers=len(start_angles(scenario)),
            encoder_resolution=scenario.rig.encoder_resolution,
            weight=m.peg_mass * m.gravity,
            home=scenario.sensor.height,
            start=np.zeros(4),
            full_depth=scenario.full_depth,
            time_limit=scenario.trial.time_limit,
            guard=GuardLimits.of(scenario),
            stopping=StoppingModel.of(scenario, mass=known.mass, inertia=known.turning_inertia),
            readings=SensorLimits.of(scenario),
            feed=DriveLimits.of(scenario),
            retract=RetractLimits.of(scenario),
            control=ControllerLimits.of(scenario, policy_period),
        ).with_draws(scenario)

    def with_draws(self, trial: Scenario) -> Self:
        """Returns the rig of a trial that differs only in what `resolve_scenario` draws."""
        angles = start_angles(trial)
        return self._replace(
            bodies=self.bodies._replace(law=self.bodies.law._replace(friction=trial.contact.friction)),
            mechanics=self.mechanics._replace(pivot=float(trial.rig.pivot_height or 0.0)),
            start=np.array([self.home + trial.start.height, *angles, *[0.0] * (3 - len(angles))]),
        )


TALLY = np.dtype(
    [(name, int) for name in ("rows", "looks", "steps", "last_step")]
    + [(name, float) for name in ("next_look", "load", "extent", "peak_contact", "penetration")]
)
"""What the judge remembers: how much is filled of `Record`; the number of the last step of the plant and the time of
the next look at contacts, s; the largest load and extent so far, N (see `needs_contacts`); the largest force of a
single contact so far, N, and the deepest overlap of the bodies once a controller period, m."""


class Record(NamedTuple):
    """What a trial leaves; while it goes on, the arrays are longer than what is filled.

    Attributes:
        rows: (M,), each a `ROW`, one for each controller period.
        seen: (L,), numbers of contacts once a controller period.
        contacts: (L, MAX_JOINED, JOINED_SIZE), these contacts, see `join_contacts`.
        tips: (N, 3), centre of the tip in H, one for each step of the plant.
        wrenches: (N, 6), true contact wrench on the peg about the tip; that of the first step does not count.
        tally: (1,), a `TALLY`; an array, since compiled code does not own a single element.
    """

    rows: NDArray[np.void]
    seen: NDArray[np.int64]
    contacts: Array
    tips: Array
    wrenches: Array
    tally: NDArray[np.void]


class RigState(NamedTuple):
    """The rig between two updates.

    Attributes:
        q, v: positions and speeds of the engine; the only arrays that the update changes.
        held: (6,), wrench in which the sensor holds the peg, N and N m.
        extent: sum of the contact forces of the last step, N.
        sensor, monitor, drive, dog, guard, motor: of the steps of the law.
        axes: (3, size), of the steppers.
        memory: of the skill.
        control: of the controller.
    """

    q: Array
    v: Array
    held: Array
    extent: float
    sensor: Array
    monitor: Array
    drive: Array
    dog: Array
    guard: Array
    motor: Array
    axes: Array
    memory: Array
    control: ControllerState


class Trace(NamedTuple):
    """What a trial leaves, how it ended (a number of `OUTCOMES`), when (s), and the state of the rig then."""

    record: Record
    outcome: int
    time: float
    state: RigState


class Observation(NamedTuple):
    """What the outputs of the rig show.

    Attributes:
        depth: that the encoder counts, m.
        reading: (6,), of the sensor, about the tip.
        wrench: (6,), the reading, or what the sensor monitor passes on in its place.
        sound: likewise, of the depth, m.
        force: of the drive on the carriage, N.
        equilibrium: (3,), angles to which the steppers pull, rad.
    """

    depth: float
    reading: Array
    wrench: Array
    sound: float
    force: float
    equilibrium: Array


class Due(NamedTuple):
    """Whose updates are due at a time."""

    sensor: bool
    plant: bool
    control: bool


class Contacts(NamedTuple):
    """Contacts of the step that would follow, and the overlap of the bodies, m; see `Record`."""

    number: int
    contacts: Array
    overlap: float


def first_state(rig: RigNumbers, memory: Array) -> RigState:
    """Returns the state at the start, in which the sensor holds the weight of the peg."""
    q, held = np.zeros(FREEDOMS), np.zeros(6)
    q[0], q[3:] = rig.start[0], rig.start[1:]
    held[2] = rig.weight
    return RigState(
        q=q,
        v=np.zeros(FREEDOMS),
        held=held,
        extent=0.0,
        sensor=np.zeros(12 + 6 * (rig.sensor.delay + 1)),
        monitor=np.zeros(sensor_monitor.SIZE),
        drive=np.zeros(drive_monitor.SIZE),
        dog=np.zeros(watchdog.SIZE),
        guard=np.zeros(GUARD_SIZE),
        motor=np.zeros(dc_motor.SIZE),
        axes=np.zeros((3, stepper_motor.SIZE)),
        memory=memory.copy(),
        control=ControllerState(),
    )


@compiled_within
def observe(rig: RigNumbers, state: RigState) -> Observation:
    """Returns what the outputs show."""
    depth = round((rig.home - state.q[0]) / rig.encoder_resolution) * rig.encoder_resolution
    reading = wrench_at_tip(state.sensor[-6:].copy(), rig.sensor.height)
    equilibrium = np.zeros(3)
    for k in range(rig.steppers):
        equilibrium[k] = rig.start[1 + k] + equilibrium_angle(rig.axis, state.axes[k])
    return Observation(
        depth=depth,
        reading=reading,
        wrench=sound_wrench(rig.readings, state.monitor, reading),
        sound=sound_depth(state.monitor, depth),
        force=carriage_force(rig.drive, state.motor[dc_motor.CURRENT], state.v[0]),
        equilibrium=equilibrium,
    )


@compiled_within
def log(row: np.void, rig: RigNumbers, state: RigState, time: float, shown: Observation, answer: SkillAnswer) -> None:
    """Fills a row."""
    row["time"] = time
    row["fx"], row["fy"], row["fz"] = shown.wrench[0], shown.wrench[1], shown.wrench[2]
    row["mx"], row["my"], row["mz"] = shown.wrench[3], shown.wrench[4], shown.wrench[5]
    row["depth"] = shown.sound
    row["state"], row["known"] = float(answer.state), 1.0 if answer.known else 0.0
    row["target_pitch"], row["target_yaw"] = state.guard[PITCH], state.guard[YAW]
    row["target_clocking"], row["feed_speed"] = state.guard[CLOCKING], state.guard[FEED_SPEED]
    row["back_off"], row["turning"] = state.control.back_off.mode, state.control.turning
    row["support"], row["fault"] = state.control.support, state.dog[watchdog.FAULT]
    taken, lost = state.axes[:, stepper_motor.TAKEN], state.axes[:, stepper_motor.LOST]
    row["pitch_taken"], row["yaw_taken"], row["clocking_taken"] = taken[0], taken[1], taken[2]
    row["pitch_lost"], row["yaw_lost"], row["clocking_lost"] = lost[0], lost[1], lost[2]
    row["tip_z"] = state.q[0] - rig.home
    row["pitch"], row["yaw"], row["clocking"] = state.q[3], state.q[4], state.q[5]


@compiled_within
def look(rig: RigNumbers, state: RigState, shown: Observation) -> Contacts:
    """Returns the contacts; see `ExactPlant.contacts`."""
    later, speeds, m = state.q.copy(), state.v.copy(), rig.mechanics
    _, found, nearby, forces = advance_rig(
        rig.bodies, m, later, speeds, shown.force, shown.equilibrium, rig.plant_period / STEPS, 1
    )
    (R, tip), p = tip_in_hole(m, state.q), np.empty(3)
    for i in range(3):
        p[i] = -m.pivot * R[i, 2]
    p[2] += m.pivot
    points, normals = nearby[:found, POINT].copy(), nearby[:found, NORMAL].copy()
    count, contacts = join_contacts(points, normals, forces[:found], R, p, tip[2], rig.bodies.chamfer)
    return Contacts(count, contacts, deepest_overlap(rig.bodies, pose_of(tip, R.T)))


@compiled_within
def judge(rig: RigNumbers, state: RigState, time: float, shown: Observation, record: Record) -> int:
    """Records what the monitor of the trial sees, and returns how the trial has ended, or `GOES_ON`."""
    tally, loaded = record.tally[0], np.empty(6)
    for k in range(6):
        loaded[k] = (rig.weight if k == 2 else 0.0) - state.held[k]
    true = wrench_at_tip(loaded, rig.sensor.height)
    load = load_of_components(true[0], true[1], true[2], true[3], true[4], true[5], rig.guard.lever)
    step, is_due = math.ceil(time / rig.plant_period - 1e-6), time >= tally["next_look"] - 1e-9
    is_stepped = step != tally["last_step"]
    grows = is_stepped and time > 0.0 and needs_contacts(load, state.extent, tally["load"], tally["extent"])
    if grows:
        tally["load"], tally["extent"] = max(load, tally["load"]), max(state.extent, tally["extent"])
    if is_due or grows:
        found = look(rig, state, shown)
        if found.number > 0:
            tally["peak_contact"] = max(tally["peak_contact"], found.contacts[0, FORCE])
    if is_due:
        tally["next_look"] += rig.control_period
        record.seen[tally["looks"]] = found.number
        for k in range(found.number):
            assign(record.contacts[tally["looks"], k], found.contacts[k])
        tally["looks"] += 1
        tally["penetration"] = max(tally["penetration"], found.overlap)
        if is_stopped(rig.retract, state.dog):
            return FAULT
        if state.control.given_up != 0.0 and state.dog[watchdog.FAULT] == 0.0:
            return JAMMED
    if not is_stepped:
        return GOES_ON
    tally["last_step"] = step
    size = math.sqrt(true[0] ** 2 + true[1] ** 2 + true[2] ** 2)
    deep = rig.mechanics.sensor - state.q[0]
    if not math.isfinite(size + true[3] + true[4] + true[5] + deep) or size > DIVERGENCE_FORCE:
        return DIVERGED
    assign(record.tips[tally["steps"]], tip_in_hole(rig.mechanics, state.q)[1])
    assign(record.wrenches[tally["steps"]], true)
    tally["steps"] += 1
    return INSERTED if deep >= rig.full_depth else GOES_ON


@compiled_within
def is_finite(answer: SkillAnswer) -> bool:
    """Returns whether an action can be performed."""
    turn = answer.turn[0] + answer.turn[1] + answer.spin
    return math.isfinite(turn + answer.feed + answer.support)


@compiled_within
def act(rig: RigNumbers, state: RigState, shown: Observation, answer: SkillAnswer) -> ControllerState:
    """Returns the state of the controller after an action."""
    return policy_controller_step(
        rig.control,
        state.control,
        answer.turn,
        answer.spin,
        answer.feed,
        answer.support,
        shown.wrench,
        shown.sound,
        answer.known,
        float(answer.state),
        state.guard[PITCH],
        state.guard[YAW],
    )


def roll_out(rig: RigNumbers, scenario: Scenario, skill: SkillNumbers) -> Trace:
    """Performs the trial of a resolved scenario; ``rig`` is that of this scenario."""
    ticks = 1 + round(rig.time_limit / rig.sensor_period)
    noise = standard_normals(scenario.seed, SENSOR_NOISE, ticks, 12)
    return perform(rig, skill, first_state(rig, skill.memory), noise, drawn_bias(scenario.sensor, scenario.seed))


@compiled_within
def update(
    rig: RigNumbers,
    state: RigState,
    time: float,
    due: Due,
    shown: Observation,
    answer: SkillAnswer,
    noise: Array,
    bias: Array,
) -> RigState:
    """Returns the state after the updates that are due, each computed from the state before them.

    Args:
        rig: the rig.
        state: before; its ``q`` and ``v`` are changed.
        time: s.
        due: what is updated.
        shown: of this state.
        answer: of the skill to this observation, if the controller is due.
        noise: (12,), of the sensor, for this sample.
        bias: (6,), of the sensor.
    """
    control, dog, memory = state.control, state.dog, state.memory
    sensor, monitor, guard = state.sensor, state.monitor, state.guard
    drive, motor, axes, held, extent = state.drive, state.motor, state.axes, state.held, state.extent
    turned = np.zeros(3)  # of the shafts, from their start
    for k in range(rig.steppers):
        turned[k] = state.q[3 + k] - rig.start[1 + k]
    if due.control:
        if control.given_up == 0.0:
            control = act(rig, state, shown, answer)
        shafts = np.zeros((rig.steppers, 2))
        for k in range(rig.steppers):
            assign(shafts[k], shaft_angles(rig.axis, state.axes[k], turned[k]))
        faults = np.array((state.monitor[sensor_monitor.FAULT], state.drive[drive_monitor.FAULT]))
        dog = watchdog_step(rig.retract, state.dog, faults, False, shafts)
        memory = answer.memory
    if due.sensor:
        load = state.held.copy()
        load[2] -= rig.weight
        sensor = wrench_sensor_step(rig.sensor, state.sensor, load, bias, noise)
        monitor = sensor_monitor_step(rig.readings, state.monitor, shown.reading, shown.depth, time)
        guard = force_guard_step(
            rig.guard,
            rig.stopping,
            state.guard,
            shown.wrench,
            shown.sound,
            passed_command(rig.retract, watchdog.PITCH_RATE, state.dog, control.pitch_rate),
            passed_command(rig.retract, watchdog.YAW_RATE, state.dog, control.yaw_rate),
            passed_command(rig.retract, watchdog.CLOCKING_RATE, state.dog, control.clocking_rate),
            passed_command(rig.retract, watchdog.FEED, state.dog, control.feed_speed),
            passed_command(rig.retract, watchdog.UNWINDING, state.dog, control.unwinding) > 0.0,
            is_blind(state.dog),
        )
    if due.plant:
        command, current = state.guard[FEED_SPEED], state.motor[dc_motor.CURRENT]
        travel = counted_travel(rig.drive, state.q[0])
        drive = drive_monitor_step(rig.feed, state.drive, command, shown.wrench, shown.sound, current, travel)
        motor = dc_motor_step(rig.drive, state.motor, command, state.v[0], is_enabled(state.drive))
        axes = state.axes.copy()
        for k in range(rig.steppers):
            assign(axes[k], stepper_step(rig.axis, state.axes[k], state.guard[PITCH + k], turned[k]))
        held, found, _, forces = advance_rig(
            rig.bodies,
            rig.mechanics,
            state.q,
            state.v,
            shown.force,
            shown.equilibrium,
            rig.plant_period / STEPS,
            STEPS,
        )
        extent = 0.0
        for k in range(found):
            extent += forces[k]
    return RigState(
        q=state.q,
        v=state.v,
        held=held,
        extent=extent,
        sensor=sensor,
        monitor=monitor,
        drive=drive,
        dog=dog,
        guard=guard,
        motor=motor,
        axes=axes,
        memory=memory,
        control=control,
    )


@compiled
def perform(rig: RigNumbers, skill: SkillNumbers, state: RigState, noise: Array, bias: Array) -> Trace:
    """Performs a trial.

    Args:
        rig: the rig.
        skill: that acts.
        state: `first_state`.
        noise: (ticks, 12), of the sensor.
        bias: (6,), of the sensor.
    """
    limit = rig.time_limit
    M, N = 3 + int(limit / rig.control_period), 3 + int(limit / rig.plant_period)
    record = Record(
        rows=np.zeros(M, ROW),
        seen=np.zeros(M, np.int64),
        contacts=np.zeros((M, MAX_JOINED, JOINED_SIZE)),
        tips=np.zeros((N, 3)),
        wrenches=np.zeros((N, 6)),
        tally=np.zeros(1, TALLY),
    )
    tally = record.tally[0]
    tally["last_step"] = -1
    periods = np.array((rig.sensor_period, rig.plant_period, rig.control_period))
    ticks = np.zeros(3, np.int64)
    time, measured = 0.0, np.zeros(7)
    while True:
        shown = observe(rig, state)
        due = Due(time == ticks[0] * periods[0], time == ticks[1] * periods[1], time == ticks[2] * periods[2])
        logs = time == tally["rows"] * rig.control_period
        if logs or due.control:
            assign(measured, shown.wrench)
            measured[6] = -shown.sound
            answer = skill_step(skill, state.memory, measured)
        if logs:
            log(record.rows[tally["rows"]], rig, state, time, shown, answer)
            tally["rows"] += 1
        ending = judge(rig, state, time, shown, record)
        acts = due.control and state.control.given_up == 0.0
        if ending == GOES_ON and time < limit and acts and not is_finite(answer):
            ending = FAILED
        if ending != GOES_ON or time >= limit:
            break
        state = update(rig, state, time, due, shown, answer, noise[ticks[0]], bias)
        ticks[0], ticks[1], ticks[2] = ticks[0] + due.sensor, ticks[1] + due.plant, ticks[2] + due.control
        time = min(ticks[0] * periods[0], ticks[1] * periods[1], ticks[2] * periods[2])
        time = min(time, tally["rows"] * rig.control_period, limit)
    filled = Record(
        rows=record.rows[: tally["rows"]],
        seen=record.seen[: tally["looks"]],
        contacts=record.contacts[: tally["looks"]],
        tips=record.tips[: tally["steps"]],
        wrenches=record.wrenches[: tally["steps"]],
        tally=record.tally,
    )
    return Trace(filled, TIME_OVER if ending == GOES_ON else ending, time, state)
