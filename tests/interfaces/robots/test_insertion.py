"""What stops an insertion with an arm: its sensor, its state, and the limits of force and place."""

import math

import numpy as np
import pytest

from interfaces.robots import insertion
from interfaces.robots.insertion import FORCE_LIMIT, READY_HEIGHT, SIDE_LIMIT, ArmSession
from interfaces.robots.robot_arm import ArmState
from interfaces.sensors.wrench_stream import Reading, StreamCounts
from models.scenario import load_scenario
from systems.arm.kinematics import ArmKinematics
from systems.arm.tip import X
from systems.arm.tip_servo import tip_at, tip_pose

SCENARIO = load_scenario("fr3")
KINEMATICS = ArmKinematics(SCENARIO)


class Arm:
    """An arm that is at once where it is told to be, and its sensor; both go on by a millisecond with each look."""

    period = 4e-3

    def __init__(self, tip=None):
        self.angles = KINEMATICS.angles_at(tip_pose(np.zeros(3), tip_at(0.003) if tip is None else tip))
        self.fault, self.wrench, self.is_sound, self.is_stopped = "", np.zeros(6), True, False
        self.time = self.sensor_time = 0.0
        self.step = self.sensor_step = 1e-3

    def state(self):
        self.time += self.step
        return ArmState(self.time, self.angles, np.zeros(7), np.zeros(6), self.fault)

    def follow(self, angles, rates):
        self.angles = angles

    def stop(self):
        self.is_stopped = True

    def latest(self):
        self.sensor_time += self.sensor_step
        return Reading(self.sensor_time, self.wrench, self.is_sound)

    def counts(self):
        return StreamCounts()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"is_sound": False}, "the sensor has no sound reading"),
        ({"sensor_step": 0.0}, "the sensor is silent"),
        ({"fault": "protective stop"}, "protective stop"),
        ({"step": 0.0}, "the arm sends no new state"),
    ],
)
def test_the_arm_is_stopped_where_it_or_its_sensor_stops_answering(monkeypatch, change, reason):
    monkeypatch.setattr(insertion, "PATIENCE", 0.05)
    arm = Arm()
    session = ArmSession(arm, arm, SCENARIO)
    np.testing.assert_array_equal(session.reading_along_base(), np.zeros(3))
    vars(arm).update(change)
    with pytest.raises(ConnectionError, match=f"stopped: {reason}"):
        session.reading_along_base()
    assert arm.is_stopped


@pytest.mark.parametrize(
    ("force", "aside", "reason"),
    [
        (0.99 * FORCE_LIMIT, 0.0, None),
        (1.01 * FORCE_LIMIT, 0.0, "a force of 81 N, beyond 80 N"),
        (math.nan, 0.0, "a force of nan N"),
        (0.0, 0.98 * SIDE_LIMIT, None),
        (0.0, 1.02 * SIDE_LIMIT, r"the peg is 5.1 mm beside the hole, beyond 5 mm"),
    ],
)
def test_the_arm_draws_the_peg_out_unless_a_limit_is_passed(force, aside, reason):
    tip = tip_at(-0.003)
    tip[X] = aside
    arm = Arm(tip)
    arm.wrench = np.array([0.0, 0.6 * force, 0.8 * force, 0.0, 0.0, 0.0])
    session = ArmSession(arm, arm, SCENARIO)
    session._commanded = np.zeros(3), tip
    if reason is None:
        session.retreat()
        assert KINEMATICS.tip(arm.angles).translation()[2] == pytest.approx(READY_HEIGHT, abs=2e-4)
    else:
        with pytest.raises(ConnectionError, match=f"stopped: {reason}"):
            session.retreat()
    assert arm.is_stopped


def test_a_peg_in_the_hole_is_not_moved_by_joints():
    arm = Arm(tip_at(-0.005))
    with pytest.raises(ConnectionError, match="the peg is in the hole"):
        ArmSession(arm, arm, SCENARIO).approach()
    assert arm.is_stopped
