"""The drive monitor: it compares the feed's motion with its command, its current and the depth encoder."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.steps.drive_monitor import FAULT, SIZE, DriveLimits, drive_monitor_step, is_enabled


class DriveMonitor(LeafSystem):
    """
    .. pydrake_system::

        name: DriveMonitor
        input_ports:
        - feed_speed
        - wrench
        - depth
        - current
        - travel
        output_ports:
        - fault
        - feed_enabled

    Once per period of the drive, it looks for faults by `drive_monitor_step`. ``fault`` (`Fault`) is the first fault
    and stays. After a fault of the feed drive ``feed_enabled`` is 0, which switches the drive off. ``feed_speed`` is
    the command that the drive receives, m/s; ``travel`` and ``depth`` in m, ``current`` in A.

    Args:
        limits: what a sound drive keeps.
    """

    def __init__(self, limits: DriveLimits) -> None:
        super().__init__()
        self._limits = limits
        self._feed_speed = self.DeclareVectorInputPort("feed_speed", 1)
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._current = self.DeclareVectorInputPort("current", 1)
        self._travel = self.DeclareVectorInputPort("travel", 1)
        self._state = self.DeclareDiscreteState(SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("feed_enabled", 1, self._calc_enabled, state)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        found = drive_monitor_step(
            self._limits,
            np.array(context.get_discrete_state(self._state).value()),
            self._feed_speed.Eval(context)[0],
            self._wrench.Eval(context),
            self._depth.Eval(context)[0],
            self._current.Eval(context)[0],
            self._travel.Eval(context)[0],
        )
        discrete_state.set_value(self._state, found)

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state)[FAULT]

    def _calc_enabled(self, context: Context, output: BasicVector) -> None:
        output[0] = float(is_enabled(np.array(context.get_discrete_state(self._state).value())))
