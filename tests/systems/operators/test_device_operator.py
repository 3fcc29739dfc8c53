"""Tests that a device is found through an entry point, and is read and written at 1 kHz."""

from fractions import Fraction

import numpy as np
import pytest
from pydrake.math import RigidTransform

from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.math.rotation import from_rotation_vector
from systems.operators.device_operator import GROUP, DeviceOperator, find_device
from systems.servo.servo_diagram import MakeServo
from systems.virtual_environment import start_pose


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """An installed package that provides a device."""
    info = tmp_path / "my_device-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-device\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nmine = fractions:Fraction\n")
    monkeypatch.syspath_prepend(str(tmp_path))


def test_a_device_is_found_by_an_entry_point_and_by_an_import_path(installed):
    assert find_device("mine") is find_device("fractions:Fraction") is Fraction
    for wrong in ("fractions:Nothing", "no_module:Device"):
        with pytest.raises(ValueError, match=f"'{wrong}': cannot be imported"):
            find_device(wrong)


def test_the_error_for_an_unknown_device_lists_the_known_ones(installed):
    with pytest.raises(
        ValueError,
        match=r"'joystick' is not installed; found \['inverse3', 'loopback', 'mine', 'spacemouse'\].*" + GROUP,
    ):
        find_device("joystick")


class Stepping:
    """A handle that jumps by 1 mm at the fifth reading; notes the size of each wrench, and when it got it."""

    START = RigidTransform(from_rotation_vector(np.array([0.3, 0.1, 0.0])), [0.01, 0.02, 0.03])

    def __init__(self):
        self.reads, self.wrenches = 0, {}

    def read_pose(self):
        self.reads += 1
        return RigidTransform([0.0, 0.0, 1e-3 * (self.reads >= 5)]) @ self.START

    def write_wrench(self, wrench):
        self.wrenches[self.reads] = np.linalg.norm(wrench)


def test_the_pose_of_the_handle_at_the_start_has_no_effect_and_a_force_is_written_in_the_tick_of_its_reading():
    """The margins of stability count no tick of delay."""
    scenario = resolve_scenario(load_scenario("device"), seed=0, stream=LIVE_STREAM)
    X, device = start_pose(scenario), Stepping()
    operator = DeviceOperator(device=device, period=1e-3, X_HD_start=X, moved_before=device.START)
    servo = MakeServo(scenario, operator=operator, X_HP_start=X)
    servo.start(X)
    for _ in range(6):
        servo.tick()
    assert list(device.wrenches) == list(range(7))
    assert max(size for reads, size in device.wrenches.items() if reads < 5) < 1.0
    assert device.wrenches[5] > 3.0
