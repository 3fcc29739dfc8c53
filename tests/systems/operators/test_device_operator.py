"""Tests that a device is found through an entry point, and is read and written at 1 kHz."""

from fractions import Fraction

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.math.rotation import from_rotation_vector
from systems.operators.device_operator import GROUP, DeviceOperator, find_device
from systems.servo.servo_diagram import MakeServo
from systems.virtual_environment import start_pose
from tests.stepping import fixed_context


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


def test_the_pose_of_the_handle_at_the_start_has_no_effect():
    class FixedHandle:
        def read_pose(self):
            return RigidTransform(from_rotation_vector(np.array([0.3, 0.1, 0.0])), [0.01, 0.02, 0.03])

        def write_wrench(self, wrench):
            self.wrench = wrench

    start = RigidTransform(from_rotation_vector(np.array([0.02, -0.01, 0.0])), [0.0, 0.001, 0.002])
    device = FixedHandle()
    dut = DeviceOperator(device=device, period=1e-3, X_HD_start=start, moved_before=device.read_pose())
    context = fixed_context(dut, rendered_wrench=[1, 2, 3, 4, 5, 6])
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(1e-3)
    found = dut.GetOutputPort("hand_pose").Eval(context)
    np.testing.assert_allclose(found.GetAsMatrix34(), start.GetAsMatrix34(), atol=1e-12)
    np.testing.assert_array_equal(device.wrench, [1, 2, 3, 4, 5, 6])


def test_the_force_of_a_reading_is_written_in_the_same_tick():
    """The margins of stability count no tick of delay."""

    class Stepping:
        """A handle that jumps by 1 mm at the fifth reading; notes the size of each force, and when it got it."""

        def __init__(self):
            self.reads, self.forces = 0, {}

        def read_pose(self):
            self.reads += 1
            return RigidTransform([0.0, 0.0, 1e-3 * (self.reads >= 5)])

        def write_wrench(self, wrench):
            self.forces[self.reads] = np.linalg.norm(wrench[3:])

    scenario = resolve_scenario(load_scenario("device"), seed=0, stream=LIVE_STREAM)
    X, device = start_pose(scenario), Stepping()
    servo = MakeServo(scenario, operator=DeviceOperator(device=device, period=1e-3, X_HD_start=X), X_HP_start=X)
    servo.start(X)
    for _ in range(6):
        servo.tick()
    assert list(device.forces) == list(range(7))
    assert max(force for reads, force in device.forces.items() if reads < 5) < 1.0
    assert device.forces[5] > 3.0
