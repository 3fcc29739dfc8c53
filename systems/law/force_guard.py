"""The force guard: what it permits in one period of the sensor."""

from __future__ import annotations

import math
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from pydrake.systems.framework import Context

from compiled import compiled
from skill.arrays import Array
from skill.features.measurement import load_of_components
from systems.law.part import Part

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario

PITCH, YAW, CLOCKING, FEED_SPEED, LOAD, SLOPE, LIGHT_PITCH, LIGHT_YAW, LIGHT_CLOCKING, PEAK, SIZE = range(11)
"""Places in the state: permitted angles (rad) and feed speed (m/s), load (N) and its slope (N/s) at the last sample,
the permitted angles at which the load was last at most F_soft (rad), and the largest load so far (N); and its size."""

SLOPE_TIME = 3e-3
"""Time constant of the low-pass of the slope, s; noise and quanta of the sensor then cause some 20 N/s."""


class StoppingModel(NamedTuple):
    """How fast the rig measures and stops, and the load of a contact that stops it.

    Attributes:
        period: time between two samples of the sensor, s.
        delay: time from a contact force to the motors' response to it, s.
        deceleration: deceleration of the feed at the current limit of its drive, m/s^2.
        feed_impact: measured load of a contact that stops the feed, per speed, N s/m.
        turn_impact: measured load of a contact that stops the hole, per turn rate, N s/rad.
    """

    period: float
    delay: float
    deceleration: float
    feed_impact: float
    turn_impact: float

    @classmethod
    def of(cls, scenario: Scenario, *, mass: float, inertia: float) -> Self:
        """Returns the model of a resolved scenario.

        A constant force with the impulse p and the duration h, a whole number of samples, raises the reading of the
        sensor, a low-pass with the time constant tau, by p/h (1 - e^{-h/tau}) <= p/T with T = max(h, tau). No contact
        of the simulation is shorter than its step, which is used for h: another step changes the guard too. With the
        mass m of the feed and its rotor, the inertia J, the stepper's damping d and stiffness K, the delay t and the
        reach r of the peg, the loads of a contact that stops the feed at the speed v and the hole at the rate w are

            F_v = m |v| / T,     F_w = (J/T + d + K t) |w| / r.

        The spring of a turning rotor leads by the damping torque d w; when the rotor is stopped, the contact carries
        it, and the driver goes on stepping for the time t. Not counted are the push of the feed drive after the stop,
        the rebound, the moment of a force at the rim of the tip, and the microstep.

        Args:
            scenario: resolved.
            mass: of the feed, without its rotor, kg.
            inertia: of the hole about a stepper's axis, with its rotor, kg m^2.
        """
        sensor, feed, stepper = scenario.sensor, scenario.feed, scenario.stepper
        delay = sensor.delay + sensor.time_constant + sensor.period + scenario.contact.time_step
        duration = max(sensor.time_constant, scenario.contact.time_step)
        torque = inertia / duration + stepper.damping + stepper.stiffness * delay
        return cls(
            period=sensor.period,
            delay=delay,
            deceleration=feed.acceleration(mass),
            feed_impact=(mass + feed.reflected_mass) / duration,
            turn_impact=torque / scenario.geometry.reach,
        )


