"""The trained regressors, on line: from a wrench, a depth and the contact state to motor commands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.scenario import Controller
from systems.control_law import RigPolicy
from systems.supervisor import Watch, supervise

TURN, FEED, WATCH = slice(0, 2), 2, slice(3, 6)
COMMANDS = ("target_pitch", "target_yaw", "feed_speed", "guard")


class LwrController(LeafSystem):
    """
    .. pydrake_system::

        name: LwrController
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

    Every period T the skill says how a person would turn the peg relative to the hole, omega (rad, in P), and move
    it along its axis, u (m), within one sample period T_s of the demonstrations. The rig turns the hole instead:

        pitch <- pitch - g omega_x T/T_s,   yaw <- yaw - g omega_y T/T_s,   feed speed = u/T_s,

    each within its limit, and the feed as far as the supervisor lets it (`supervise`); ``guard`` is 1 while it backs
    the peg off. The controller knows the wrench on the peg about its tip, the depth, the state's probabilities and
    whether it is known, and its own commands, nothing else; its angles count from where the axes stood at time 0.
    """

    def __init__(self, *, skill: RigPolicy, parameters: Controller, peg_radius: float) -> None:
        super().__init__()
        self._skill = skill
        self._parameters = parameters
        self._peg_radius = peg_radius
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._probabilities = self.DeclareVectorInputPort("probabilities", skill.n_states)
        self._known = self.DeclareVectorInputPort("known", 1)
        # [pitch, yaw, feed speed, and the supervisor's watch, whose first is the guard]
        self._command = self.DeclareDiscreteState(np.array([0.0, 0.0, 0.0, *Watch().as_list()]))
        self.DeclarePeriodicDiscreteUpdateEvent(parameters.period, 0.0, self._update)
        state_only = {self.discrete_state_ticket(self._command)}
        for index, name in enumerate(COMMANDS):
            self.DeclareVectorOutputPort(name, 1, self._reader(index), state_only)

    def _reader(self, index: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = context.get_discrete_state(self._command).value()[index]

        return calc

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        p = self._parameters
        command = context.get_discrete_state(self._command).value().copy()
        wrench, depth = self._wrench.Eval(context), self._depth.Eval(context)[0]
        action = self._skill.act(np.array([*wrench, -depth]), self._probabilities.Eval(context))
        verdict = supervise(
            p,
            Watch(*command[WATCH]),
            period=p.period,
            feed_speed=float(np.clip(action.feed / self._skill.period_, -p.max_feed_speed, p.max_feed_speed)),
            load=float(np.hypot(np.linalg.norm(wrench[:3]), np.linalg.norm(wrench[3:]) / self._peg_radius)),
            depth=depth,
            known=bool(self._known.Eval(context)[0]),
        )
        if verdict.turning:
            rate = p.gain * action.turn / self._skill.period_
            fastest = np.linalg.norm(rate)
            if fastest > p.max_turn_rate:
                rate *= p.max_turn_rate / fastest
            command[TURN] = np.clip(command[TURN] - rate * p.period, -p.max_turn, p.max_turn)
        command[FEED] = verdict.feed_speed
        command[WATCH] = verdict.watch.as_list()
        discrete_state.get_mutable_vector(self._command).SetFromVector(command)
