"""An arm of Universal Robots by the package ur_rtde, against a controller on loopback."""

import sys
import threading
import time
from contextlib import closing

import numpy as np
import pytest

from interfaces.robots.ur_arm import ACCELERATION, GAIN, JOINT_STOP, LOOKAHEAD, PATIENCE, UrArm
from interfaces.sensors.rtde_wrench import RtdeWrench
from tests.interfaces.robots.fake_rtde import (
    MOVEJ,
    POWER_ON,
    SERVO_STOP,
    SERVOJ,
    SET_PAYLOAD,
    SET_TCP,
    STOP_SCRIPT,
    STOPJ,
    FakeUr,
)
from tests.waiting import until

pytestmark = pytest.mark.slow  # the package waits half a second at the end of a connection

ELSEWHERE = np.array([0.2, -1.4, 1.4, -1.5, -1.6, 0.1])
RATES = np.array([0.1, 0.0, -0.1, 0.0, 0.05, 0.0])


@pytest.fixture
def controller():
    pytest.importorskip("rtde_control", reason="needs the extra 'ur'")
    with FakeUr() as controller:
        yield controller


@pytest.fixture
def arm(controller):
    arm = UrArm(controller.host)
    yield arm
    arm.close()


def sent(controller, command):
    """Returns what came with each message of a command."""
    return [tuple(values) for number, *values in controller.get("commands") if number == command]


def test_the_state_is_that_of_the_arm_and_the_tool_centre_point_is_the_flange(controller, arm):
    state = arm.state()
    np.testing.assert_array_equal(state.angles, controller.get("q"))
    np.testing.assert_array_equal(state.rates, np.zeros(6))
    np.testing.assert_array_equal(state.wrench, controller.get("force"))
    assert state.fault == ""
    assert sent(controller, SET_TCP) == [(0.0,) * 6]
    assert "servoj(q, t=dt, lookahead_time=lh_time, gain=g)" in controller.get("script")


def test_it_waits_for_the_records_of_its_program(controller, monkeypatch):
    """The package holds the interpreter while it starts the program: records of before are read after it."""
    record, old = RtdeWrench.record, list(range(10))

    def late(sensor):
        found = record(sensor)
        return found._replace(robot=POWER_ON) if old and old.pop() >= 0 else found

    monkeypatch.setattr(RtdeWrench, "record", late)
    with closing(UrArm(controller.host)) as arm:
        assert arm.state().fault == ""


def test_it_moves_to_angles_no_faster_than_it_is_told_and_waits_until_it_is_there(controller, arm):
    begun = time.monotonic()
    arm.move_to(ELSEWHERE, 0.5)
    assert time.monotonic() - begun > 0.2 / 0.5
    np.testing.assert_allclose(controller.get("q"), ELSEWHERE, atol=1e-3)
    assert sent(controller, MOVEJ) == [(*ELSEWHERE, 0.5, ACCELERATION, 1)]


def test_it_is_told_where_the_joints_will_be_after_the_lookahead_and_comes_to_rest_there(controller, arm):
    arm.follow(ELSEWHERE, RATES)
    target = ELSEWHERE + LOOKAHEAD * RATES
    assert until(lambda: np.abs(arm.state().angles - target).max() < 1e-6 and not arm.state().rates.any())
    assert sent(controller, SERVOJ) == [(*target, 0.0, 0.0, arm.period, LOOKAHEAD, GAIN)]


def test_a_stop_ends_what_the_arm_does(controller, arm):
    arm.follow(ELSEWHERE, RATES)
    arm.stop()
    assert sent(controller, SERVO_STOP) == [(10.0,)]
    arm.stop()
    assert sent(controller, STOPJ) == [(JOINT_STOP, 0)]
    arm.move_to(ELSEWHERE, 3.0)  # it can be moved again


def test_the_tool_is_said_in_the_frame_of_the_flange(controller, arm):
    arm.set_tool(0.8, np.array([0.0, 0.01, 0.05]))
    arm.set_tool(0.8, np.zeros(3))
    first, second = sent(controller, SET_PAYLOAD)
    assert first == (0.8, 0.0, 0.01, 0.05)
    assert second == (0.8, 1e-9, 1e-9, 1e-9)  # for zeros the program keeps the centre that it has


@pytest.mark.parametrize(
    ("name", "value", "fault"),
    [
        ("safety", 1 << 2, "protective stop, no program runs"),
        ("safety", (1 << 6) | (1 << 7), "robot emergency stop, emergency stop, no program runs"),
        ("power", 0, "power is off"),
    ],
)
def test_an_arm_that_has_stopped_says_why(controller, arm, name, value, fault):
    arm.follow(ELSEWHERE, RATES)
    controller.set(name, value)
    assert until(lambda: arm.state().fault == fault)
    with pytest.raises(ConnectionError, match=rf"{controller.host}:30004: the arm does not follow: {fault}"):
        arm.follow(ELSEWHERE, RATES)
    controller.set("power", POWER_ON)


def test_a_stop_on_the_way_is_named(controller, arm):
    timer = threading.Timer(0.3, controller.set, ("safety", 1 << 4))
    timer.start()
    with pytest.raises(ConnectionError, match="the arm has stopped on its way: safeguard stop, no program runs"):
        arm.move_to(ELSEWHERE, 0.1)
    timer.join()


def test_an_arm_that_does_not_get_there_is_named(controller, arm):
    controller.set("held", True)
    begun = time.monotonic()
    with pytest.raises(ConnectionError, match=r"the arm stands still at .* rad, on its way to"):
        arm.move_to(ELSEWHERE, 0.5)
    assert time.monotonic() - begun > PATIENCE


def test_an_arm_that_no_longer_answers_is_named(controller, arm):
    controller.set("silent", True)
    time.sleep(0.2)
    for command in (arm.state, arm.stop, lambda: arm.follow(ELSEWHERE, RATES)):
        with pytest.raises(ConnectionError, match="no longer answers"):
            command()
    controller.set("silent", False)
    assert until(lambda: arm.sensor.latest().time > time.monotonic() - 0.05)


def test_the_end_stops_the_program(controller):
    arm = UrArm(controller.host)
    arm.follow(ELSEWHERE, RATES)
    arm.close()
    assert [number for number, *_ in controller.get("commands")][-2:] == [SERVO_STOP, STOP_SCRIPT]


def test_an_arm_that_is_not_in_remote_control_is_named(controller):
    controller.set("remote", "false")
    with pytest.raises(
        ConnectionError, match=r"takes no commands \(.*remote control.*\); expected one in remote control"
    ):
        UrArm(controller.host)


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "rtde_control", None)
    with pytest.raises(ModuleNotFoundError, match="rtde_control"):
        UrArm("127.9.8.7")
