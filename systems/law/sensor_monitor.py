"""The sensor monitor: what it makes of one reading of the sensors."""

from __future__ import annotations

import math
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from compiled import compiled
from models.arm import RIG
from models.hardware import STEEL, WrenchSensorParameters
from skill.arrays import Array, assign
from systems.law.faults import Fault
from systems.law.part import Part

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario

MAX_SPIKES = 2
"""Number of spikes within `SPIKE_TIME` that a sound sensor may have."""

SPIKE_TIME = 1.0  # in units of s
DEVIATIONS = 12.0  # largest difference of two readings of a sound sensor at rest, in standard deviations

TARE_TIME, TARE_SAMPLES = 0.040, 5
"""A tare averages readings for so long, s, and at least so many of them."""

SIGMAS = 6.0  # a mean in free air beyond so many standard deviations of bias and drift is a fault
NOISE_FACTOR = 5.0  # noise in free air beyond so many times that of the data sheet is a fault
SETTLING = 5.0  # time constants of the sensor's low-pass before its reading counts as settled

# Places in the state; the first six are the last sound wrench (N, N m), SUM and SQUARES the first of six.
DEPTH = 6  # last sound depth, m
REPEATS = 7  # how many readings in a row equalled the one before
FAULT = 8  # first fault found
STARTED = 9  # whether there has been a sound sample
SPIKES = 10  # number of spikes, which fades with `SPIKE_TIME`
FREE = 11  # readings in free air, to the end of a tare
SUM = 12  # of the wrenches of the present tare
SQUARES = 18  # sum of the squares of their differences
SIZE = 24


FALSE_ALARM = 1e-9
"""Probability that a healthy sensor repeats its reading often enough to count as stuck."""


def repeats_of_a_stuck_sensor(p: WrenchSensorParameters) -> float:
    """Returns how many identical readings in a row a healthy sensor may give; infinite for a sensor without noise.

    A channel with noise sigma and quantum q repeats its reading with probability at most erf(q / (2 sqrt(2) sigma)),
    which holds when the true value is in the middle of a quantum. The noise of channels and samples is independent.
    """
    sigmas = [*p.force_noise, *p.torque_noise]
    quanta = [p.force_quantum] * 3 + [p.torque_quantum] * 3
    repeat = math.prod(
        math.erf(q / (2.0 * math.sqrt(2.0) * sigma)) if sigma > 0 else 1.0
        for sigma, q in zip(sigmas, quanta, strict=True)
    )
    return math.ceil(math.log(FALSE_ALARM) / math.log(repeat)) if repeat < 1.0 else math.inf


def reading_deviation(p: WrenchSensorParameters) -> tuple[float, float]:
    """Returns an upper bound of the standard deviation of a force (N) and of a moment about the tip (N m) at rest.

    Rounding to a quantum q adds at most q / 2; a force at the mount has the lever ``height`` about the tip.
    """
    force = math.hypot(max(p.force_noise), 0.5 * p.force_quantum)
    torque = math.hypot(max(p.torque_noise), 0.5 * p.torque_quantum)
    return force, math.hypot(torque, p.height * force)


