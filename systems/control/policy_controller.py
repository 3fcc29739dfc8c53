"""The controller that runs a policy: it turns actions into turn rates and a feed speed, and backs off."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import BasicVector, Context, LeafSystem, State

from skill.arrays import Array
from skill.features.measurement import measurement
from skill.policy import Action, RigPolicy
from skill.states.estimate import Estimate
from systems.steps.back_off import attempts_text
from systems.steps.faults import error_summary
from systems.steps.policy_controller import ControllerLimits, ControllerState, policy_controller_step

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
