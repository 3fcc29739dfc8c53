"""The limits that a resolved scenario gives the steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from systems.steps.drive_monitor import DriveLimits, Travel
from systems.steps.self_check import CheckLimits, MovingParts
from systems.steps.sensor_monitor import SensorLimits
from systems.steps.watchdog import LOST_LAG, RetractLimits

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario


def sensor_limits(scenario: Scenario) -> SensorLimits:
    """Returns what the sensor monitor takes."""
    return SensorLimits.of(
        scenario.sensor,
        top_speed=scenario.feed.no_load_speed,
        resolution=scenario.rig.encoder_resolution,
        depth_period=scenario.contact.time_step,
        load_limit=scenario.controller.guard.force_limit,
        reach=scenario.geometry.reach,
    )


def drive_limits(scenario: Scenario) -> DriveLimits:
    """Returns what the drive monitor takes."""
    return DriveLimits.of(
        scenario.controller.drive_monitor,
        motor=scenario.feed,
        travel=Travel.of(scenario),
        resolution=scenario.rig.encoder_resolution,
        period=scenario.contact.time_step,
    )


def check_limits(scenario: Scenario, *, mass: float, peg_weight: float) -> CheckLimits:
    """Returns what the self-check takes; see `MovingParts.of`."""
    return CheckLimits.of(
        sensor=scenario.sensor,
        motor=scenario.feed,
        stepper=scenario.stepper,
        parts=MovingParts.of(scenario, mass=mass, peg_weight=peg_weight),
        drive_period=scenario.contact.time_step,
    )


def retract_limits(scenario: Scenario) -> RetractLimits:
    """Returns what the watchdog takes."""
    p = scenario.controller
    return RetractLimits(
        period=p.period,
        retract_speed=p.back_off.retract_speed,
        retract_time=p.back_off.time,
        lost_lag=LOST_LAG * scenario.stepper.step_angle,
    )
