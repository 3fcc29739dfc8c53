"""The faults of the rig's hardware and controller that it can notice by itself, and their names."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Self

from models.hardware import WrenchSensorParameters


class Fault(IntEnum):
    """What is wrong, as it is written into a run's record; ``label`` is the text for a person."""

    label: str

    NONE = 0, "none"
    SENSOR_DISCONNECTED = 1, "sensor disconnected"
    SENSOR_SATURATED = 2, "sensor saturated"
    SENSOR_STUCK = 3, "sensor stuck"
    ENCODER_DISCONNECTED = 4, "depth encoder disconnected"
    ENCODER_JUMPED = 5, "depth encoder jumped"
    ENCODER_STUCK = 6, "depth encoder stuck"
    MOTOR_STALLED = 7, "motor stalled"
    PITCH_STEPS_LOST = 8, "pitch stepper blocked or overloaded: steps lost"
    YAW_STEPS_LOST = 9, "yaw stepper blocked or overloaded: steps lost"
    CONTROLLER_FAILED = 10, "controller failed"

    def __new__(cls, value: int, label: str = "") -> Self:
        """A member of this number and label."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.label = label
        return member


FALSE_ALARM = 1e-9
"""Probability that a healthy sensor repeats itself for as long as counts as stuck."""


def repeats_of_a_stuck_sensor(p: WrenchSensorParameters) -> float:
    """How often in a row all six readings may be the same before the sensor counts as stuck; inf if it has no noise.

    A channel with noise sigma and quantum q repeats its reading with probability at most erf(q / (2 sqrt(2) sigma)),
    which it is when the true value is in the middle of a quantum. Channels and samples have independent noise.
    """
    sigmas = [*p.force_noise, *p.torque_noise]
    quanta = [p.force_quantum] * 3 + [p.torque_quantum] * 3
    repeat = math.prod(
        math.erf(q / (2.0 * math.sqrt(2.0) * sigma)) if sigma > 0 else 1.0
        for sigma, q in zip(sigmas, quanta, strict=True)
    )
    return math.ceil(math.log(FALSE_ALARM) / math.log(repeat)) if repeat < 1.0 else math.inf


def one_line(error: BaseException) -> str:
    """The type and the first line of an exception, for the outcome of a run."""
    return f"{type(error).__name__}: {(str(error).splitlines() or [''])[0][:120]}"
