"""The controller that runs a policy: it turns actions into turn rates and a feed speed, and backs off."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem, State

from models.control import ControllerParameters
from skill.arrays import Array
from skill.features.measurement import contact_load, measurement
from skill.policy import Action, RigPolicy
from skill.states.estimate import Estimate
from systems.control.back_off import BackOffState, back_off_step
from systems.control.faults import error_summary


@dataclass(frozen=True)
class ControllerState:
    """State of the controller between two periods.

    Attributes:
        rates: (2,), commanded rates of pitch and yaw, rad/s.
        feed_speed: commanded feed speed, m/s, negative into the hole.
        unwinding: whether the hole turns back to its angles at the last light load.
        back_off: state of the back-off.
        support: support of the last action, 0 to 1.
        turning: 1 where the turns of the policy are applied, -1 where they are reversed, 0 where they are not applied.
        given_up: whether the policy has nothing new to try.
    """

    rates: Array = field(default_factory=lambda: np.zeros(2))
    feed_speed: float = 0.0
    unwinding: bool = False
    back_off: BackOffState = field(default_factory=BackOffState)
    support: float = 1.0
    turning: float = 1.0
    given_up: bool = False

    def as_list(self) -> list[float]:
        """Returns the numbers of the discrete state."""
        flags = float(self.unwinding), float(self.given_up)
        return [*self.rates, self.feed_speed, *flags, *self.back_off.as_list(), self.support, self.turning]

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_list`."""
        pitch, yaw, feed_speed, unwinding, given_up, *back_off, support, turning = values
        state = BackOffState.from_list(back_off)
        return cls(np.array([pitch, yaw]), feed_speed, bool(unwinding), state, support, turning, bool(given_up))


OUTPUTS: dict[str, Callable[[ControllerState], float]] = {
    "pitch_rate": lambda state: state.rates[0],
    "yaw_rate": lambda state: state.rates[1],
    "feed_speed": lambda state: state.feed_speed,
    "unwinding": lambda state: state.unwinding,
    "back_off": lambda state: state.back_off.mode,
    "support": lambda state: state.support,
    "turning": lambda state: state.turning,
    "given_up": lambda state: state.given_up,
}
"""The output ports that read the discrete state."""


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
        - feed_speed
        - unwinding
        - back_off
        - support
        - turning
        - given_up
        - failed

    Every period T the policy returns an action: a turn omega (rad, in P) of the peg relative to the hole and a motion u
    (m) along its axis, both within one period T_s of the policy. The rig turns the hole instead of the peg:

        pitch rate = -g omega_x/T_s,   yaw rate = -g omega_y/T_s,   feed speed = u/T_s,

    each within its limit. `back_off_step` reduces the feed where the policy is unsure, and draws the peg back when
    it is stuck: ``back_off`` is 1 meanwhile, and ``unwinding`` is 1 while the hole is to turn back to its angles at the
    last light load. ``support`` is the support of the action, and ``turning`` is 1 where its turn is applied, -1 where
    it is reversed, and 0 where it is not applied. When the policy has nothing new to try, ``given_up`` is 1 and nothing
    moves any more. The load is limited behind this system, by the `ForceGuard`.

    A policy that raises an exception, or returns a NaN or infinite action, has failed and is not called again: feed and
    turns stop, and ``failed`` is 1.

    The controller receives the wrench on the peg about its tip, the depth, the `Estimate` at this measurement, and its
    own motions: the angles of the hole (rad) that the guard permits.
    """

    def __init__(
        self,
        *,
        policy: RigPolicy,
        parameters: ControllerParameters,
        peg_radius: float,
    ) -> None:
        super().__init__()
        self._policy = policy
        self._parameters = parameters
        self._peg_radius = peg_radius
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._estimate = self.DeclareAbstractInputPort("estimate", Value[object](Estimate()))
        self._targets = [self.DeclareVectorInputPort(f"target_{name}", 1) for name in ("pitch", "yaw")]
        self._state = self.DeclareDiscreteState(ControllerState().as_list())
        self._failure = self.DeclareAbstractState(AbstractValue.Make(""))
        self.DeclarePeriodicUnrestrictedUpdateEvent(parameters.period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)
        state = {self.discrete_state_ticket(self._state)}
        for name, read in OUTPUTS.items():
            self.DeclareVectorOutputPort(name, 1, self._reader(read), state)
        self.DeclareVectorOutputPort("failed", 1, self._calc_failed, {self.abstract_state_ticket(self._failure)})

    def failure(self, context: Context) -> str:
        """Returns why the policy failed, or "" if it has not; ``context`` is this system's."""
        return str(context.get_abstract_state(int(self._failure)).get_value())

    def tried(self, context: Context) -> str:
        """Returns what the policy has tried if it has nothing new to try, else ""; ``context`` is this system's."""
        state = self._controller_state(context)
        if not state.given_up:
            return ""
        attempts, best = 1 + int(state.back_off.repeats), 1e3 * state.back_off.best
        name = self._policy.state_names()[int(state.back_off.contact_state)]
        return f"{attempts} attempts in a row ended in {name!r}, none deeper than {best:.1f} mm"

    def _controller_state(self, context: Context) -> ControllerState:
        return ControllerState.from_vector(context.get_discrete_state(self._state).value())

    def _reader(self, read: Callable[[ControllerState], float]) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = read(self._controller_state(context))

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
            command = replace(command, rates=np.zeros(2), feed_speed=0.0, unwinding=False, turning=0.0)
            state.get_mutable_abstract_state(int(self._failure)).set_value(error_summary(error))
        else:
            pitch, yaw = (float(port.Eval(context)[0]) for port in self._targets)
            command = self._next_state(command, action, wrench, depth, estimate, angles=(pitch, yaw))
        state.get_mutable_discrete_state(self._state).SetFromVector(command.as_list())

    def _checked_action(self, measured: Array, estimate: Estimate) -> Action:
        action = self._policy.act(measured, estimate)
        if not (np.isfinite(action.turn).all() and math.isfinite(action.feed) and math.isfinite(action.support)):
            raise ValueError(
                f"the action is not finite: turn {action.turn}, feed {action.feed}, support {action.support}"
            )
        return action

    def _next_state(
        self,
        state: ControllerState,
        action: Action,
        wrench: Array,
        depth: float,
        estimate: Estimate,
        *,
        angles: tuple[float, float],
    ) -> ControllerState:
        p = self._parameters
        decision = back_off_step(
            p.back_off,
            state.back_off,
            period=p.period,
            feed_speed=float(np.clip(action.feed / self._policy.period_, -p.max_feed_speed, p.max_feed_speed)),
            overloaded=contact_load(wrench, self._peg_radius) > p.guard.force_limit,
            depth=depth,
            known=estimate.known,
            support=action.support,
            contact_state=estimate.state,
            angles=angles,
            side=math.hypot(wrench[0], wrench[1]),
        )
        rates = -p.gain * decision.turning * action.turn / self._policy.period_
        size = np.linalg.norm(rates)
        if size > p.max_turn_rate:
            rates *= p.max_turn_rate / size
        return ControllerState(
            rates=rates,
            feed_speed=decision.feed_speed,
            unwinding=decision.unwinding,
            back_off=decision.state,
            support=action.support,
            turning=decision.turning,
            given_up=decision.given_up,
        )
