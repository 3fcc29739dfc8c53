"""The faults of hardware and controller that the rig detects by itself."""

from __future__ import annotations

from models.labelled_enum import LabelledEnum


class Fault(LabelledEnum):
    """A detected fault: the number is stored in run records, ``label`` is the text for messages."""

    NONE = 0, "none"
    SENSOR_DISCONNECTED = 1, "sensor disconnected"
    SENSOR_SATURATED = 2, "sensor saturated"
    SENSOR_STUCK = 3, "sensor stuck"
    ENCODER_DISCONNECTED = 4, "depth encoder disconnected"
    ENCODER_JUMPED = 5, "depth encoder jumped"
    ENCODER_STUCK = 6, "depth encoder stuck or slipping: it contradicts the feed drive's own encoder"
    MOTOR_STALLED = 7, "motor stalled"
    PITCH_STEPS_LOST = 8, "pitch stepper blocked or overloaded: steps lost"
    YAW_STEPS_LOST = 9, "yaw stepper blocked or overloaded: steps lost"
    CONTROLLER_FAILED = 10, "controller failed"
    SENSOR_BIASED = 11, "sensor biased: it reads a load in free air"
    SENSOR_NOISY = 12, "sensor too noisy"
    SENSOR_SPIKES = 13, "sensor spikes"
    FEED_RUNS_AWAY = 14, "feed drive runs away"
    FEED_DEAD = 15, "feed drive dead"
    UPPER_TRAVEL_LIMIT = 16, "upper travel limit"
    LOWER_TRAVEL_LIMIT = 17, "lower travel limit"
    CLOCKING_STEPS_LOST = 18, "clocking stepper blocked or overloaded: steps lost"


FEED_NUMBERS = (Fault.FEED_RUNS_AWAY.value, Fault.FEED_DEAD.value)
"""Numbers of the faults after which the feed drive is switched off, because it does not obey."""

SENSOR_NUMBERS = tuple(fault.value for fault in Fault if fault.name.startswith("SENSOR_"))
"""Numbers of the faults after which the wrench is not known."""

STEPS_LOST = (Fault.PITCH_STEPS_LOST.value, Fault.YAW_STEPS_LOST.value, Fault.CLOCKING_STEPS_LOST.value)
"""Numbers of the faults of the steppers, in the order of `skill.data.axes.AXES`."""


def error_summary(error: BaseException) -> str:
    """Returns the type of an exception and, if there is one, the first line of its message with text.

    At most 120 characters of this line are returned.
    """
    lines = [line.strip() for line in str(error).splitlines()]
    message = next((line for line in lines if line), "")
    return f"{type(error).__name__}: {message[:120]}" if message else type(error).__name__
