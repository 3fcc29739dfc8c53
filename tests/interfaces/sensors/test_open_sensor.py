"""Sensors by their address, and the estimate of an arm as a sensor."""

import time

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from interfaces.robots.arm_wrench import ArmWrench
from interfaces.robots.robot_arm import ArmState
from interfaces.sensors import open_sensor as module
from interfaces.sensors.open_sensor import open_sensor


class StillArm:
    """An arm that reports one wrench, at a time and with a fault that can be changed."""

    def __init__(self, wrench):
        self.time, self.wrench, self.fault = 0.0, np.array(wrench), ""

    def state(self):
        return ArmState(self.time, np.array([0.5 * np.pi, 0.0]), np.zeros(2), self.wrench, self.fault)


class Kinematics:
    """Those of an arm whose sensor is turned about z by its first joint."""

    def tip(self, angles):
        return RigidTransform(RotationMatrix.MakeZRotation(angles[0]), np.zeros(3))


def test_the_wrench_is_moved_along_the_lever_and_turned_at_the_angles_of_the_arm():
    """10 N along y of the base act 0.1 m below the flange: (0, 0, -0.1) x (0, 10, 0) = (1, 0, 0) N m about it.

    The sensor is 40 mm below the flange, where 0.6 N m are left. It is turned by 90 deg about z: its x axis points
    along y of the base, and x of the base along its minus y.
    """
    stream = ArmWrench(StillArm([0.0, 10.0, 0.0, 1.0, 0.0, 0.0]), Kinematics())
    np.testing.assert_allclose(stream.latest().wrench, [10.0, 0.0, 0.0, 0.0, -0.6, 0.0], atol=1e-12)


def test_a_reading_is_as_old_as_the_state_of_the_arm():
    arm = StillArm([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    stream = ArmWrench(arm, Kinematics())
    first = stream.latest()
    assert 0.0 <= time.monotonic() - first.time < 0.5
    assert stream.latest() is first
    arm.time, arm.fault = 0.008, "protective stop"
    second = stream.latest()
    assert second.time > first.time
    assert (first.sound, second.sound) == (True, False)
    assert stream.counts().text() == "2 received, 1 faulty"


@pytest.mark.parametrize(
    ("url", "opened"),
    [
        ("netft://sensor", ("sensor", 49152, 80)),
        ("netft://10.0.0.2:5000", ("10.0.0.2", 5000, 80)),
        ("netft://10.0.0.2:5000:8080", ("10.0.0.2", 5000, 8080)),
    ],
)
def test_ports_that_are_not_named_are_those_of_the_sensors(monkeypatch, url, opened):
    monkeypatch.setattr(module, "NetFt", lambda host, *, port, http_port: (host, port, http_port))
    assert open_sensor(url) == opened


def test_the_address_of_the_arm_is_its_own_estimate():
    stream = ArmWrench(StillArm(np.zeros(6)), Kinematics())
    assert open_sensor("arm:", stream) is stream
    with pytest.raises(ValueError, match="sensor 'arm:': there is no arm that estimates a wrench"):
        open_sensor("arm:")


@pytest.mark.parametrize(
    "url",
    ["", "192.168.1.1", "ur://10.0.0.1", "netft:", "netft://", "netft://a:b", "netft://a:0", "netft://a:1:70000",
     "netft://a:1:2:3", "netft://a/", "netft://a b", "arm:ur"],
)  # fmt: skip
def test_other_addresses_are_refused_in_one_sentence(url):
    with pytest.raises(ValueError, match=r"expected netft://HOST\[:PORT\[:HTTPPORT\]\], such as .*, or arm:$") as error:
        open_sensor(url)
    assert repr(url) in str(error.value)
