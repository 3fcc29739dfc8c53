"""The watchdog: it passes commands to the motors, and retracts the peg and stops after a fault."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem

from skill.arrays import Array
from skill.data.axes import AXES
from systems.steps.watchdog import FAULT, SIZE, RetractLimits, is_blind, is_stopped, passed_command, watchdog_step

COMMANDS = ("pitch_rate", "yaw_rate", "clocking_rate", "feed_speed", "unwinding")
MONITORS = ("sensor_monitor_fault", "drive_monitor_fault")


class Watchdog(LeafSystem):
    """
    .. pydrake_system::

        name: Watchdog
        input_ports:
        - pitch_rate
        - yaw_rate
        - clocking_rate
        - feed_speed
        - unwinding
        - controller_failed
        - sensor_monitor_fault
        - drive_monitor_fault
        - pitch_shaft
        - yaw_shaft
        output_ports:
        - pitch_rate
        - yaw_rate
        - clocking_rate
        - feed_speed
        - unwinding
        - fault
        - blind
        - stopped

    Every period the watchdog collects the faults of the `SensorMonitor`, the `DriveMonitor`, the controller and the
    steppers by `watchdog_step`; ``fault`` (`Fault`) is the first one and stays. What goes on to the
    motors is in `passed_command`. ``stopped`` is 1 when the peg has been retracted after a fault, ``blind`` after a
    fault of the sensor. A ``shaft`` is [commanded, measured] angle, rad.

    The watchdog has no output to the controller: the policy does not see what the drives report.

    Args:
        limits: what it does after a fault.
        axes: names of the steppers, each with an input ``<name>_shaft``.
    """

    def __init__(self, limits: RetractLimits, axes: Sequence[str] = AXES[:2]) -> None:
        super().__init__()
        self._limits = limits
        self._commands = [self.DeclareVectorInputPort(name, 1) for name in COMMANDS]
        self._failed = self.DeclareVectorInputPort("controller_failed", 1)
        self._monitors = [self.DeclareVectorInputPort(name, 1) for name in MONITORS]
        self._shafts = [self.DeclareVectorInputPort(f"{name}_shaft", 2) for name in axes]
        self._state = self.DeclareDiscreteState(SIZE)
        self.DeclarePeriodicDiscreteUpdateEvent(limits.period, 0.0, self._update)
        state = {self.discrete_state_ticket(self._state)}
        for place, name in enumerate(COMMANDS):
            inputs = {*state, self._commands[place].ticket()}
            self.DeclareVectorOutputPort(name, 1, self._gate(place), inputs)
        self.DeclareVectorOutputPort("fault", 1, self._calc_fault, state)
        self.DeclareVectorOutputPort("blind", 1, self._calc_blind, state)
        self.DeclareVectorOutputPort("stopped", 1, self._calc_stopped, state)

    def _values(self, context: Context) -> Array:
        return np.array(context.get_discrete_state(self._state).value())

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        found = watchdog_step(
            self._limits,
            self._values(context),
            np.array([port.Eval(context)[0] for port in self._monitors]),
            self._failed.Eval(context)[0] != 0.0,
            np.reshape([port.Eval(context) for port in self._shafts], (-1, 2)),
        )
        discrete_state.set_value(self._state, found)

    def _gate(self, place: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            command = self._commands[place].Eval(context)[0]
            output[0] = passed_command(self._limits, self._values(context), place, command)

        return calc

    def _calc_fault(self, context: Context, output: BasicVector) -> None:
        output[0] = context.get_discrete_state(self._state)[FAULT]

    def _calc_blind(self, context: Context, output: BasicVector) -> None:
        output[0] = float(is_blind(self._values(context)))

    def _calc_stopped(self, context: Context, output: BasicVector) -> None:
        output[0] = float(is_stopped(self._limits, self._values(context)))