class SensorLimits(NamedTuple):
    """What sound readings keep.

    Attributes:
        height: of the sensor above the tip, m.
        ends: (6,), of the sensor's range, at the mount, N and N m.
        max_repeats: identical readings in a row.
        first_comparison: time from which readings are compared, s.
        max_change: of the depth between two readings, m.
        max_force, max_moment: difference of two readings, N and N m.
        fading: factor of the number of spikes in a period.
        free_depth: at which and above which the peg is in free air, m; minus infinity if that is not known.
        settling, tare: readings in free air before a tare, and in a tare.
        bias, drift: (6,), of the mean reading of a tare at the start, N and N m, and after 1 s.
        max_square: (6,), mean square of the difference of two readings in free air, N^2 and N^2 m^2.
    """

    height: float
    ends: Array
    max_repeats: float
    first_comparison: float
    max_change: float
    max_force: float
    max_moment: float
    fading: float
    free_depth: float
    settling: float
    tare: float
    bias: Array
    drift: Array
    max_square: Array

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the limits of a resolved scenario; only the rig tells by its depth when the peg is in free air."""
        sensor, g, controller, feed = scenario.sensor, scenario.geometry, scenario.controller, scenario.feed
        load_limit, peg_mass = controller.guard.force_limit, STEEL * g.assembly.volume
        depth_period = max(sensor.period, scenario.contact.time_step)  # between two changes of the depth
        rim = g.assembly.mouth_reach * math.sin(controller.max_turn)  # of the tilted hole above the centre of its mouth
        tare = max(TARE_SAMPLES, round(TARE_TIME / sensor.period))
        quantum = np.repeat([sensor.force_quantum, sensor.torque_quantum], 3)
        force, torque = reading_deviation(sensor)
        deviation, lever = np.repeat([force, torque], 3), sensor.height
        bias = np.repeat([sensor.force_bias, math.hypot(sensor.torque_bias, lever * sensor.force_bias)], 3)
        drift = np.repeat([sensor.force_drift, math.hypot(sensor.torque_drift, lever * sensor.force_drift)], 3)
        # The drive accelerates the peg below the sensor: in a tare, and between two readings, from full to reverse.
        inertia, jolt = np.zeros(6), np.zeros(6)
        inertia[2] = 2.0 * peg_mass * controller.max_feed_speed / (tare * sensor.period)
        jolt[2] = 2.0 * peg_mass * feed.acceleration(peg_mass)
        return cls(
            height=sensor.height,
            ends=np.array([*sensor.force_range, *sensor.torque_range]) - 0.5 * quantum,
            max_repeats=float(repeats_of_a_stuck_sensor(sensor)),
            # The first reading arrives one period after the delay; it is compared with the second one.
            first_comparison=sensor.delay + 1.5 * sensor.period,
            max_change=feed.no_load_speed * depth_period + scenario.rig.encoder_resolution,
            max_force=sensor.blend * 2.0 * load_limit + DEVIATIONS * force,
            # Two opposite forces, one on either side of the outline.
            max_moment=sensor.blend * 2.0 * load_limit * 2.0 * g.reach + DEVIATIONS * torque,
            fading=math.exp(-sensor.period / SPIKE_TIME),
            free_depth=-rim if scenario.carrier == RIG else -math.inf,
            settling=float(math.ceil((sensor.delay + SETTLING * sensor.time_constant) / sensor.period)),
            tare=float(tare),
            bias=SIGMAS * bias + deviation + inertia,
            drift=SIGMAS * drift,
            max_square=2.0 * (NOISE_FACTOR * deviation) ** 2 + jolt**2,
        )


@compiled
def sensor_monitor_step(p: SensorLimits, state: Array, wrench: Array, depth: float, time: float) -> Array:
    """Returns the next state (SIZE,): the first fault of wrench and depth stays.

    * A wrench or depth that is not finite is disconnected.
    * A channel of the sensor at the end of its range is saturated.
    * Six readings that repeat themselves more often than their noise allows are stuck (`repeats_of_a_stuck_sensor`);
      the zeros before the first reading has passed the sensor's delay do not count.
    * A depth that has changed faster than the feed can move has jumped.
    * At most `MAX_SPIKES` readings within `SPIKE_TIME` are spikes. A spike differs from the last sound reading by more
      than the sensor's low-pass passes within one period when the load changes by twice the load limit, and by more
      than the noise.
    * In free air the mean of the readings of a tare must be within `SIGMAS` of the bias and drift of the data sheet,
      else the sensor is biased; their differences must have at most `NOISE_FACTOR` times its noise, else it is noisy.

    Args:
        p: limits.
        state: (SIZE,), after the last period.
        wrench: (6,), reading, about the tip in P, N and N m.
        depth: reading, m.
        time: s.
    """
    found = state.copy()
    if state[FAULT] != 0.0:
        return found
    same = state[STARTED] != 0.0 and time > p.first_comparison
    for i in range(6):
        same = same and wrench[i] == state[i]
    repeats = state[REPEATS] + 1.0 if same else 0.0
    spike = state[STARTED] > 0.0 and is_spike(p, wrench, state)
    spikes = state[SPIKES] * p.fading + (1.0 if spike else 0.0)
    fault = _fault(p, state, wrench, depth, repeats, spikes)
    if fault != 0:
        found[FAULT] = fault
        return found
    if not spike:
        assign(found, wrench)
    found[DEPTH], found[REPEATS], found[STARTED], found[SPIKES] = depth, repeats, 1.0, spikes
    found[FAULT] = _fault_in_free_air(p, found, state, time)
    return found


@compiled
def sound_wrench(p: SensorLimits, state: Array, wrench: Array) -> Array:
    """Returns the wrench (6,) that is passed on: a reading, or the last sound one after a fault or in its place."""
    if state[FAULT] == 0.0 and _is_finite(wrench) and not (state[STARTED] != 0.0 and is_spike(p, wrench, state)):
        return wrench.copy()
    return state[:6].copy()


@compiled
def sound_depth(state: Array, depth: float) -> float:
    """Returns the depth that is passed on; see `sound_wrench`."""
    return depth if state[FAULT] == 0.0 and math.isfinite(depth) else state[DEPTH]


@compiled
def _is_finite(wrench: Array) -> bool:
    total = 0.0
    for i in range(6):
        total += wrench[i]
    return math.isfinite(total)


@compiled
def _fault(p: SensorLimits, state: Array, wrench: Array, depth: float, repeats: float, spikes: float) -> int:
    if not _is_finite(wrench):
        return Fault.SENSOR_DISCONNECTED.value
    if not math.isfinite(depth):
        return Fault.ENCODER_DISCONNECTED.value
    if _is_saturated(p, wrench):
        return Fault.SENSOR_SATURATED.value
    if repeats > p.max_repeats:
        return Fault.SENSOR_STUCK.value
    if spikes > MAX_SPIKES:
        return Fault.SENSOR_SPIKES.value
    if abs(depth - state[DEPTH]) > p.max_change and state[STARTED] != 0.0:
        return Fault.ENCODER_JUMPED.value
    return 0


@compiled
def _fault_in_free_air(p: SensorLimits, found: Array, before: Array, time: float) -> int:
    """Adds the new reading in ``found`` to the tare, and judges the tare at its end."""
    if found[DEPTH] > p.free_depth:
        for i in range(FREE, SIZE):
            found[i] = 0.0
        return 0
    found[FREE] += 1.0
    if found[FREE] <= p.settling:
        return 0
    ends, noisy, biased = found[FREE] >= p.settling + p.tare, False, False
    for i in range(6):
        found[SUM + i] += found[i]
        found[SQUARES + i] += (found[i] - before[i]) ** 2
        if ends:
            noisy = noisy or found[SQUARES + i] > p.tare * p.max_square[i]
            biased = biased or abs(found[SUM + i]) > p.tare * (p.bias[i] + p.drift[i] * math.sqrt(time))
            found[SUM + i] = found[SQUARES + i] = 0.0
    if ends:
        found[FREE] = p.settling
    if noisy:
        return Fault.SENSOR_NOISY.value
    return Fault.SENSOR_BIASED.value if biased else 0


@compiled
def is_spike(p: SensorLimits, wrench: Array, state: Array) -> bool:
    """Returns whether a channel differs from the last sound one by more than a load can change it; not for a NaN."""
    found = False
    for i in range(6):
        found = found or abs(wrench[i] - state[i]) > (p.max_force if i < 3 else p.max_moment)
    return bool(found)


@compiled
def _is_saturated(p: SensorLimits, wrench: Array) -> bool:
    """Whether a channel is at the end of its range, which applies to the reading at the mount."""
    ends, h = p.ends, p.height
    return bool(
        abs(wrench[0]) >= ends[0]
        or abs(wrench[1]) >= ends[1]
        or abs(wrench[2]) >= ends[2]
        or abs(wrench[3] + h * wrench[1]) >= ends[3]
        or abs(wrench[4] - h * wrench[0]) >= ends[4]
        or abs(wrench[5]) >= ends[5]
    )


class SensorMonitor(Part):
    """
    .. pydrake_system::

        name: SensorMonitor
        input_ports:
        - raw_wrench
        - raw_depth
        output_ports:
        - wrench
        - depth
        - fault

    Checks every sample of the sensor by `sensor_monitor_step`. ``fault`` (`Fault`) is the first fault and stays. Sound
    measurements are passed on at once. After a fault, and instead of a spike, a NaN or an infinite value, the outputs
    hold the last sound measurement. The wrench (N, N m) is about the tip in P, the depth in m.

    Args:
        limits: what sound readings keep.
        period: of the sensor, s.
    """

    def __init__(self, *, limits: SensorLimits, period: float) -> None:
        step = partial(sensor_monitor_step, limits)
        super().__init__({"raw_wrench": 6, "raw_depth": 1}, state=np.zeros(SIZE), period=period, step=step, timed=True)
        self.declare_output("wrench", 6, partial(sound_wrench, limits), "raw_wrench")
        self.declare_output("depth", 1, sound_depth, "raw_depth")
        self.declare_output("fault", 1, itemgetter(FAULT))
