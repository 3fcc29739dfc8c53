"""The force guard: at the rate of the sensor it limits the contact load, and every command passes through it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.control import ForceGuardParameters
from models.scenario import Scenario
from skill.features.measurement import load_of_components

PITCH, YAW, FEED_SPEED, LOAD, SLOPE, LIGHT_PITCH, LIGHT_YAW, PEAK = range(8)
"""Indices of the state: permitted angles (rad) and feed speed (m/s), load (N) and its slope (N/s) at the last sample,
the permitted angles at which the load was last at most F_soft (rad), and the largest load so far (N)."""

SLOPE_TIME = 3e-3
"""Time constant of the low-pass of the slope, s; noise and quanta of the sensor then cause some 20 N/s."""


@dataclass(frozen=True)
class StoppingModel:
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
        peg radius r, the loads of a contact that stops the feed at the speed v and the hole at the turn rate w are

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
            turn_impact=torque / scenario.geometry.peg_radius,
        )


class ForceGuard(LeafSystem):
    """
    .. pydrake_system::

        name: ForceGuard
        input_ports:
        - wrench
        - depth
        - pitch_rate
        - yaw_rate
        - feed_speed
        - unwinding
        - blind
        output_ports:
        - target_pitch
        - target_yaw
        - feed_speed

    The last system before the motors: every command passes through it, also that of a back-off and after a fault. Let F
    be the load sqrt(|f|^2 + |m/r|^2) of the measured wrench and s its slope. The guard looks ahead by the time that a
    stop needs,

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

    The guard integrates the permitted turn rates to angles, within ``max_turn_rate`` and ``max_turn``. While
    ``unwinding`` is 1, it turns the hole back to the angles at which the load was last at most F_soft, and the
    commanded rates do not count.

    While ``blind`` is 1, the wrench is not known: the guard does not act on it, and permits a retraction only.

    Rates are in rad/s, speeds in m/s, angles in rad relative to the start. The wrench (N, N m) acts on the peg about
    its tip, in P.
    """

    def __init__(
        self,
        *,
        parameters: ForceGuardParameters,
        stopping: StoppingModel,
        peg_radius: float,
        max_turn_rate: float,
        max_turn: float,
        retract_speed: float,
    ) -> None:
        super().__init__()
        self._parameters, self._radius = parameters, peg_radius
        self._max_turn_rate, self._max_turn, self._retract_speed = max_turn_rate, max_turn, retract_speed
        self._stopping = self.DeclareAbstractParameter(Value[object](stopping))
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._commands = [
            self.DeclareVectorInputPort(name, 1) for name in ("pitch_rate", "yaw_rate", "feed_speed", "unwinding")
        ]
        self._blind = self.DeclareVectorInputPort("blind", 1)
        self._state = self.DeclareDiscreteState(8)
        self.DeclarePeriodicDiscreteUpdateEvent(stopping.period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        for name, index in (("target_pitch", PITCH), ("target_yaw", YAW), ("feed_speed", FEED_SPEED)):
            self.DeclareVectorOutputPort(name, 1, self._reader(index), state)

    def stopping(self, context: Context) -> StoppingModel:
        """Returns how the rig stops; ``context`` is this system's."""
        model: StoppingModel = context.get_abstract_parameter(self._stopping).get_value()
        return model

    def set_stopping(self, context: Context, stopping: StoppingModel) -> None:
        """Replaces how the rig stops in ``context``, which is this system's; the period must be the same."""
        context.get_mutable_abstract_parameter(self._stopping).set_value(stopping)

    def peak_load(self, context: Context) -> float:
        """Returns the largest measured load so far, N; ``context`` is this system's."""
        return float(context.get_discrete_state(self._state)[PEAK])

    def _reader(self, index: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = context.get_discrete_state(self._state).value()[index]

        return calc

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        # Plain floats: this runs at 1 kHz, and NumPy is slower for so few numbers.
        p, stopping = self._parameters, self.stopping(context)
        T = stopping.period
        blind = self._blind.Eval(context)[0] > 0.0
        wrench = [0.0] * 6 if blind else self._wrench.Eval(context).tolist()
        fx, fy, fz, mx, my, _ = wrench
        depth = self._depth.Eval(context).tolist()[0]
        pitch_rate, yaw_rate, speed, unwinding = (float(port.Eval(context)[0]) for port in self._commands)
        pitch, yaw, old_speed, old_load, slope, light_pitch, light_yaw, peak = (
            context.get_discrete_state(self._state).value().tolist()
        )
        if blind:
            pitch_rate = yaw_rate = unwinding = 0.0
            speed = max(speed, 0.0)
        load = load_of_components(wrench, self._radius)
        slope += T / (SLOPE_TIME + T) * ((load - old_load) / T - slope)
        ahead = load + max(slope, 0.0) * (stopping.delay + abs(old_speed) / stopping.deceleration)
        middle = 0.5 * (p.soft_force + p.hold_force)
        feed_share = _share(ahead, p.soft_force, middle)
        turn_share = _share(ahead, middle, p.hold_force)
        give = 1.0 - _share(ahead, p.hold_force, p.force_limit)
        if load <= p.soft_force:
            light_pitch, light_yaw = pitch, yaw

        if unwinding:
            pitch_rate, yaw_rate = (light_pitch - pitch) / T, (light_yaw - yaw) / T
        # Limited before it is scaled: the scale of a rate far above the limit would have no effect.
        largest_rate = min(self._max_turn_rate, p.force_limit / stopping.turn_impact)
        pitch_rate, yaw_rate = _limited(pitch_rate, yaw_rate, largest_rate)
        impact = stopping.turn_impact * math.hypot(pitch_rate, yaw_rate) + stopping.feed_impact * max(-speed, 0.0)
        if impact > 0.0:
            stoppable = max(0.0, p.force_limit - ahead) / impact
            feed_share, turn_share = min(feed_share, stoppable), min(turn_share, stoppable)
        # The moment of the peg on the hole about the centre of the mouth, where the pivot is but for its tolerance.
        moment_x, moment_y = -(mx + depth * fy), -(my - depth * fx)
        moment = math.hypot(moment_x, moment_y)
        relief = 0.0
        if moment > 0.0:
            moment_x, moment_y = moment_x / moment, moment_y / moment
            relief = (1.0 - turn_share) * max(pitch_rate * moment_x + yaw_rate * moment_y, 0.0)
            relief += give * self._max_turn_rate * min(1.0, moment / self._radius / load)
        pitch_rate, yaw_rate = _limited(
            turn_share * pitch_rate + relief * moment_x, turn_share * yaw_rate + relief * moment_y, self._max_turn_rate
        )
        if speed < 0.0:
            speed *= feed_share
        elif fz < 0.0:
            speed *= 1.0 - give
        if load > 0.0:
            speed += give * self._retract_speed * fz / load
        discrete_state.get_mutable_vector(self._state).SetFromVector(
            [
                min(max(pitch + T * pitch_rate, -self._max_turn), self._max_turn),
                min(max(yaw + T * yaw_rate, -self._max_turn), self._max_turn),
                *(speed, load, slope, light_pitch, light_yaw, max(peak, load)),
            ]
        )


def _share(load: float, start: float, end: float) -> float:
    """Returns 1 below a load, 0 above another, and linear values between them."""
    return min(1.0, max(0.0, (end - load) / (end - start)))


def _limited(x: float, y: float, largest: float) -> tuple[float, float]:
    """Returns a pair with at most this norm, in the same direction."""
    size = math.hypot(x, y)
    return (x * largest / size, y * largest / size) if size > largest else (x, y)
