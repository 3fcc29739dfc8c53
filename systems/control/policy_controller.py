"""The controller that runs a policy: it turns actions into motor commands within limits and force guard."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, LeafSystem, State

from models.scenario import ForceGuardParameters, PolicyControllerParameters
from skill.arrays import Array
from skill.features.measurement import contact_load, measurement
from skill.manipulation_skill import Action
from skill.policy import RigPolicy
from systems.control.faults import one_line
from systems.control.force_guard import GuardState, guard_step


@dataclass(frozen=True)
class ControllerState:
    """State of the controller between two periods.

    Attributes:
        angles: (2,), commanded pitch and yaw relative to the angles at time 0, rad.
        feed_speed: commanded feed speed, m/s, negative into the hole.
        guard: state of the force guard.
        support: support of the last action, 0 to 1.
        light_angles: (2,), angles that were commanded when the load was last at most F_soft, rad.
    """

    angles: Array = field(default_factory=lambda: np.zeros(2))
    feed_speed: float = 0.0
    guard: GuardState = field(default_factory=GuardState)
    support: float = 1.0
    light_angles: Array = field(default_factory=lambda: np.zeros(2))

    def as_list(self) -> list[float]:
        """Returns the ten numbers of the discrete state, in the order of the attributes."""
        return [*self.angles, self.feed_speed, *self.guard.as_list(), self.support, *self.light_angles]

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_list`."""
        pitch, yaw, feed_speed, *guard, support, light_pitch, light_yaw = values
        return cls(
            np.array([pitch, yaw]), feed_speed, GuardState.from_list(guard), support, np.array([light_pitch, light_yaw])
        )


OUTPUTS: dict[str, Callable[[ControllerState], float]] = {
    "target_pitch": lambda state: state.angles[0],
    "target_yaw": lambda state: state.angles[1],
    "feed_speed": lambda state: state.feed_speed,
    "guard": lambda state: state.guard.mode,
    "support": lambda state: state.support,
}
"""The output ports that read the discrete state."""


class PolicyController(LeafSystem):
    """
    .. pydrake_system::

        name: PolicyController
        input_ports:
        - wrench
        - depth
        - probabilities
        - known
        output_ports:
        - target_pitch
        - target_yaw
        - feed_speed
        - guard
        - support
        - failed

    Every period T the policy returns an action: a turn omega (rad, in P) of the peg relative to the hole and a motion u
    (m) along its axis, both within one period T_s of the policy. The rig turns the hole instead of the peg:

        pitch <- pitch - g omega_x T/T_s,   yaw <- yaw - g omega_y T/T_s,   feed speed = u/T_s,

    each within its limit, and the feed within what the force guard permits (`guard_step`). ``guard`` is 1 while the
    guard backs the peg off, and ``support`` is the support of the action. When the guard unwinds the turns, the angles
    return to those at which the load was last at most F_soft.

    A policy that raises an exception, or returns a NaN or infinite action, has failed and is not called again: the feed
    stops, the angles stay, and ``failed`` is 1.

    The controller receives the wrench on the peg about its tip, the depth, the probabilities of the states and whether
    the state is known. It counts angles from the positions of the axes at time 0.
    """

    def __init__(
        self,
        *,
        policy: RigPolicy,
        parameters: PolicyControllerParameters,
        guard: ForceGuardParameters,
        peg_radius: float,
    ) -> None:
        super().__init__()
        self._policy = policy
        self._parameters = parameters
        self._guard = guard
        self._peg_radius = peg_radius
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._probabilities = self.DeclareVectorInputPort("probabilities", policy.n_states)
        self._known = self.DeclareVectorInputPort("known", 1)
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

    def _controller_state(self, context: Context) -> ControllerState:
        return ControllerState.from_vector(context.get_discrete_state(self._state).value())

    def _reader(self, read: Callable[[ControllerState], float]) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = read(self._controller_state(context))

        return calc

    def _calc_failed(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self.failure(context) != "")

    def _update(self, context: Context, state: State) -> None:
        if self.failure(context):
            return
        command = self._controller_state(context)
        wrench, depth = self._wrench.Eval(context), self._depth.Eval(context)[0]
        try:
            action = self._checked_action(measurement(wrench, depth), self._probabilities.Eval(context))
        except Exception as error:  # a foreign policy may raise anything, and the rig must stop
            command = replace(command, feed_speed=0.0)
            state.get_mutable_abstract_state(int(self._failure)).set_value(one_line(error))
        else:
            command = self._next_state(command, action, wrench, depth, known=bool(self._known.Eval(context)[0]))
        state.get_mutable_discrete_state(self._state).SetFromVector(command.as_list())

    def _checked_action(self, measured: Array, probabilities: Array) -> Action:
        action = self._policy.act(measured, probabilities)
        if not (np.isfinite(action.turn).all() and math.isfinite(action.feed) and math.isfinite(action.support)):
            raise ValueError(
                f"the action is not finite: turn {action.turn}, feed {action.feed}, support {action.support}"
            )
        return action

    def _next_state(
        self, state: ControllerState, action: Action, wrench: Array, depth: float, *, known: bool
    ) -> ControllerState:
        p = self._parameters
        load = contact_load(wrench, self._peg_radius)
        light_angles = state.angles if load <= self._guard.soft_force else state.light_angles
        decision = guard_step(
            self._guard,
            state.guard,
            period=p.period,
            feed_speed=float(np.clip(action.feed / self._policy.period_, -p.max_feed_speed, p.max_feed_speed)),
            load=load,
            depth=depth,
            known=known,
            support=action.support,
        )
        turn = np.zeros(2)
        if decision.turning:
            turn = -p.gain * action.turn * p.period / self._policy.period_
        elif decision.unwinding:
            turn = light_angles - state.angles
        size = np.linalg.norm(turn)
        if size > p.max_turn_rate * p.period:
            turn *= p.max_turn_rate * p.period / size
        return ControllerState(
            angles=np.clip(state.angles + turn, -p.max_turn, p.max_turn),
            feed_speed=decision.feed_speed,
            guard=decision.state,
            support=action.support,
            light_angles=light_angles,
        )
