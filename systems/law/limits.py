"""The limits that a resolved scenario gives the steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from models.arm import RIG
from models.hardware import STEEL
from systems.law.drive_monitor import DriveLimits, Travel
from systems.law.sensor_monitor import SensorLimits
from systems.law.watchdog import LOST_LAG, RetractLimits

if TYPE_CHECKING:  # a scenario needs Drake
    from models.scenario import Scenario


def sensor_limits(scenario: Scenario) -> SensorLimits:
    """Returns what the sensor monitor takes; only the rig tells by its depth when the peg is in free air."""
    g, controller = scenario.geometry, scenario.controller
    rim = g.assembly.mouth_reach * math.sin(controller.max_turn)  # of the tilted hole above the centre of its mouth
    return SensorLimits.of(
        scenario.sensor,
        top_speed=scenario.feed.no_load_speed,
        resolution=scenario.rig.encoder_resolution,
        depth_period=scenario.contact.time_step,
        load_limit=controller.guard.force_limit,
        reach=g.reach,
        peg_mass=STEEL * g.assembly.volume,
        feed=scenario.feed,
        feed_speed=controller.max_feed_speed,
        free_depth=-rim if scenario.carrier == RIG else -math.inf,
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


def retract_limits(scenario: Scenario) -> RetractLimits:
    """Returns what the watchdog takes."""
    p = scenario.controller
    return RetractLimits(
        period=p.period,
        retract_speed=p.back_off.retract_speed,
        retract_time=p.back_off.time,
        lost_lag=LOST_LAG * scenario.stepper.step_angle,
    )
