"""Checks that sensors can measure, and that their settings alone cause no false alarm."""

from __future__ import annotations

from collections.abc import Iterator

from models.hardware import WrenchSensorParameters
from models.validation import Violation

MIN_LEVELS = 10
"""Minimum ratio of range to quantum. A coarser sensor is at the end of its range at the first contact."""

MAX_DELAY = 1000
"""Maximum delay of a sensor, in its periods."""


def sensor_violations(sensor: WrenchSensorParameters) -> Iterator[Violation]:
    """Checks the quanta and the delay of the force/torque sensor."""
    for kind, unit, quantum, ranges in (
        ("force", "N", sensor.force_quantum, sensor.force_range),
        ("torque", "N m", sensor.torque_quantum, sensor.torque_range),
    ):
        if quantum * MIN_LEVELS > min(ranges):
            bound = f"at most a tenth of sensor.{kind}_range, {min(ranges) / MIN_LEVELS:.4g} {unit}"
            yield Violation(f"sensor.{kind}_quantum", f"{quantum} {unit}", bound)
    if not is_multiple(sensor.delay, sensor.period):
        yield Violation("sensor.delay", f"{sensor.delay} s", f"a multiple of sensor.period {sensor.period} s")
    if sensor.delay > MAX_DELAY * sensor.period:
        bound = f"at most {MAX_DELAY} times sensor.period {sensor.period} s"
        yield Violation("sensor.delay", f"{sensor.delay} s", bound)


def guard_violations(sensor: WrenchSensorParameters, *, peg_radius: float, ramp: float) -> Iterator[Violation]:
    """Checks that the sensor shows the load finely enough for the force guard.

    A force at the sensor has the lever ``sensor.height`` about the tip, so that its quantum is a large one of the load.

    Args:
        sensor: Parameters of the force/torque sensor.
        peg_radius: Radius of the peg, m.
        ramp: Range of the load in which the guard reduces feed and turns, N.
    """
    quantum = (sensor.torque_quantum + sensor.height * sensor.force_quantum) / peg_radius
    if quantum > ramp:
        bound = f"at most {ramp:.4g} N of load, controller.hold_force less controller.soft_force"
        yield Violation("sensor.force_quantum and sensor.torque_quantum", f"{quantum:.4g} N of load", bound)


def stall_violations(*, resolution: float, stall_depth: float, feed_stall_distance: float) -> Iterator[Violation]:
    """Checks that a feed that moves is seen to move.

    Args:
        resolution: Resolution of the depth encoder, m.
        stall_depth: Change of depth that counts as motion, m.
        feed_stall_distance: Commanded distance after which a feed without motion is stalled, m.
    """
    bound = (
        f"at most half of controller.feed_stall_distance {feed_stall_distance} m, or a moving feed counts as stalled"
    )
    for name, value in (("rig.encoder_resolution", resolution), ("controller.stall_depth", stall_depth)):
        if 2.0 * value > feed_stall_distance:
            yield Violation(name, f"{value} m", bound)


def is_multiple(value: float, step: float) -> bool:
    """Returns whether a duration is a whole number of steps, up to rounding."""
    return abs(value / step - round(value / step)) < 1e-6
