"""The policy controller: what it commands in one period for an action of the policy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem, State

from compiled import compiled
from skill.arrays import Array
from skill.features.measurement import load_of_components, measurement
from skill.policy.rig_policy import Action, RigPolicy
from skill.states.estimate import Estimate
from systems.law.back_off import BackOffNumbers, BackOffState, attempts_text, back_off_step
from systems.law.faults import error_summary
from systems.law.turn_reversal import TurnWatch

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
        return [*self[:-1], *self.back_off[:-1], *self.back_off.watch]

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_list`."""
        numbers = values.tolist()
        own, watch = len(cls._fields) - 1, len(TurnWatch._fields)
        back_off = BackOffState._make([*numbers[own:-watch], TurnWatch._make(numbers[-watch:])])
        return cls._make([*numbers[:own], back_off])

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


OUTPUTS = (
    *("pitch_rate", "yaw_rate", "clocking_rate", "feed_speed"),
    *("unwinding", "given_up", "support", "turning", "back_off"),
)
"""The output ports that read the discrete state, in the order of its first numbers."""


class PolicyController(LeafSystem):
    """
    .. pydrake_system::

        name: PolicyController
        input_ports:
        - wrench
        - depth
        - estimate
        - target_pitch
        - target_yaw
        output_ports:
        - pitch_rate
        - yaw_rate
        - clocking_rate
        - feed_speed
        - unwinding
        - given_up
        - support
        - turning
        - back_off
        - failed

    Every period the policy returns an action, which `policy_controller_step` turns into commands, within its limits.
    ``back_off`` is 1 while the peg is drawn back, and ``unwinding`` while the hole is to turn back to its angles at the
    last light load. ``support`` is the support of the action, and ``turning`` is 1 where its turn is applied, -1 where
    it is reversed, and 0 where it is not applied. When the policy has nothing new to try, ``given_up`` is 1 and nothing
    moves any more. The load is limited behind this system, by the `ForceGuard`.

    A policy that raises an exception, or returns a NaN or infinite action, has failed and is not called again: feed and
    turns stop, and ``failed`` is 1.

    The controller receives the measured wrench on the peg about its tip, the depth, the `Estimate` at this measurement,
    and its own motions: the angles of the hole (rad) that the guard permits.
    """

    def __init__(self, *, policy: RigPolicy, limits: ControllerLimits) -> None:
        super().__init__()
        self._policy = policy
        self._limits = limits
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._estimate = self.DeclareAbstractInputPort("estimate", Value[object](Estimate()))
        self._targets = [self.DeclareVectorInputPort(f"target_{name}", 1) for name in ("pitch", "yaw")]
        self._state = self.DeclareDiscreteState(ControllerState().as_list())
        self._failure = self.DeclareAbstractState(AbstractValue.Make(""))
        self.DeclarePeriodicUnrestrictedUpdateEvent(limits.period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)
        state = {self.discrete_state_ticket(self._state)}
        for index, name in enumerate(OUTPUTS):
            self.DeclareVectorOutputPort(name, 1, self._reader(index), state)
        self.DeclareVectorOutputPort("failed", 1, self._calc_failed, {self.abstract_state_ticket(self._failure)})

    def failure(self, context: Context) -> str:
        """Returns why the policy failed, or "" if it has not; ``context`` is this system's."""
        return str(context.get_abstract_state(int(self._failure)).get_value())

    def tried(self, context: Context) -> str:
        """Returns what the policy has tried if it has nothing new to try, else ""; ``context`` is this system's."""
        state = self._controller_state(context)
        return attempts_text(state.back_off, self._policy.state_names()) if state.given_up else ""

    def _controller_state(self, context: Context) -> ControllerState:
        return ControllerState.from_vector(context.get_discrete_state(self._state).value())

    def _reader(self, index: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = context.get_discrete_state(self._state)[index]

        return calc

    def _calc_failed(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self.failure(context) != "")

    def _update(self, context: Context, state: State) -> None:
        command = self._controller_state(context)
        if self.failure(context) or command.given_up:
            return
        wrench, depth = self._wrench.Eval(context), self._depth.Eval(context)[0]
        estimate: Estimate = self._estimate.Eval(context)
        try:
            action = self._checked_action(measurement(wrench, depth), estimate)
        except Exception as error:  # a foreign policy may raise anything, and the rig must stop
            command = command.stopped()
            state.get_mutable_abstract_state(int(self._failure)).set_value(error_summary(error))
        else:
            command = policy_controller_step(
                self._limits,
                command,
                np.ascontiguousarray(action.turn, dtype=float),
                float(action.spin),
                float(action.feed),
                float(action.support),
                wrench,
                depth,
                estimate.known,
                float(estimate.state),
                *(port.Eval(context)[0] for port in self._targets),
            )
        state.get_mutable_discrete_state(self._state).SetFromVector(command.as_list())

    def _checked_action(self, measured: Array, estimate: Estimate) -> Action:
        action = self._policy.act(measured, estimate)
        if not np.isfinite([*action.turn, action.spin, action.feed, action.support]).all():
            raise ValueError(f"the action is not finite: {action}")
        return action
