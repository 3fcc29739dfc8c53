"""The sensor monitor: it passes sound measurements on and reports faults that single readings of the sensors show."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from skill.arrays import Array
from systems.steps.sensor_monitor import (
    FAULT,
    SIZE,
    SensorLimits,
    sensor_monitor_step,
    sound_depth,
    sound_wrench,
)


class SensorMonitor(LeafSystem):
    """
    .. pydrake_system::

        name: SensorMonitor
        input_ports:
        - raw_wrench
        - raw_depth
        output_ports:
        - wrench
        - depth
        - fault

    Checks every sample of the sensor by `sensor_monitor_step`. ``fault`` (`Fault`) is the first fault and stays. Sound
    measurements are passed on at once. After a fault, and instead of a spike, a NaN or an infinite value, the outputs
    hold the last sound measurement. The wrench (N, N m) is about the tip in P, the depth in m.

    Args:
        limits: what sound readings keep.
        period: of the sensor, s.
    """

    def __init__(self, *, limits: SensorLimits, period: float) -> None:
        super().__init__()
        self._limits = limits
        self._raw_wrench = self.DeclareVectorInputPort("raw_wrench", 6)
        self._raw_depth = self.DeclareVectorInputPort("raw_depth", 1)
        self._state = self.DeclareDiscreteState(SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {state, self._raw_wrench.ticket()})
        self.DeclareVectorOutputPort("depth", 1, self._calc_depth, {state, self._raw_depth.ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, {state})

    def _values(self, context: Context) -> Array:
        return np.array(context.get_discrete_state(self._state).value())

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        wrench, depth = self._raw_wrench.Eval(context), self._raw_depth.Eval(context)[0]
        found = sensor_monitor_step(self._limits, self._values(context), wrench, depth, context.get_time())
        discrete_state.set_value(self._state, found)

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(sound_wrench(self._limits, self._values(context), self._raw_wrench.Eval(context)))

    def _calc_depth(self, context: Context, output: BasicVector) -> None:
        output[0] = sound_depth(self._values(context), self._raw_depth.Eval(context)[0])

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state)[FAULT]
