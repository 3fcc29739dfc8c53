"""The policy controller: what it commands in one period for an action of the policy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from compiled import compiled
from skill.arrays import Array
from skill.features.measurement import load_of_components
from systems.steps.back_off import BackOffNumbers, BackOffState, back_off_step

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario

LARGEST = 1e6
"""Turns of an action beyond this one are as good as infinite, rad."""


class ControllerLimits(NamedTuple):
    """Gain and limits of the controller.

    Attributes:
        period: T, s.
        policy_period: T_s, duration of an action of the policy, s.
        gain: g.
        max_turn_rate: rad/s.
        max_feed_speed: m/s.
        force_limit: load above which the peg is drawn back, N.
        lever: of the moments in the load, the reach of the peg, m.
        back_off: `models.control.BackOffParameters`.
    """

    period: float
    policy_period: float
    gain: float
    max_turn_rate: float
    max_feed_speed: float
    force_limit: float
    lever: float
    back_off: Any

    @classmethod
    def of(cls, scenario: Scenario, policy_period: float) -> Self:
        """Returns the limits of a scenario for a policy whose actions take ``policy_period``, s."""
        p = scenario.controller
        return cls(
            p.period,
            policy_period,
            p.gain,
            p.max_turn_rate,
            p.max_feed_speed,
            p.guard.force_limit,
            scenario.geometry.reach,
            BackOffNumbers(*vars(p.back_off).values()),
        )


class ControllerState(NamedTuple):
    """State of the controller between two periods.

    Attributes:
        pitch_rate, yaw_rate, clocking_rate: commanded rates of the hole, rad/s.
        feed_speed: commanded feed speed, m/s, negative into the hole.
        unwinding: whether the hole turns back to its angles at the last light load.
        given_up: whether the policy has nothing new to try.
        support: support of the last action, 0 to 1.
        turning: 1 where the turns of the policy are applied, -1 where they are reversed, 0 where they are not applied.
        back_off: state of the back-off.
    """

    pitch_rate: float = 0.0
    yaw_rate: float = 0.0
    clocking_rate: float = 0.0
    feed_speed: float = 0.0
    unwinding: float = 0.0
    given_up: float = 0.0
    support: float = 1.0
    turning: float = 1.0
    back_off: BackOffState = BackOffState()

    def as_list(self) -> list[float]:
        """Returns the numbers of the discrete state."""
        return [*self[:-1], *self.back_off]

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_list`."""
        numbers = values.tolist()
        own = len(cls._fields) - 1
        return cls._make([*numbers[:own], BackOffState(*numbers[own:])])

    def stopped(self) -> Self:
        """Returns the state in which nothing is commanded."""
        return self._replace(
            pitch_rate=0.0, yaw_rate=0.0, clocking_rate=0.0, feed_speed=0.0, unwinding=0.0, turning=0.0
        )


@compiled
def policy_controller_step(
    p: ControllerLimits,
    state: ControllerState,
    turn: Array,
    spin: float,
    feed: float,
    support: float,
    wrench: Array,
    depth: float,
    known: bool,
    contact_state: float,
    pitch: float,
    yaw: float,
) -> ControllerState:
    """Returns the next state.

    An action is a turn omega (rad, in P) of the peg relative to the hole and a motion u (m) along its axis, both within
    one period T_s of the policy. The rig turns the hole instead of the peg:

        (pitch, yaw, clocking rate) = -g omega/T_s,   feed speed = u/T_s,

    each within its limit. The turn about the axis is never reversed: the moment about it has the same sign at any depth
    and any pivot. `back_off_step` reduces the feed where the policy is unsure, and draws the peg back when it
    is stuck.

    Args:
        p: limits.
        state: after the last period.
        turn: (2,), omega_x and omega_y.
        spin: omega_z.
        feed: u.
        support: of the action; below 0 it counts as 0, above 1 as 1.
        wrench: (6,), measured wrench on the peg about its tip, in P, N and N m.
        depth: measured depth, m.
        known: whether the contact state is recognised.
        contact_state: number of the most probable contact state.
        pitch: commanded angle of the hole, rad.
        yaw: likewise.
    """
    support = min(max(support, 0.0), 1.0)
    fx, fy, fz, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    decision = back_off_step(
        p.back_off,
        state.back_off,
        p.period,
        min(max(feed / p.policy_period, -p.max_feed_speed), p.max_feed_speed),
        load_of_components(fx, fy, fz, mx, my, mz, p.lever) > p.force_limit,
        depth,
        known,
        support,
        contact_state,
        pitch,
        yaw,
        math.hypot(fx, fy),
    )
    factor = -p.gain * decision.turning / p.policy_period
    factor *= LARGEST / max(LARGEST, abs(turn[0]), abs(turn[1]))
    rate_x, rate_y = factor * turn[0], factor * turn[1]
    size = math.hypot(rate_x, rate_y)
    if size > p.max_turn_rate:
        rate_x, rate_y = rate_x * p.max_turn_rate / size, rate_y * p.max_turn_rate / size
    rate_z = -p.gain * abs(decision.turning) / p.policy_period * spin
    return ControllerState(
        rate_x,
        rate_y,
        min(max(rate_z, -p.max_turn_rate), p.max_turn_rate),
        decision.feed_speed,
        1.0 if decision.unwinding else 0.0,
        1.0 if decision.given_up else 0.0,
        support,
        decision.turning,
        decision.state,
    )
