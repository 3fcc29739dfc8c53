"""The watchdog: what it passes on in one period of the controller."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from compiled import compiled
from skill.arrays import Array
from skill.data.axes import AXES
from systems.law.faults import FEED_NUMBERS, SENSOR_NUMBERS, STEPS_LOST, Fault
from systems.law.part import Part

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario

LOST_LAG = 2.5  # steps; a rotor that lags by two has slipped, and lags by four as soon as it rests

FAULT, SINCE, BLIND, SIZE = range(4)
"""Places in the state: the first fault found, the time since, s, and whether the sensor has one; and its size."""

PITCH_RATE, YAW_RATE, CLOCKING_RATE, FEED, UNWINDING = range(5)
"""Places in the commands: three in rad/s, one in m/s, and whether the hole is to turn back."""

COMMANDS = ("pitch_rate", "yaw_rate", "clocking_rate", "feed_speed", "unwinding")
MONITORS = ("sensor_monitor_fault", "drive_monitor_fault")
"""The input ports of the commands, and of the monitors."""


class RetractLimits(NamedTuple):
    """What the watchdog does after a fault.

    Attributes:
        period: of the controller, s.
        retract_speed: m/s.
        retract_time: s.
        lost_lag: lag of a stepper that has lost steps, rad.
    """

    period: float
    retract_speed: float
    retract_time: float
    lost_lag: float

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the limits of a scenario."""
        p = scenario.controller
        return cls(p.period, p.back_off.retract_speed, p.back_off.time, LOST_LAG * scenario.stepper.step_angle)


@compiled
def watchdog_step(p: RetractLimits, state: Array, faults: Array, failed: bool, shafts: Array) -> Array:
    """Returns the next state (SIZE,).

    The first fault stays: that of a monitor, in their order, that of the controller, or that of a stepper. A stepper
    has lost steps if the encoder on its shaft lags its commanded angle by more than `LOST_LAG` steps.

    Args:
        p: limits.
        state: (SIZE,), after the last period.
        faults: (n,), of the monitors.
        failed: whether the policy has failed.
        shafts: (n, 2), [commanded, measured] angle of each stepper, rad.
    """
    found = state.copy()
    for fault in faults:
        if int(fault) in SENSOR_NUMBERS:
            found[BLIND] = 1.0
    if state[FAULT] != 0.0:
        found[SINCE] += p.period
        return found
    for fault in faults:
        if fault != 0.0:
            found[FAULT] = fault
            return found
    if failed:
        found[FAULT] = Fault.CONTROLLER_FAILED.value
        return found
    for axis in range(len(shafts)):
        if abs(shafts[axis, 0] - shafts[axis, 1]) > p.lost_lag:
            found[FAULT] = STEPS_LOST[axis]
            return found
    return found


@compiled
def passed_command(p: RetractLimits, place: int, state: Array, command: float) -> float:
    """Returns what goes on of the command at a place.

    After a fault the turns stop, and the peg is retracted for ``retract_time``; then the feed stops. The feed is not
    moved if its drive is at fault or at the upper end of its travel.
    """
    if state[FAULT] == 0.0:
        return command
    fault = int(state[FAULT])
    rests = is_stopped(p, state) or fault in FEED_NUMBERS or fault == Fault.UPPER_TRAVEL_LIMIT.value
    return p.retract_speed if place == FEED and not rests else 0.0


@compiled
def is_stopped(p: RetractLimits, state: Array) -> bool:
    """Returns whether the peg has been retracted after a fault."""
    return bool(state[FAULT] != 0.0 and state[SINCE] >= p.retract_time - 1e-9)


@compiled
def is_blind(state: Array) -> bool:
    """Returns whether the sensor has a fault, the first one or a later one: its readings are then held, and old."""
    return bool(state[BLIND] != 0.0)


class Watchdog(Part):
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
        def step(state: Array, *inputs: Any) -> Array:
            failed, *others = inputs[len(COMMANDS) :]
            faults, shafts = np.array(others[: len(MONITORS)]), np.reshape(others[len(MONITORS) :], (-1, 2))
            return watchdog_step(limits, state, faults, failed != 0.0, shafts)

        inputs = dict.fromkeys((*COMMANDS, "controller_failed", *MONITORS), 1)
        shafts = {f"{name}_shaft": 2 for name in axes}
        super().__init__({**inputs, **shafts}, state=np.zeros(SIZE), period=limits.period, step=step)
        for place, name in enumerate(COMMANDS):
            self.declare_output(name, 1, partial(passed_command, limits, place), name)
        self.declare_output("fault", 1, itemgetter(FAULT))
        self.declare_output("blind", 1, is_blind)
        self.declare_output("stopped", 1, partial(is_stopped, limits))
