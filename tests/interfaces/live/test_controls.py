"""Tests the controls of the page; Drake's Meshcat is the reference for the sliders."""

import math
import random

import pytest
import umsgpack
from pydrake.geometry import Meshcat, MeshcatParams

from interfaces.live.controls import Gamepad, LiveControls
from interfaces.live.messages import Outbox

PAGE = 1  # number of a browser


@pytest.fixture
def outbox():
    return Outbox()


@pytest.fixture
def dut(outbox):
    controls = LiveControls(outbox)
    controls.AddButton("keep", "KeyG")
    controls.AddSlider("depth", -10.0, 40.0, 0.5, 0.0, "KeyS", "KeyW")
    return controls


def pack(**event):
    return umsgpack.packb(event)


def state(controls):
    return controls.any_waiting("keep"), controls.GetSliderValue("depth"), controls.GetGamepad()


def pad(index=0, axes=(0.5, -1.0), **others):
    return {"index": index, "axes": list(axes), "button_values": [], **others}


def test_events_of_the_page_are_handled(dut):
    dut.receive(pack(type="button", name="keep"), PAGE)
    dut.receive(pack(type="slider", name="depth", value=3), PAGE)
    dut.receive(pack(type="gamepad", name="", gamepad=pad()), PAGE)
    assert state(dut) == (True, 3.0, Gamepad(0, (0.5, -1.0)))
    dut.receive(pack(type="gamepad", name="", gamepad={}), PAGE)  # disconnected
    assert state(dut) == (True, 3.0, Gamepad())


def test_every_click_is_handled_once_and_may_wait_or_be_forgotten(dut):
    dut.AddButton("quit", "KeyQ")
    dut.receive(pack(type="button", name="keep"), PAGE)
    assert dut.any_waiting("keep", "quit")
    assert not dut.any_waiting("quit")
    assert [dut.clicked(name) for name in ("quit", "keep", "keep")] == [False, True, False]
    for name in ("keep", "quit"):
        dut.receive(pack(type="button", name=name), PAGE)
    dut.forget_clicks("keep")
    assert [dut.clicked(name) for name in ("quit", "keep")] == [True, False]


def test_motions_are_told_and_counted_but_not_what_the_session_sets(dut):
    told = []
    dut.call_after_motion(lambda: told.append((dut.GetSliderValue("depth"), dut.slider_moves("depth"))))
    dut.SetSliderValue("depth", 7.0)
    assert (told, dut.slider_moves("depth")) == ([], 0)
    for _ in range(2):
        dut.receive(pack(type="slider", name="depth", value=3), PAGE)
    dut.receive(pack(type="button", name="keep"), PAGE)
    assert told == [(3.0, 1), (3.0, 2)]
    dut.receive(pack(type="gamepad", name="", gamepad=pad()), PAGE)
    assert len(told) == 3
    for _ in range(2):
        dut.forget(PAGE)  # its sticks are released
    assert len(told) == 4


JUNK = {
    "empty": b"",
    "text": "keep",
    "not msgpack": b"\xc1\xff\xfe",
    "cut off": pack(type="button", name="keep")[:-1],
    "huge length": b"\xdd\xff\xff\xff\xff",
    "nested": b"\x91" * 4000 + b"\x00",
    "infinite": pack(type="slider", name="depth", value=-math.inf),
    "a list": umsgpack.packb(["button", "keep"]),
    "unknown type": pack(type="set_object", name="keep"),
    "unhashable name": pack(type="button", name=["keep"]),
    "unknown button": pack(type="button", name="quit"),
    "button as a slider": pack(type="slider", name="keep", value=1.0),
    "no value": pack(type="slider", name="depth"),
    "NaN": pack(type="slider", name="depth", value=math.nan),
    "gamepad is a list": pack(type="gamepad", gamepad=[1.0]),
    "gamepad without index": pack(type="gamepad", gamepad={"axes": [0.0]}),
    "axis is NaN": pack(type="gamepad", gamepad=pad(axes=[0.0, math.nan])),
    "axis above 1": pack(type="gamepad", gamepad=pad(axes=[1.01])),
    "axis is a text": pack(type="gamepad", gamepad=pad(axes=["0"])),
    "a time that no clock has": umsgpack.packb({"type": umsgpack.Ext(-1, bytes(4) + b"\x7f" * 8)}),
}


def test_junk_changes_nothing(dut, outbox):
    before, (serial, _) = state(dut), outbox.since(0)
    for name, frame in JUNK.items():
        dut.receive(frame, PAGE)
        assert state(dut) == before, name
    assert outbox.since(serial) == (serial, [])


def test_random_and_damaged_frames_never_raise(dut):
    """2,000 frames: random bytes, and valid events in which a few bytes are changed."""
    rng = random.Random(0)
    events = [
        pack(type="button", name="keep"),
        pack(type="slider", name="depth", value=1.25),
        pack(type="gamepad", name="", gamepad=pad()),
    ]
    for k in range(2_000):
        frame = bytearray(rng.randbytes(rng.randrange(40)) if k % 2 else rng.choice(events))
        for _ in range(rng.randrange(1, 4) if frame else 0):
            frame[rng.randrange(len(frame))] = rng.randrange(256)
        dut.receive(bytes(frame), PAGE)
        _, depth, gamepad = state(dut)
        assert -10.0 <= depth <= 40.0
        assert all(abs(axis) <= 1.0 for axis in gamepad.axes)


def test_a_slider_takes_the_value_that_a_slider_of_drake_takes(dut):
    reference = Meshcat(MeshcatParams(host="127.0.0.1"))
    reference.AddSlider("depth", -10.0, 40.0, 0.5, 0.0)
    for value in (0.0, 0.24, 0.26, -3.1, 39.9, 41.0, -1e300, 1e300, 12.75, 3):
        reference.SetSliderValue("depth", value)
        dut.SetSliderValue("depth", value)
        assert dut.GetSliderValue("depth") == pytest.approx(reference.GetSliderValue("depth"), abs=1e-12), value


def test_a_slider_moves_in_the_other_browsers(dut, outbox):
    serial, _ = outbox.since(0)
    dut.receive(pack(type="slider", name="depth", value=7.0), PAGE)
    assert outbox.since(serial, reader=PAGE)[1] == []  # its own slider is there already; an echo would disturb a drag
    (message,) = outbox.since(serial, reader=PAGE + 1)[1]
    assert umsgpack.unpackb(message) == {
        "type": "set_control_value",
        "name": "depth",
        "value": 7.0,
        "invoke_callback": False,
    }


def test_a_gamepad_is_forgotten_with_its_browser_only(dut):
    dut.receive(pack(type="gamepad", gamepad=pad()), PAGE)
    dut.forget(PAGE + 1)
    assert dut.GetGamepad() == Gamepad(0, (0.5, -1.0))
    dut.forget(PAGE)
    assert dut.GetGamepad() == Gamepad()
