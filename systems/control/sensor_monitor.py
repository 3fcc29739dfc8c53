"""The sensor monitor: it passes sound measurements on and reports faults of the sensors."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import WrenchSensorParameters
from skill.arrays import Array
from systems.control.faults import Fault, repeats_of_a_stuck_sensor
from systems.hardware.wrench_sensor import wrench_at_tip


@dataclass(frozen=True)
class MonitorState:
    """State of the monitor between two samples.

    Attributes:
        wrench: (6,), last sound wrench, N and N m.
        depth: last sound depth, m.
        repeats: how many readings in a row equalled the one before.
        fault: first fault found.
        started: whether there has been a sound sample.
    """

    wrench: Array = field(default_factory=lambda: np.zeros(6))
    depth: float = 0.0
    repeats: float = 0.0
    fault: Fault = Fault.NONE
    started: bool = False

    def as_list(self) -> list[float]:
        """Returns the ten numbers of the discrete state, in the order of the attributes."""
        return [*self.wrench, self.depth, self.repeats, float(self.fault), float(self.started)]

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_list`."""
        *wrench, depth, repeats, fault, started = values
        return cls(np.array(wrench), depth, repeats, Fault(int(fault)), bool(started))


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

    At every sample of the sensor the monitor checks that

    * wrench and depth are finite (else disconnected),
    * no channel of the sensor is at the end of its range (else saturated),
    * the six readings have not repeated themselves more often than their noise allows (else stuck, see
      `repeats_of_a_stuck_sensor`); the zeros before the first reading has passed the sensor's delay do not count,
    * the depth has not changed faster than the feed can move (else jumped).

    ``fault`` (`Fault`) is the first fault and stays. Sound measurements are passed on at once. After a fault, and
    instead of a NaN or infinite value, the outputs hold the last sound measurement. The wrench (N, N m) is about the
    tip in P, the depth in m.
    """

    def __init__(
        self, *, sensor: WrenchSensorParameters, top_speed: float, resolution: float, depth_period: float
    ) -> None:
        """Stores the limits.

        Args:
            sensor: parameters of the force/torque sensor.
            top_speed: maximum speed of the feed, m/s.
            resolution: resolution of the depth encoder, m.
            depth_period: time between two changes of the depth, s; in a simulation the step of the plant.
        """
        super().__init__()
        self._height = sensor.height
        quantum = np.repeat([sensor.force_quantum, sensor.torque_quantum], 3)
        self._end = np.array([*sensor.force_range, *sensor.torque_range]) - 0.5 * quantum
        self._max_repeats = repeats_of_a_stuck_sensor(sensor)
        # The first reading arrives one period after the delay; it is compared with the second one.
        self._first_comparison = sensor.delay + 1.5 * sensor.period
        self._max_change = top_speed * max(sensor.period, depth_period) + resolution
        self._raw_wrench = self.DeclareVectorInputPort("raw_wrench", 6)
        self._raw_depth = self.DeclareVectorInputPort("raw_depth", 1)
        self._state = self.DeclareDiscreteState(MonitorState().as_list())
        self.DeclarePeriodicDiscreteUpdateEvent(sensor.period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {state, self._raw_wrench.ticket()})
        self.DeclareVectorOutputPort("depth", 1, self._calc_depth, {state, self._raw_depth.ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, {state})

    def _monitor_state(self, context: Context) -> MonitorState:
        return MonitorState.from_vector(context.get_discrete_state(self._state).value())

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = self._monitor_state(context)
        if state.fault is not Fault.NONE:
            return
        wrench, depth = self._raw_wrench.Eval(context), self._raw_depth.Eval(context)[0]
        measured = context.get_time() > self._first_comparison
        same = state.started and measured and np.array_equal(wrench, state.wrench)
        state = replace(state, repeats=state.repeats + 1 if same else 0.0)
        fault = self._find_fault(state, wrench, depth)
        if fault is Fault.NONE:
            state = replace(state, wrench=wrench, depth=depth, started=True)
        discrete_state.get_mutable_vector(self._state).SetFromVector(replace(state, fault=fault).as_list())

    def _find_fault(self, state: MonitorState, wrench: Array, depth: float) -> Fault:
        if not np.isfinite(wrench).all():
            return Fault.SENSOR_DISCONNECTED
        if not np.isfinite(depth):
            return Fault.ENCODER_DISCONNECTED
        if (np.abs(wrench_at_tip(wrench, -self._height)) >= self._end).any():
            return Fault.SENSOR_SATURATED
        if state.repeats > self._max_repeats:
            return Fault.SENSOR_STUCK
        if state.started and abs(depth - state.depth) > self._max_change:
            return Fault.ENCODER_JUMPED
        return Fault.NONE

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        state, wrench = self._monitor_state(context), self._raw_wrench.Eval(context)
        sound = state.fault is Fault.NONE and np.isfinite(wrench).all()
        output.SetFromVector(wrench if sound else state.wrench)

    def _calc_depth(self, context: Context, output: BasicVector) -> None:
        state, depth = self._monitor_state(context), self._raw_depth.Eval(context)[0]
        output[0] = depth if state.fault is Fault.NONE and np.isfinite(depth) else state.depth

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = self._monitor_state(context).fault
