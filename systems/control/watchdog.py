"""The watchdog: it passes commands to the motors, and retracts the peg and stops after a fault."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from systems.control.faults import FEED_FAULTS, SENSOR_FAULTS, Fault

COMMANDS = ("pitch_rate", "yaw_rate", "feed_speed", "unwinding")
MONITORS = ("sensor_monitor_fault", "drive_monitor_fault", "self_check_fault")
AXES = {"pitch": Fault.PITCH_STEPS_LOST, "yaw": Fault.YAW_STEPS_LOST}
LOST_LAG = 2.5  # steps; a rotor that lags by two has slipped, and lags by four as soon as it rests


class Index(IntEnum):
    """Places in the discrete state."""

    FAULT = 0  # first fault found
    SINCE = 1  # time since that fault, s
    SIZE = 2


class Watchdog(LeafSystem):
    """
    .. pydrake_system::

        name: Watchdog
        input_ports:
        - pitch_rate
        - yaw_rate
        - feed_speed
        - unwinding
        - controller_failed
        - sensor_monitor_fault
        - drive_monitor_fault
        - self_check_fault
        - pitch_shaft
        - yaw_shaft
        output_ports:
        - pitch_rate
        - yaw_rate
        - feed_speed
        - unwinding
        - fault
        - blind
        - stopped

    Every period the watchdog collects the faults of the `SensorMonitor`, the `DriveMonitor`, the `SelfCheck` and the
    controller. A stepper has lost steps if the encoder on its shaft lags its commanded angle by more than `LOST_LAG`
    steps; a ``shaft`` is [commanded, measured] angle, rad.

    ``fault`` (`Fault`) is the first fault and stays. From then on the turns stop, and the peg is retracted with
    ``retract_speed`` for ``retract_time``. Then the feed stops, and ``stopped`` is 1. The feed is not moved if its
    drive is at fault (`FEED_FAULTS`) or at the upper end of its travel. ``blind`` is 1 after a fault of the sensor.

    The watchdog has no output to the controller: the policy does not see what the drives report.
    """

    def __init__(self, *, period: float, retract_speed: float, retract_time: float, step_angle: float) -> None:
        """Stores the limits.

        Args:
            period: of the controller, s.
            retract_speed: of the retraction after a fault, m/s.
            retract_time: duration of this retraction, s.
            step_angle: angle of a step of both steppers, rad.
        """
        super().__init__()
        self._period, self._retract_speed, self._retract_time = period, retract_speed, retract_time
        self._lost_lag = LOST_LAG * step_angle
        self._commands = {name: self.DeclareVectorInputPort(name, 1) for name in COMMANDS}
        self._failed = self.DeclareVectorInputPort("controller_failed", 1)
        self._monitors = [self.DeclareVectorInputPort(name, 1) for name in MONITORS]
        self._shafts = {name: self.DeclareVectorInputPort(f"{name}_shaft", 2) for name in AXES}
        self._state = self.DeclareDiscreteState(np.zeros(Index.SIZE))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        for name in COMMANDS:
            self.DeclareVectorOutputPort(name, 1, self._gate(name), {*state, self._commands[name].ticket()})
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("blind", 1, self._calc_blind, state)
        self.DeclareVectorOutputPort("stopped", 1, self._calc_stopped, state)

    def _values(self, context: Context) -> list[float]:
        values: list[float] = context.get_discrete_state(self._state).value().tolist()
        return values

    def _command(self, name: str, context: Context) -> float:
        return float(self._commands[name].Eval(context)[0])

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = self._values(context)
        if state[Index.FAULT] != Fault.NONE:
            state[Index.SINCE] += self._period
        else:
            state[Index.FAULT] = float(self._find_fault(context))
        discrete_state.set_value(self._state, state)

    def _find_fault(self, context: Context) -> Fault:
        for monitor in self._monitors:
            fault = Fault(int(monitor.Eval(context)[0]))
            if fault is not Fault.NONE:
                return fault
        if self._failed.Eval(context)[0]:
            return Fault.CONTROLLER_FAILED
        for name, fault in AXES.items():
            commanded, measured = self._shafts[name].Eval(context)
            if abs(commanded - measured) > self._lost_lag:
                return fault
        return Fault.NONE

    def _gate(self, name: str) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            state = self._values(context)
            if state[Index.FAULT] == Fault.NONE:
                output[0] = self._command(name, context)
            elif name == "feed_speed":
                output[0] = self._retract_speed if self._retracts(state) else 0.0
            else:
                output[0] = 0.0

        return calc

    def _retracts(self, state: list[float]) -> bool:
        fault = Fault(int(state[Index.FAULT]))
        return not (self._is_stopped(state) or fault in FEED_FAULTS or fault is Fault.UPPER_TRAVEL_LIMIT)

    def _is_stopped(self, state: list[float]) -> bool:
        return state[Index.FAULT] != Fault.NONE and state[Index.SINCE] >= self._retract_time - 1e-9

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = self._values(context)[Index.FAULT]

    def _calc_blind(self, context: Context, output: BasicVector) -> None:
        output[0] = float(Fault(int(self._values(context)[Index.FAULT])) in SENSOR_FAULTS)

    def _calc_stopped(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._is_stopped(self._values(context)))
