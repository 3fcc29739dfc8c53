"""Stands between the rig's sensors and whoever uses them: passes on what is sound, and says what is not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import WrenchSensorParameters
from systems.control.faults import Fault, repeats_of_a_stuck_sensor
from systems.hardware.wrench_sensor import wrench_at_tip

WRENCH, DEPTH, REPEATS, FAULT, STARTED = slice(0, 6), 6, 7, 8, 9


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

    Every sample of the sensor it is checked that

    * wrench and depth are numbers (else disconnected),
    * no channel of the sensor stands at the end of its range (saturated),
    * not all six readings have repeated themselves more often than noise allows (stuck, see
      `repeats_of_a_stuck_sensor`),
    * the depth has not changed faster than the feed can run (jumped).

    The first ``fault`` (`Fault`) stays. What is measured is passed on while it is sound; from a fault on, and wherever
    a number is none, the last sound measurement is. Wrench (N, N m) about the tip in P, depth in m.
    """

    def __init__(self, *, sensor: WrenchSensorParameters, top_speed: float, resolution: float) -> None:
        """Takes the sensor, the feed's greatest possible speed (m/s), and the depth encoder's resolution (m)."""
        super().__init__()
        self._height = sensor.height
        quantum = np.repeat([sensor.force_quantum, sensor.torque_quantum], 3)
        self._end = np.array([*sensor.force_range, *sensor.torque_range]) - 0.5 * quantum
        self._most_repeats = repeats_of_a_stuck_sensor(sensor)
        self._farthest = top_speed * sensor.period + resolution
        self._raw_wrench = self.DeclareVectorInputPort("raw_wrench", 6)
        self._raw_depth = self.DeclareVectorInputPort("raw_depth", 1)
        self._state = self.DeclareDiscreteState(np.zeros(10))
        self.DeclarePeriodicDiscreteUpdateEvent(sensor.period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {state, self._raw_wrench.ticket()})
        self.DeclareVectorOutputPort("depth", 1, self._calc_depth, {state, self._raw_depth.ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, {state})

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value().copy()
        if state[FAULT] != Fault.NONE:
            return
        wrench, depth = self._raw_wrench.Eval(context), self._raw_depth.Eval(context)[0]
        same = bool(state[STARTED]) and np.array_equal(wrench, state[WRENCH])
        state[REPEATS] = state[REPEATS] + 1 if same else 0
        state[FAULT] = self._fault(state, wrench, depth)
        if state[FAULT] == Fault.NONE:
            state[WRENCH], state[DEPTH], state[STARTED] = wrench, depth, 1.0
        discrete_state.get_mutable_vector(self._state).SetFromVector(state)

    def _fault(self, state: NDArray[np.float64], wrench: NDArray[np.float64], depth: float) -> Fault:
        if not np.isfinite(wrench).all():
            return Fault.SENSOR_DISCONNECTED
        if not np.isfinite(depth):
            return Fault.ENCODER_DISCONNECTED
        if (np.abs(wrench_at_tip(wrench, -self._height)) >= self._end).any():
            return Fault.SENSOR_SATURATED
        if state[REPEATS] > self._most_repeats:
            return Fault.SENSOR_STUCK
        if state[STARTED] and abs(depth - state[DEPTH]) > self._farthest:
            return Fault.ENCODER_JUMPED
        return Fault.NONE

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        state, wrench = context.get_discrete_state(self._state).value(), self._raw_wrench.Eval(context)
        sound = state[FAULT] == Fault.NONE and np.isfinite(wrench).all()
        output.SetFromVector(wrench if sound else state[WRENCH])

    def _calc_depth(self, context: Context, output: BasicVector) -> None:
        state, depth = context.get_discrete_state(self._state).value(), self._raw_depth.Eval(context)[0]
        output[0] = depth if state[FAULT] == Fault.NONE and np.isfinite(depth) else state[DEPTH]

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state).value()[FAULT]
