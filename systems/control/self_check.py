"""The self-check of the sensor: its readings in free air, and in contact against what the drives carry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from skill.data.axes import AXES
from systems.steps.self_check import FAULT, FEED_SIZE, FREE, SIZE, CheckLimits, feed_check_step, self_check_step


class SelfCheck(LeafSystem):
    """
    .. pydrake_system::

        name: SelfCheck
        input_ports:
        - wrench
        - depth
        - current
        - travel
        - pitch_shaft
        - yaw_shaft
        output_ports:
        - fault

    Checks the sensor by `self_check_step`, and at each period of the feed drive, within which the current changes, by
    `feed_check_step`. ``fault`` (`Fault`) is the first fault and stays. ``wrench`` (N, N m) is about the tip in P,
    ``travel`` and ``depth`` in m, a ``shaft`` is [commanded, measured] angle, rad.

    Args:
        limits: what a sound sensor keeps.
        axes: names of the steppers, each with an input ``<name>_shaft``.
    """

    def __init__(self, limits: CheckLimits, axes: Sequence[str] = AXES[:2]) -> None:
        super().__init__()
        self._limits = limits
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._current = self.DeclareVectorInputPort("current", 1)
        self._travel = self.DeclareVectorInputPort("travel", 1)
        self._shafts = [self.DeclareVectorInputPort(f"{name}_shaft", 2) for name in axes]
        self._state = self.DeclareDiscreteState(SIZE)
        self._feed_state = self.DeclareDiscreteState(FEED_SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, 0.0, self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.drive_period, 0.0, self._update_feed)
        states = {self.discrete_state_ticket(state) for state in (self._state, self._feed_state)}
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, states)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        found = self_check_step(
            self._limits,
            np.array(context.get_discrete_state(self._state).value()),
            self._wrench.Eval(context),
            self._depth.Eval(context)[0],
            np.array([port.Eval(context) for port in self._shafts]),
            context.get_time(),
        )
        discrete_state.set_value(self._state, found)

    def _update_feed(self, context: Context, discrete_state: DiscreteValues) -> None:
        found = feed_check_step(
            self._limits,
            np.array(context.get_discrete_state(self._feed_state).value()),
            self._wrench.Eval(context)[2],
            self._current.Eval(context)[0],
            self._travel.Eval(context)[0],
            context.get_time(),
            context.get_discrete_state(self._state)[FREE] > 0.0,
        )
        discrete_state.set_value(self._feed_state, found)

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        own, feed = (context.get_discrete_state(state)[FAULT] for state in (self._state, self._feed_state))
        output[0] = own or feed