class GuardLimits(NamedTuple):
    """What the guard keeps.

    Attributes:
        soft_force, hold_force, force_limit: see `models.control.ForceGuardParameters`.
        lever: of the moments in the load, the reach of the peg, m.
        max_turn_rate: rad/s.
        max_turn: on each axis, to either side of the start, rad.
        retract_speed: m/s.
        clocking: 1 where the hole can turn about its axis, else 0.
    """

    soft_force: float
    hold_force: float
    force_limit: float
    lever: float
    max_turn_rate: float
    max_turn: float
    retract_speed: float
    clocking: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the limits of a scenario."""
        p = scenario.controller
        return cls(
            p.guard.soft_force,
            p.guard.hold_force,
            p.guard.force_limit,
            scenario.geometry.reach,
            p.max_turn_rate,
            p.max_turn,
            p.back_off.retract_speed,
            float(scenario.rig.clocking_stage),
        )


@compiled
def force_guard_step(
    p: GuardLimits,
    stopping: StoppingModel,
    state: Array,
    wrench: Array,
    depth: float,
    pitch_rate: float,
    yaw_rate: float,
    clocking_rate: float,
    speed: float,
    unwinding: bool,
    blind: bool,
) -> Array:
    """Returns the next state (SIZE,).

    Let F be the load sqrt(|f|^2 + |m/r|^2) of the measured wrench and s its slope. The guard looks ahead by the time
    that a stop needs,

        F' = F + max(s, 0) (t + |v|/a),

    with the delay t, the feed speed v and the deceleration a of `StoppingModel`.

    * What can raise the load is reduced, the feed before the turns: a correction under load then goes on while the peg
      waits, and the two cannot hold each other at F_hold. With F_mid = (F_soft + F_hold)/2, a feed into the hole is
      multiplied by min(1, max(0, (F_mid - F') / (F_mid - F_soft))), and a turn of the hole by
      min(1, max(0, (F_hold - F') / (F_hold - F_mid))), except for its part with the contact moment about the pivot,
      which lowers the load. The pivot is taken to be at the mouth. A retraction that pulls a peg out of a grip is
      multiplied by (F_limit - F') / (F_limit - F_hold) likewise.
    * A contact may stop feed and hole at any moment. Both factors are therefore at most (F_limit - F') / (F_v + F_w),
      with the impact loads of `StoppingModel.of` at the commanded speeds; F_v is 0 for a retraction. No commanded turn
      is faster than F_w = F_limit allows; this alone limits the part of a turn with the contact moment.
    * Above F_hold the guard yields: the hole turns with the contact moment, and the peg moves with the axial force,
      each in proportion to its share of the load. The speeds grow linearly, to ``max_turn_rate`` and ``retract_speed``
      at F_limit. Impact loads do not limit this motion.

    The permitted turn rates are integrated to angles, within ``max_turn_rate`` and ``max_turn``. While ``unwinding``,
    the hole turns back to the angles at which the load was last at most F_soft, and the commanded rates do not count.
    While ``blind``, the wrench is not known: the guard does not act on it, and permits a retraction only, like
    after a measurement that is not finite. While a command is not finite, none is permitted.

    Args:
        p: limits.
        stopping: how the rig stops.
        state: (SIZE,), after the last period.
        wrench: (6,), measured wrench on the peg about its tip, in P, N and N m.
        depth: measured depth of the tip, m.
        pitch_rate: commanded, of the hole, rad/s.
        yaw_rate: likewise.
        clocking_rate: likewise, about the axis of the hole.
        speed: commanded feed speed, m/s, negative into the hole.
        unwinding: see above.
        blind: see above.
    """
    T, lever = stopping.period, p.lever
    fx, fy, fz, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    if not math.isfinite(pitch_rate + yaw_rate + clocking_rate + speed):
        pitch_rate = yaw_rate = clocking_rate = speed = 0.0
        unwinding = False
    if blind or not math.isfinite(fx + fy + fz + mx + my + mz + depth):
        depth = 0.0
        fx = fy = fz = mx = my = mz = 0.0
        pitch_rate = yaw_rate = clocking_rate = 0.0
        unwinding = False
        speed = max(speed, 0.0)
    pitch, yaw, clocking = state[PITCH], state[YAW], state[CLOCKING]
    light_pitch, light_yaw, light_clocking = state[LIGHT_PITCH], state[LIGHT_YAW], state[LIGHT_CLOCKING]
    load = load_of_components(fx, fy, fz, mx, my, mz, lever)
    slope = state[SLOPE] + T / (SLOPE_TIME + T) * ((load - state[LOAD]) / T - state[SLOPE])
    ahead = load + max(slope, 0.0) * (stopping.delay + abs(state[FEED_SPEED]) / stopping.deceleration)
    middle = 0.5 * (p.soft_force + p.hold_force)
    feed_share = _share(ahead, p.soft_force, middle)
    turn_share = _share(ahead, middle, p.hold_force)
    give = 1.0 - _share(ahead, p.hold_force, p.force_limit)
    if load <= p.soft_force:
        light_pitch, light_yaw, light_clocking = pitch, yaw, clocking
    if unwinding:
        pitch_rate, yaw_rate = (light_pitch - pitch) / T, (light_yaw - yaw) / T
        clocking_rate = (light_clocking - clocking) / T
    clocking_rate *= p.clocking
    # Limited before it is scaled: the scale of a rate far above the limit would have no effect.
    largest_rate = min(p.max_turn_rate, p.force_limit / stopping.turn_impact)
    pitch_rate, yaw_rate, clocking_rate = _limited(pitch_rate, yaw_rate, clocking_rate, largest_rate)
    turning = math.hypot(math.hypot(pitch_rate, yaw_rate), clocking_rate)
    impact = stopping.turn_impact * turning + stopping.feed_impact * max(-speed, 0.0)
    if impact > 0.0:
        stoppable = max(0.0, p.force_limit - ahead) / impact
        feed_share, turn_share = min(feed_share, stoppable), min(turn_share, stoppable)
    # The moment of the peg on the hole about the centre of the mouth, where the pivot is but for its tolerance.
    moment_x, moment_y, moment_z = -(mx + depth * fy), -(my - depth * fx), -p.clocking * mz
    moment = math.hypot(math.hypot(moment_x, moment_y), moment_z)
    relief = 0.0
    if moment > 0.0:
        moment_x, moment_y, moment_z = moment_x / moment, moment_y / moment, moment_z / moment
        along = pitch_rate * moment_x + yaw_rate * moment_y + clocking_rate * moment_z
        relief = (1.0 - turn_share) * max(along, 0.0)
        relief += give * p.max_turn_rate * min(1.0, moment / lever / load)
    pitch_rate, yaw_rate, clocking_rate = _limited(
        turn_share * pitch_rate + relief * moment_x,
        turn_share * yaw_rate + relief * moment_y,
        turn_share * clocking_rate + relief * moment_z,
        p.max_turn_rate,
    )
    if speed < 0.0:
        speed *= feed_share
    elif fz < 0.0:
        speed *= 1.0 - give
    if load > 0.0:
        speed += give * p.retract_speed * fz / load
    found = np.empty(SIZE)
    found[PITCH] = min(max(pitch + T * pitch_rate, -p.max_turn), p.max_turn)
    found[YAW] = min(max(yaw + T * yaw_rate, -p.max_turn), p.max_turn)
    found[CLOCKING] = min(max(clocking + T * clocking_rate, -p.max_turn), p.max_turn)
    found[FEED_SPEED], found[LOAD], found[SLOPE] = speed, load, slope
    found[LIGHT_PITCH], found[LIGHT_YAW], found[LIGHT_CLOCKING] = light_pitch, light_yaw, light_clocking
    found[PEAK] = max(state[PEAK], load)
    return found


@compiled
def _share(load: float, start: float, end: float) -> float:
    """Returns 1 below a load, 0 above another, and linear values between them."""
    return min(1.0, max(0.0, (end - load) / (end - start)))


@compiled
def _limited(x: float, y: float, z: float, largest: float) -> tuple[float, float, float]:
    """Returns a vector with at most this norm, in the same direction."""
    size = math.hypot(math.hypot(x, y), z)
    return (x * largest / size, y * largest / size, z * largest / size) if size > largest else (x, y, z)


class ForceGuard(Part):
    """
    .. pydrake_system::

        name: ForceGuard
        input_ports:
        - wrench
        - depth
        - pitch_rate
        - yaw_rate
        - clocking_rate
        - feed_speed
        - unwinding
        - blind
        output_ports:
        - target_pitch
        - target_yaw
        - target_clocking
        - feed_speed

    The last system before the motors: every command passes through it, also that of a back-off and after a fault. What
    it permits is in `force_guard_step`. Rates are in rad/s, speeds in m/s, angles in rad relative to the start. The
    wrench (N, N m) acts on the peg about its tip, in P.
    """

    def __init__(self, *, limits: GuardLimits, stopping: StoppingModel) -> None:
        def step(
            state: Array,
            wrench: Array,
            depth: float,
            pitch_rate: float,
            yaw_rate: float,
            clocking_rate: float,
            speed: float,
            unwinding: float,
            blind: float,
        ) -> Array:
            rates = pitch_rate, yaw_rate, clocking_rate
            return force_guard_step(limits, stopping, state, wrench, depth, *rates, speed, unwinding > 0.0, blind > 0.0)

        commands = ("pitch_rate", "yaw_rate", "clocking_rate", "feed_speed", "unwinding", "blind")
        inputs = {"wrench": 6, "depth": 1, **dict.fromkeys(commands, 1)}
        super().__init__(inputs, state=np.zeros(SIZE), period=stopping.period, step=step)
        self.declare_output("target_pitch", 1, itemgetter(PITCH))
        self.declare_output("target_yaw", 1, itemgetter(YAW))
        self.declare_output("target_clocking", 1, itemgetter(CLOCKING))
        self.declare_output("feed_speed", 1, itemgetter(FEED_SPEED))

    def peak_load(self, context: Context) -> float:
        """Returns the largest measured load so far, N; ``context`` is this system's."""
        return float(self.values(context)[PEAK])
