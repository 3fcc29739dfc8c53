"""Tests the SpaceMouse with the real package and a simulated HID device that sends raw reports."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest

import systems.operators.space_mouse
from systems.operators.person_frame import R_HV
from systems.operators.space_mouse import SpaceMouse

pyspacemouse = pytest.importorskip("pyspacemouse", reason="needs the extra 'teleop'")
FULL = 350  # counts at full deflection, the same for every model


class Receiver:
    """Replaces the HID device of the operating system; sends the reports of a SpaceNavigator."""

    vendor_id, product_id = 0x046D, 0xC626
    product_string, manufacturer_string, serial_number, release_number = "SpaceNavigator", "3Dconnexion", "", 1

    def __init__(self):
        self.reports, self.connected, self.is_open = [], True, False

    def open(self):
        self.is_open = True

    def close(self):
        self.is_open = False

    def set_nonblocking(self, nonblocking):
        assert nonblocking

    def read(self, size):
        if not self.connected:
            from easyhid import HIDException

            raise HIDException("Failed to read from HID device: -1")
        return bytearray(self.reports.pop(0)[:size]) if self.reports else bytearray()


@pytest.fixture
def receiver(monkeypatch):
    """A connected device, and a clock that advances by 0.01 s at every reading."""
    device = Receiver()
    monkeypatch.setattr("pyspacemouse.api.Enumeration", lambda: SimpleNamespace(find=lambda: [device]))
    ticks = iter(np.arange(0.0, 10.0, 0.01))
    monkeypatch.setattr(systems.operators.space_mouse, "time", SimpleNamespace(monotonic=lambda: next(ticks)))
    return device


def report(channel, x, y, z):
    """A report of translation (channel 1) or rotation (channel 2) in HID axes: x right, y to the person, z down."""
    return struct.pack("<Bhhh", channel, x, y, z)


@pytest.mark.parametrize(
    ("channel", "counts", "moved", "leaned"),
    [
        (1, (FULL, 0, 0), (1, 0, 0), (0, 0)),
        (1, (0, FULL, 0), (0, -1, 0), (0, 0)),
        (1, (0, 0, FULL), (0, 0, -1), (0, 0)),
        (2, (FULL, 0, 0), (0, 0, 0), (0, -1)),
        (2, (-FULL, 0, 0), (0, 0, 0), (0, 1)),
        (2, (0, FULL, 0), (0, 0, 0), (-1, 0)),
        (2, (0, 0, FULL), (0, 0, 0), (0, 0)),
    ],
)
def test_a_deflection_moves_the_hand_or_leans_the_peg_in_its_direction(receiver, channel, counts, moved, leaned):
    """By 30 mm or 8 degrees in a second; turns are right-handed about the HID axes. It lasts until the next report."""
    dut = SpaceMouse()
    receiver.reports = [report(channel, *counts)]
    for _ in range(5):
        X = dut.read_pose()
    np.testing.assert_allclose(R_HV.inverse() @ X.translation(), 0.05 * 0.030 * np.array(moved), atol=1e-12)
    lean = R_HV.inverse() @ X.rotation().col(2)  # of the peg's axis in the frame of the person
    np.testing.assert_allclose(lean[:2], np.sin(0.05 * np.radians(8.0)) * np.array(leaned), atol=1e-12)
    receiver.reports = [report(channel, 0, 0, 0)]
    assert dut.read_pose().IsExactlyEqualTo(dut.read_pose())


@pytest.mark.parametrize(("share", "moves"), [(0.04, False), (-0.04, False), (0.06, True), (-0.06, True)])
@pytest.mark.parametrize("channel", [1, 2])
def test_deflections_below_5_percent_are_ignored(receiver, channel, share, moves):
    dut = SpaceMouse()
    receiver.reports = [report(channel, round(share * FULL), 0, 0)]
    X = dut.read_pose()
    assert X.IsNearlyIdentity(1e-12) != moves


def test_a_long_time_between_readings_is_not_integrated(receiver, monkeypatch):
    dut = SpaceMouse()
    receiver.reports = [report(1, FULL, 0, 0)]
    monkeypatch.setattr(systems.operators.space_mouse, "time", SimpleNamespace(monotonic=lambda: 100.0))
    np.testing.assert_allclose(np.linalg.norm(dut.read_pose().translation()), 0.003)  # 30 mm/s for 0.1 s


def test_a_disconnected_spacemouse_raises_an_oserror(receiver):
    dut = SpaceMouse()
    dut.read_pose()
    receiver.connected = False
    with pytest.raises(OSError, match="the SpaceMouse is disconnected"):
        dut.read_pose()
    dut.close()
    assert not receiver.is_open


def test_a_missing_spacemouse_raises_an_oserror(monkeypatch):
    monkeypatch.setattr("pyspacemouse.api.Enumeration", lambda: SimpleNamespace(find=list))
    with pytest.raises(OSError, match="no SpaceMouse found"):
        SpaceMouse()
