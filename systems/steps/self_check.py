"""The self-check of the sensor: its readings in free air, and in contact against what the drives carry."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from models.hardware import GRAVITY, DcMotorParameters, StepperMotorParameters, WrenchSensorParameters
from skill.arrays import Array
from skill.compiled import compiled
from systems.steps.dc_motor import Drive, carriage_force
from systems.steps.faults import STICKS, Fault, reading_deviation

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario

SIGMAS = 6.0  # a bias or drift beyond so many standard deviations of the data sheet is a fault
NOISE_FACTOR = 5.0  # noise beyond so many times that of the data sheet is a fault
TARE_SAMPLES = 5  # of one tare
SETTLING = 5.0  # time constants of the sensor's low-pass before its reading counts as settled
AVERAGING = 0.050  # in units of s; time constant of the averages that are compared
GAIN_ERROR = 0.3  # largest relative error between sensor and drives: efficiency of the screw, holding torque
TOUCH_FORCE = 2.0  # in units of N, lateral, from which a touch is judged
TOUCH_MOMENT = 0.010  # in units of N m, wrong moment at the first touch; drift and noise after the tare are 2e-3
TOUCH_TIME = 0.1  # in units of s, of contact, before a second contact joins the first
CROSSED_TIME = 0.030  # in units of s, for which force and moment must contradict each other
FLAT = 0.8  # axial over lateral force; beyond it the tip may stand on an edge and carry a moment of either sign
RESTING = 0.030  # in units of s; the ringing of a stepper (61 Hz, damping 0.58) is over after this time
PATIENCE = 0.040  # in units of s, for which the steppers must contradict the sensor, beyond the sensor's delay


class MovingParts(NamedTuple):
    """What the drives move.

    Attributes:
        mass: of carriage, mount and peg, kg.
        peg_mass: of the peg below the sensor, kg.
        friction: viscous friction of the carriage, N s/m.
        pivot_error: largest distance of the gimbal's axes from the plane of the mouth, m.
        rim: largest height of the hole's rim above the mouth's centre when the hole is tilted, m.
        touch_depth: largest depth at which the tip's edge is at the chamfer of a tilted hole, m. It is minus infinity
            for a part that is not round: that may have two contacts from the first touch on.
        turn: sine of the largest turn of an axis.
        top_speed: largest speed command, m/s.
    """

    mass: float
    peg_mass: float
    friction: float
    pivot_error: float
    rim: float
    touch_depth: float
    turn: float
    top_speed: float

    @classmethod
    def of(cls, scenario: Scenario, *, mass: float, peg_weight: float) -> Self:
        """Returns the moving parts of a resolved scenario.

        Args:
            scenario: resolved.
            mass: of carriage, mount and peg, kg.
            peg_weight: N.
        """
        g, p = scenario.geometry, scenario.controller
        turn = math.sin(p.max_turn)
        rim = g.assembly.mouth_reach * turn
        return cls(
            mass=mass,
            peg_mass=peg_weight / GRAVITY,
            friction=scenario.rig.carriage_friction,
            pivot_error=max(scenario.rig.pivot_range, scenario.rig.demonstrated_pivot_range),
            rim=rim,
            touch_depth=rim + g.chamfer if g.is_round else -math.inf,
            turn=turn,
            top_speed=p.max_feed_speed,
        )


# Places in the state; READING, SUM and SQUARES are the first of six.
FAULT = 0  # first fault found
FREE = 1  # time in free air, s
COUNT = 2  # samples of the present tare
TOUCHED = 3  # time in contact, s
CROSSED = 4  # time for which force and moment have contradicted each other, s
COMMANDED = 5  # last commanded angles of the steppers, rad
REST = 8  # times since they changed, s
CONTRADICTED = 11  # times for which the axes have contradicted the sensor, s
READING = 14  # last wrench of the tare
SUM = 20  # sum of the wrenches of the present tare
SQUARES = 26  # sum of their squared differences
TARED = 32  # whether there has been a tare
TARE = 33  # mean moments about x and y of the last tare, N m
SIZE = 35

# Places in the state of the feed drive, after its FAULT.
STARTED = 1  # whether there has been a sample
TRAVEL = 2  # last position of the carriage, m
SPEED = 3  # last speed of the carriage, m/s
LAGGED = 4  # axial contact force by the drive, delayed like the sensor, N
CARRIED = 5  # its average, N
READ = 6  # average of the axial force by the sensor, N
FEED_SIZE = 7

PERIOD_STEPS = 4  # periods of the drive in a period of the checks that do not need its current


class CheckLimits(NamedTuple):
    """What a sound sensor keeps.

    Attributes:
        period, drive_period: of the checks, and of that against the feed drive, s.
        delay: of the sensor, s.
        settling: time after which its reading counts as settled, s.
        average, follow_lag: parts of a step that the averages, and a reading, follow in a drive period.
        max_square: (6,), mean square of the difference of two readings, N^2 and N^2 m^2.
        bias, drift: (6,), of a mean reading at the start, N and N m, and after 1 s.
        axial_bias, axial_drift: the same of the axial force against the feed drive, N.
        dry_friction: of the feed, N.
        torque_bias: of a moment against a stepper, N m.
        sticking_torque: of a stepper that lags by almost half a step, N m.
        touch_moment, untared_moment: moment of a wrong sign at the first touch, with and without a tare, N m.
        rim, touch_depth, turn, pivot_error: see `MovingParts`.
        stiffness: of a stepper, N m/rad.
        inertia, mass, friction: of the moving parts, with and without the rotor, kg, and of the carriage, N s/m.
        drive: of the feed.
    """

    period: float
    drive_period: float
    delay: float
    settling: float
    average: float
    follow_lag: float
    max_square: Array
    bias: Array
    drift: Array
    axial_bias: float
    axial_drift: float
    dry_friction: float
    torque_bias: float
    sticking_torque: float
    touch_moment: float
    untared_moment: float
    rim: float
    touch_depth: float
    turn: float
    pivot_error: float
    stiffness: float
    inertia: float
    mass: float
    friction: float
    drive: Drive

    @classmethod
    def of(
        cls,
        *,
        sensor: WrenchSensorParameters,
        motor: DcMotorParameters,
        stepper: StepperMotorParameters,
        parts: MovingParts,
        drive_period: float,
    ) -> Self:
        """Returns the limits; ``drive_period`` is that of the feed drive, s."""
        period, dry_friction = PERIOD_STEPS * drive_period, motor.ratio * motor.coulomb_friction
        # A reading is half a sample old on average.
        lag = sensor.delay + 0.5 * sensor.period + sensor.time_constant
        force, moment = reading_deviation(sensor)
        max_square = 2.0 * np.repeat([NOISE_FACTOR * force, NOISE_FACTOR * moment], 3) ** 2
        # The drive accelerates the peg below the sensor, at most from one direction to the other.
        max_square[2] += (2.0 * parts.peg_mass * motor.acceleration(parts.mass)) ** 2
        lever = sensor.height
        bias = SIGMAS * np.repeat([sensor.force_bias, math.hypot(sensor.torque_bias, lever * sensor.force_bias)], 3)
        bias += np.repeat([force, moment], 3)
        # A tare lasts for TARE_SAMPLES periods, in which the speed of the peg may change from full to reverse.
        bias[2] += 2.0 * parts.peg_mass * parts.top_speed / (TARE_SAMPLES * period)
        drift = SIGMAS * np.repeat([sensor.force_drift, math.hypot(sensor.torque_drift, lever * sensor.force_drift)], 3)
        touch_moment = max(TOUCH_MOMENT, sensor.torque_quantum + lever * sensor.force_quantum)
        return cls(
            period=period,
            drive_period=drive_period,
            delay=sensor.delay,
            settling=sensor.delay + SETTLING * sensor.time_constant,
            average=1.0 - math.exp(-drive_period / AVERAGING),
            follow_lag=1.0 - math.exp(-drive_period / lag),
            max_square=max_square,
            bias=bias,
            drift=drift,
            axial_bias=2.0 * dry_friction + float(bias[2]),
            axial_drift=float(drift[2]),
            dry_friction=dry_friction,
            torque_bias=stepper.stiffness * stepper.encoder_resolution + float(bias[3]),
            # A smaller lag than half a step may be that of a small load.
            sticking_torque=0.45 * stepper.stiffness * stepper.step_angle,
            touch_moment=touch_moment,
            untared_moment=touch_moment + float(bias[3]),
            rim=parts.rim,
            touch_depth=parts.touch_depth,
            turn=parts.turn,
            pivot_error=parts.pivot_error,
            stiffness=stepper.stiffness,
            inertia=parts.mass + motor.reflected_mass,
            mass=parts.mass,
            friction=parts.friction,
            drive=Drive.of(motor, period=drive_period),
        )


@compiled
def self_check_step(p: CheckLimits, state: Array, wrench: Array, depth: float, shafts: Array, time: float) -> Array:
    """Returns the next state (SIZE,): the first fault stays.

    *Tare.* While the tip is above the rim of the hole, the mean of `TARE_SAMPLES` readings must be within `SIGMAS` of
    the bias and drift of the data sheet, else the sensor is biased; the differences of successive readings must have
    at most `NOISE_FACTOR` times its noise, else it is too noisy.

    *First touch.* One contact with the chamfer at the place c carries the force f and the moment m = c x f. It pushes
    the peg inward, so that the lateral parts satisfy m_y f_x - m_x f_y > 0. If the opposite holds for `CROSSED_TIME` of
    the first `TOUCH_TIME` of contact, axes are swapped or have a wrong sign. A peg that is not round, or that first
    touches deeper in the hole, may have two contacts at once, and is not judged.

    *Steppers.* A stepper that rests is a magnetic spring: its encoder shows the torque K (commanded - measured angle),
    which holds the moment of the contact about the axis, m_x + d f_y about pitch and m_y - d f_x about yaw, at the
    depth d. They must agree within the unknown height of the axes, the part of m_z that pitch turns into the axis of
    yaw, the resolution and `GAIN_ERROR`; that of a clocking stage holds m_z, within the part of the others that pitch
    and yaw turn into its axis. Else the sensor is wrong; or, if the stepper lags by half a step and the
    sensor shows half of that torque or less, the stepper sticks.

    Args:
        p: limits.
        state: (SIZE,), after the last period.
        wrench: (6,), measured wrench about the tip in P, N and N m.
        depth: measured depth, m.
        shafts: (n, 2), [commanded, measured] angle of each stepper, rad.
        time: s.
    """
    found = state.copy()
    if state[FAULT] != 0.0:
        return found
    fault = _tare(p, found, wrench, depth, time)
    if fault == 0:
        fault = _one_contact(p, found, wrench, depth)
    lateral = math.hypot(wrench[0], wrench[1])
    about_x, about_y, about_z = wrench[3] + depth * wrench[1], wrench[4] - depth * wrench[0], wrench[5]
    if fault == 0:
        fault = _against_stepper(p, found, 0, shafts[0], lateral, about_x, 0.0)
    if fault == 0:
        fault = _against_stepper(p, found, 1, shafts[1], lateral, about_y, p.turn * abs(about_z))
    if fault == 0 and len(shafts) > 2:
        hidden = math.sqrt(2.0) * p.turn * math.hypot(about_x, about_y)
        fault = _against_stepper(p, found, 2, shafts[2], lateral, about_z, hidden)
    found[FAULT] = fault
    return found


@compiled
def feed_check_step(
    p: CheckLimits, state: Array, reading: float, current: float, travel: float, time: float, in_free_air: bool
) -> Array:
    """Returns the next state (FEED_SIZE,) of the check against the feed drive: the first fault stays.

    The drive gives a second measurement of the axial contact force, that of `axial_force`. Both forces are averaged
    over `AVERAGING`, that of the drive with the sensor's delay. They must agree within twice the dry friction N tau_c,
    the bias and `GAIN_ERROR`. Else the sign of the sensor is wrong, it reads too little (or too late), or too much. A
    blocked feed also shows a force that the sensor does not read; only in free air is it told from the sensor, as a
    stalled motor.

    Args:
        p: limits.
        state: (FEED_SIZE,), after the last period of the drive.
        reading: measured axial force, N.
        current: of the drive, A.
        travel: of the encoder on the motor's shaft, m.
        time: s.
        in_free_air: whether the tip is above the rim.
    """
    found = state.copy()
    if state[FAULT] != 0.0:
        return found
    found[TRAVEL], found[STARTED] = travel, 1.0
    if state[STARTED] == 0.0:
        return found
    speed = (travel - state[TRAVEL]) / p.drive_period
    force = axial_force(p, current, speed, (speed - state[SPEED]) / p.drive_period)
    found[SPEED] = speed
    found[LAGGED] += p.follow_lag * (force - state[LAGGED])
    found[CARRIED] += p.average * (found[LAGGED] - state[CARRIED])
    found[READ] += p.average * (reading - state[READ])
    carried, read = found[CARRIED], found[READ]
    if time < p.settling + 2.0 * AVERAGING:  # the drive takes up the weight
        return found
    bound = p.axial_bias + p.axial_drift * math.sqrt(time) + GAIN_ERROR * max(abs(read), abs(carried))
    if abs(read - carried) <= bound:
        return found
    if read * carried < 0.0 and min(abs(read), abs(carried)) > p.dry_friction:
        found[FAULT] = Fault.SENSOR_REVERSED.value
    elif abs(read) > abs(carried):
        found[FAULT] = Fault.SENSOR_HIGH.value
    elif in_free_air:
        found[FAULT] = Fault.MOTOR_STALLED.value
    else:
        found[FAULT] = Fault.SENSOR_LOW.value
    return found


@compiled
def axial_force(p: CheckLimits, current: float, speed: float, acceleration: float) -> float:
    """Returns the axial contact force (N) that the feed drive carries, from the momentum of the moving parts.

    f = (m + J N^2) dv/dt + m g + c v - N (eta k_t i - b w - tau_c tanh(w/w_0)), with w = N v.

    Args:
        p: limits.
        current: i, A.
        speed: v of the shaft's encoder, m/s.
        acceleration: m/s^2.
    """
    drive = carriage_force(p.drive, current, speed)
    return p.inertia * acceleration + p.mass * GRAVITY + p.friction * speed - drive


@compiled
def _tare(p: CheckLimits, state: Array, wrench: Array, depth: float, time: float) -> int:
    """Judges the readings in free air; changes ``state``, as do those that follow."""
    if depth > -p.rim:
        state[FREE] = state[COUNT] = 0.0
        return 0
    state[FREE] += p.period
    if state[FREE] <= p.settling:
        return 0
    for i in range(6):
        first = state[COUNT] == 0.0
        state[SQUARES + i] = 0.0 if first else state[SQUARES + i] + (wrench[i] - state[READING + i]) ** 2
        state[SUM + i] = wrench[i] if first else state[SUM + i] + wrench[i]
        state[READING + i] = wrench[i]
    state[COUNT] += 1.0
    if state[COUNT] < TARE_SAMPLES:
        return 0
    state[COUNT], state[TARED] = 0.0, 1.0
    state[TARE], state[TARE + 1] = state[SUM + 3] / TARE_SAMPLES, state[SUM + 4] / TARE_SAMPLES
    for i in range(6):
        if state[SQUARES + i] > (TARE_SAMPLES - 1) * p.max_square[i]:
            return Fault.SENSOR_NOISY.value
    for i in range(6):
        if abs(state[SUM + i]) > TARE_SAMPLES * (p.bias[i] + p.drift[i] * math.sqrt(time)):
            return Fault.SENSOR_BIASED.value
    return 0


@compiled
def _one_contact(p: CheckLimits, state: Array, wrench: Array, depth: float) -> int:
    """Compares lateral force and moment at the first touch, where one contact carries both."""
    fx, fy, fz, mx, my = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4]
    force = math.hypot(fx, fy)
    if force < TOUCH_FORCE or state[TOUCHED] > TOUCH_TIME:
        return 0
    state[TOUCHED] += p.period
    if depth > p.touch_depth:
        return 0
    outward = (mx - state[TARE]) * fy - (my - state[TARE + 1]) * fx
    limit = p.touch_moment if state[TARED] != 0.0 else p.untared_moment
    crossed = abs(fz) < FLAT * force and outward > force * limit
    state[CROSSED] = state[CROSSED] + p.period if crossed else 0.0
    return Fault.SENSOR_CROSSED.value if state[CROSSED] > CROSSED_TIME else 0


@compiled
def _against_stepper(
    p: CheckLimits, state: Array, axis: int, shaft: Array, lateral: float, moment: float, hidden: float
) -> int:
    """Compares the moment about an axis, of which a part may be hidden, with the torque of its stepper."""
    commanded = shaft[0]
    state[REST + axis] = 0.0 if commanded != state[COMMANDED + axis] else state[REST + axis] + p.period
    state[COMMANDED + axis] = commanded
    if state[REST + axis] < RESTING + p.delay:
        state[CONTRADICTED + axis] = 0.0
        return 0
    torque = p.stiffness * (commanded - shaft[1])
    bound = p.torque_bias + p.pivot_error * lateral + hidden + GAIN_ERROR * max(abs(torque), abs(moment))
    contradicted = abs(torque - moment) > bound
    state[CONTRADICTED + axis] = state[CONTRADICTED + axis] + p.period if contradicted else 0.0
    if state[CONTRADICTED + axis] <= PATIENCE + p.delay:
        return 0
    if abs(torque) > p.sticking_torque and abs(moment) < 0.5 * abs(torque):
        return STICKS[axis]
    return Fault.SENSOR_MOMENT.value
