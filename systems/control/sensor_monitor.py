"""The sensor monitor: it passes sound measurements on and reports faults that single readings of the sensors show."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from models.hardware import WrenchSensorParameters
from systems.control.faults import Fault, reading_deviation, repeats_of_a_stuck_sensor

MAX_SPIKES = 2
"""Number of spikes within `SPIKE_TIME` that a sound sensor may have."""

SPIKE_TIME = 1.0  # in units of s
DEVIATIONS = 12.0  # largest difference of two readings of a sound sensor at rest, in standard deviations


# Places in the discrete state; the first six are the last sound wrench (N, N m).
DEPTH = 6  # last sound depth, m
REPEATS = 7  # how many readings in a row equalled the one before
FAULT = 8  # first fault found
STARTED = 9  # whether there has been a sound sample
SPIKES = 10  # number of spikes, which fades with `SPIKE_TIME`
SIZE = 11


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
    * the depth has not changed faster than the feed can move (else jumped),
    * at most two readings within a second are spikes. A spike differs from the last sound reading by more than the
      sensor's low-pass passes within one period when the load changes by twice ``load_limit``, and by more than the
      noise.

    ``fault`` (`Fault`) is the first fault and stays. Sound measurements are passed on at once. After a fault, and
    instead of a spike, a NaN or an infinite value, the outputs hold the last sound measurement. The wrench (N, N m) is
    about the tip in P, the depth in m.
    """

    def __init__(
        self,
        *,
        sensor: WrenchSensorParameters,
        top_speed: float,
        resolution: float,
        depth_period: float,
        load_limit: float,
        peg_radius: float,
    ) -> None:
        """Stores the limits.

        Args:
            sensor: parameters of the force/torque sensor.
            top_speed: maximum speed of the feed, m/s.
            resolution: resolution of the depth encoder, m.
            depth_period: time between two changes of the depth, s; in a simulation the step of the plant.
            load_limit: load at which the peg is backed off, N.
            peg_radius: lever of the moments in this load, m.
        """
        super().__init__()
        self._height = sensor.height
        quantum = np.repeat([sensor.force_quantum, sensor.torque_quantum], 3)
        self._ends: list[float] = (np.array([*sensor.force_range, *sensor.torque_range]) - 0.5 * quantum).tolist()
        self._max_repeats = repeats_of_a_stuck_sensor(sensor)
        # The first reading arrives one period after the delay; it is compared with the second one.
        self._first_comparison = sensor.delay + 1.5 * sensor.period
        self._max_change = top_speed * max(sensor.period, depth_period) + resolution
        passed = sensor.blend
        force, torque = reading_deviation(sensor)
        self._max_force = passed * 2.0 * load_limit + DEVIATIONS * force
        self._max_moment = passed * 2.0 * load_limit * peg_radius + DEVIATIONS * torque
        self._fading = math.exp(-sensor.period / SPIKE_TIME)
        self._raw_wrench = self.DeclareVectorInputPort("raw_wrench", 6)
        self._raw_depth = self.DeclareVectorInputPort("raw_depth", 1)
        self._state = self.DeclareDiscreteState(np.zeros(SIZE))
        self.DeclarePeriodicDiscreteUpdateEvent(sensor.period, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort("wrench", 6, self._calc_wrench, {state, self._raw_wrench.ticket()})
        self.DeclareVectorOutputPort("depth", 1, self._calc_depth, {state, self._raw_depth.ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, {state})

    # At the sensor's rate a call of numpy costs more than arithmetic on six numbers, so these are plain numbers.

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state: list[float] = context.get_discrete_state(self._state).value().tolist()
        if state[FAULT] != Fault.NONE:
            return
        wrench: list[float] = self._raw_wrench.Eval(context).tolist()
        depth: float = self._raw_depth.Eval(context).item()
        same = wrench == state[:6] and state[STARTED] and context.get_time() > self._first_comparison
        repeats = state[REPEATS] + 1.0 if same else 0.0
        spike = state[STARTED] > 0.0 and self._is_spike(wrench, state)
        spikes = state[SPIKES] * self._fading + (1.0 if spike else 0.0)
        fault = self._find_fault(state, wrench, depth, repeats=repeats, spikes=spikes)
        if fault is not Fault.NONE:
            state[FAULT] = float(fault)
        elif spike:
            state[DEPTH:] = [depth, repeats, 0.0, 1.0, spikes]
        else:
            state = [*wrench, depth, repeats, 0.0, 1.0, spikes]
        discrete_state.set_value(state)

    def _find_fault(
        self, state: list[float], wrench: list[float], depth: float, *, repeats: float, spikes: float
    ) -> Fault:
        if not math.isfinite(sum(wrench)):
            return Fault.SENSOR_DISCONNECTED
        if not math.isfinite(depth):
            return Fault.ENCODER_DISCONNECTED
        if self._is_saturated(wrench):
            return Fault.SENSOR_SATURATED
        if repeats > self._max_repeats:
            return Fault.SENSOR_STUCK
        if spikes > MAX_SPIKES:
            return Fault.SENSOR_SPIKES
        if abs(depth - state[DEPTH]) > self._max_change and state[STARTED]:
            return Fault.ENCODER_JUMPED
        return Fault.NONE

    def _is_spike(self, wrench: list[float], state: list[float]) -> bool:
        """Whether a channel differs from the last sound one by more than a load can change it; false for a NaN."""
        force, moment = self._max_force, self._max_moment
        fx, fy, fz, mx, my, mz = wrench
        return (
            abs(fx - state[0]) > force
            or abs(fy - state[1]) > force
            or abs(fz - state[2]) > force
            or abs(mx - state[3]) > moment
            or abs(my - state[4]) > moment
            or abs(mz - state[5]) > moment
        )

    def _is_saturated(self, wrench: list[float]) -> bool:
        """Whether a channel is at the end of its range, which applies to the reading at the mount."""
        fx, fy, fz, mx, my, mz = wrench
        ends, h = self._ends, self._height
        return (
            abs(fx) >= ends[0]
            or abs(fy) >= ends[1]
            or abs(fz) >= ends[2]
            or abs(mx + h * fy) >= ends[3]
            or abs(my - h * fx) >= ends[4]
            or abs(mz) >= ends[5]
        )

    def _calc_wrench(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value().tolist()
        raw = self._raw_wrench.Eval(context)
        wrench = raw.tolist()
        sound = state[FAULT] == Fault.NONE and math.isfinite(sum(wrench))
        if sound and not (state[STARTED] and self._is_spike(wrench, state)):
            output.SetFromVector(raw)
        else:
            output.SetFromVector(state[:6])

    def _calc_depth(self, context: Context, output: BasicVector) -> None:
        state, depth = context.get_discrete_state(self._state).value(), self._raw_depth.Eval(context)[0]
        output[0] = depth if state[FAULT] == Fault.NONE and math.isfinite(depth) else state[DEPTH]

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state).value()[FAULT]
