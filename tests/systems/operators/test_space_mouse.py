"""The SpaceMouse, from its raw reports on: the real package, over a device that answers as one plugged in would."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform

import systems.operators.space_mouse
from systems.math.rotation import rotation_vector
from systems.operators.meshcat_operator import R_HV
from systems.operators.space_mouse import SPEED, TURN_RATE, SpaceMouse

pyspacemouse = pytest.importorskip("pyspacemouse", reason="needs the extra 'teleop'")
FULL = 350  # counts at full deflection, of every model


class Receiver:
    """Stands where the operating system's HID device does; reports as a SpaceNavigator does."""

    vendor_id, product_id = 0x046D, 0xC626
    product_string, manufacturer_string, serial_number, release_number = "SpaceNavigator", "3Dconnexion", "", 1

    def __init__(self):
        self.reports, self.plugged, self.is_open = [], True, False

    def open(self):
        self.is_open = True

    def close(self):
        self.is_open = False

    def set_nonblocking(self, wanted):
        assert wanted

    def read(self, size):
        if not self.plugged:
            from easyhid import HIDException

            raise HIDException("Failed to read from HID device: -1")
        return bytearray(self.reports.pop(0)[:size]) if self.reports else bytearray()


@pytest.fixture
def receiver(monkeypatch):
    """Plugged in, and a clock that goes on by a hundredth of a second at every look."""
    plugged = Receiver()
    monkeypatch.setattr("pyspacemouse.api.Enumeration", lambda: SimpleNamespace(find=lambda: [plugged]))
    ticks = iter(np.arange(0.0, 10.0, 0.01))
    monkeypatch.setattr(systems.operators.space_mouse, "time", SimpleNamespace(monotonic=lambda: next(ticks)))
    return plugged


def report(channel, x, y, z):
    """Channel 1 moves, channel 2 turns; in HID's own axes, x to the right, y toward the person, z down."""
    return struct.pack("<Bhhh", channel, x, y, z)


def lean(X: RigidTransform):
    """Where the axis of the peg points, as the person before the cut sees it: right, away, up."""
    return R_HV.inverse() @ X.rotation().col(2)


@pytest.mark.parametrize(
    ("counts", "direction"),
    [((FULL, 0, 0), (1, 0, 0)), ((0, FULL, 0), (0, -1, 0)), ((0, 0, FULL), (0, 0, -1)), ((10, -10, 10), (0, 0, 0))],
)
def test_a_push_moves_the_hand_the_way_the_person_pushes(receiver, counts, direction):
    dut = SpaceMouse()
    receiver.reports = [report(1, *counts)]
    for _ in range(5):
        X = dut.read_pose()  # the deflection holds until another is reported
    np.testing.assert_allclose(R_HV.inverse() @ X.translation(), 0.05 * SPEED * np.array(direction), atol=1e-12)
    np.testing.assert_allclose(rotation_vector(X.rotation()), 0.0, atol=1e-12)
    receiver.reports = [report(1, 0, 0, 0)]
    assert dut.read_pose().IsExactlyEqualTo(dut.read_pose())


@pytest.mark.parametrize(
    ("counts", "direction"),
    [((FULL, 0, 0), (0, -1)), ((-FULL, 0, 0), (0, 1)), ((0, FULL, 0), (-1, 0)), ((0, 0, FULL), (0, 0))],
)
def test_a_tilt_leans_the_peg_the_way_the_person_tilts(receiver, counts, direction):
    """About HID's x, to the right, by the right hand's rule in x right, y toward the person, z down."""
    dut = SpaceMouse()
    receiver.reports = [report(2, *counts)]
    for _ in range(5):
        X = dut.read_pose()
    np.testing.assert_allclose(lean(X)[:2], np.sin(0.05 * TURN_RATE) * np.array(direction), atol=1e-12)


def test_a_long_silence_is_not_made_up_for(receiver, monkeypatch):
    dut = SpaceMouse()
    receiver.reports = [report(1, FULL, 0, 0)]
    monkeypatch.setattr(systems.operators.space_mouse, "time", SimpleNamespace(monotonic=lambda: 100.0))
    np.testing.assert_allclose(np.linalg.norm(dut.read_pose().translation()), 0.1 * SPEED)


def test_one_that_is_unplugged_is_a_device_that_is_gone(receiver):
    dut = SpaceMouse()
    dut.read_pose()
    receiver.plugged = False
    with pytest.raises(OSError, match="the SpaceMouse is gone"):
        dut.read_pose()
    dut.close()
    assert not receiver.is_open


def test_none_is_said_to_be_missing(monkeypatch):
    monkeypatch.setattr("pyspacemouse.api.Enumeration", lambda: SimpleNamespace(find=list))
    with pytest.raises(OSError, match="no SpaceMouse found"):
        SpaceMouse()
