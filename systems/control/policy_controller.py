"""The trained regressors, on line: from a wrench, a depth and the contact state to motor commands."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, LeafSystem, State

from models.scenario import ControllerParameters
from skill.manipulation_skill import Action
from systems.control.faults import one_line
from systems.control.force_guard import GuardState, contact_load, guard_step
from systems.control.policy import RigPolicy

TURN, FEED, WATCH, SUPPORT, EASE = slice(0, 2), 2, slice(3, 7), 7, slice(8, 10)
COMMANDS = ("target_pitch", "target_yaw", "feed_speed", "guard")


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

    Every period T the skill says how a person would turn the peg relative to the hole, omega (rad, in P), and move
    it along its axis, u (m), within one sample period T_s of the demonstrations. The rig turns the hole instead:

        pitch <- pitch - g omega_x T/T_s,   yaw <- yaw - g omega_y T/T_s,   feed speed = u/T_s,

    each within its limit, and the feed as far as the supervisor lets it (`supervise`); ``guard`` is 1 while it backs
    the peg off, and ``support`` that of the action. Where the supervisor has turns unwound, the angles go back to those
    of the last moment with a load of at most F_soft. A skill that fails, by an exception or a number that is none, is
    not asked again: the feed stands still, the angles stay, and ``failed`` is 1. The controller knows the wrench on the
    peg about its tip, the depth, the state's probabilities and whether it is known, and its own commands, nothing else;
    its angles count from where the axes stood at time 0.
    """

    def __init__(self, *, skill: RigPolicy, parameters: ControllerParameters, peg_radius: float) -> None:
        super().__init__()
        self._skill = skill
        self._parameters = parameters
        self._peg_radius = peg_radius
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._probabilities = self.DeclareVectorInputPort("probabilities", skill.n_states)
        self._known = self.DeclareVectorInputPort("known", 1)
        # [pitch, yaw, feed speed, the supervisor's watch, whose first is the guard, support, pitch and yaw at ease]
        self._command = self.DeclareDiscreteState(np.array([0.0, 0.0, 0.0, *GuardState().as_list(), 1.0, 0.0, 0.0]))
        self._failure = self.DeclareAbstractState(AbstractValue.Make(""))
        self.DeclarePeriodicUnrestrictedUpdateEvent(parameters.period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)
        command = {self.discrete_state_ticket(self._command)}
        for name, index in zip((*COMMANDS, "support"), (0, 1, FEED, WATCH.start, SUPPORT), strict=True):
            self.DeclareVectorOutputPort(name, 1, self._reader(index), command)
        self.DeclareVectorOutputPort("failed", 1, self._calc_failed, {self.abstract_state_ticket(self._failure)})

    def failure(self, context: Context) -> str:
        """Why the skill failed, "" while it has not; ``context`` is this system's."""
        return str(context.get_abstract_state(int(self._failure)).get_value())

    def _reader(self, index: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = context.get_discrete_state(self._command).value()[index]

        return calc

    def _calc_failed(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self.failure(context) != "")

    def _update(self, context: Context, state: State) -> None:
        if self.failure(context):
            return
        command = context.get_discrete_state(self._command).value().copy()
        wrench, depth = self._wrench.Eval(context), self._depth.Eval(context)[0]
        try:
            action = self._checked_action(np.array([*wrench, -depth]), self._probabilities.Eval(context))
        except Exception as error:  # a learner of one's own may raise anything, and the rig must stop
            command[FEED] = 0.0
            state.get_mutable_abstract_state(int(self._failure)).set_value(one_line(error))
        else:
            self._follow(command, action, wrench, depth, known=bool(self._known.Eval(context)[0]))
        state.get_mutable_discrete_state(self._command).SetFromVector(command)

    def _checked_action(self, measured: NDArray[np.float64], probabilities: NDArray[np.float64]) -> Action:
        action = self._skill.act(measured, probabilities)
        if not (np.isfinite(action.turn).all() and math.isfinite(action.feed) and math.isfinite(action.support)):
            raise ValueError(f"the action is not finite: turn {action.turn}, feed {action.feed}, {action.support}")
        return action

    def _follow(
        self, command: NDArray[np.float64], action: Action, wrench: NDArray[np.float64], depth: float, *, known: bool
    ) -> None:
        """Changes the command in place, as far as limits and supervisor let it."""
        p = self._parameters
        load = contact_load(wrench, self._peg_radius)
        if load <= p.soft_force:
            command[EASE] = command[TURN]
        verdict = guard_step(
            p,
            GuardState(*command[WATCH]),
            period=p.period,
            feed_speed=float(np.clip(action.feed / self._skill.period_, -p.max_feed_speed, p.max_feed_speed)),
            load=load,
            depth=depth,
            known=known,
            support=action.support,
        )
        turn = np.zeros(2)
        if verdict.turning:
            turn = -p.gain * action.turn * p.period / self._skill.period_
        elif verdict.unwinding:
            turn = command[EASE] - command[TURN]
        size = np.linalg.norm(turn)
        if size > p.max_turn_rate * p.period:
            turn *= p.max_turn_rate * p.period / size
        command[TURN] = np.clip(command[TURN] + turn, -p.max_turn, p.max_turn)
        command[FEED] = verdict.feed_speed
        command[WATCH] = verdict.watch.as_list()
        command[SUPPORT] = action.support
