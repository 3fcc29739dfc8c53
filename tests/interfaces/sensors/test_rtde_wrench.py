"""The stream of an arm's own sensor, against a controller on loopback whose stream is disturbed."""

import socket
import struct
import threading
import time

import numpy as np
import pytest

from interfaces.sensors.rtde_wrench import PORT, RtdeWrench
from tests.interfaces.robots.fake_rtde import FakeUr
from tests.waiting import until

PROTECTIVE_STOP = 1 << 2


@pytest.fixture
def pair():
    with FakeUr() as controller:
        stream = RtdeWrench(controller.host)
        yield controller, stream
        stream.close()


def test_the_wrench_is_that_in_the_frame_of_the_tool_and_nothing_is_counted(pair):
    """By hand: the tool is turned by 90° about z, so that its x axis is y of the base."""
    _, stream = pair
    assert until(lambda: stream.counts().received >= 100)
    np.testing.assert_allclose(stream.latest().wrench, [2.0, -1.0, 3.0, 0.2, -0.1, 0.3], atol=1e-12)
    assert stream.latest().sound
    assert time.monotonic() - stream.latest().time < 0.5
    counts = stream.counts()
    assert counts.text() == f"{counts.received} received"


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("skipped", 3, {"lost": 3}),
        ("junk", struct.pack("!HcB", 4, b"U", 1), {"malformed": 1}),
        ("junk", struct.pack("!Hc4s", 7, b"M", b"text"), {}),
        ("time", 1.0, {"restarts": 1}),
    ],
    ids=["skipped", "too short", "a text", "a clock that began anew"],
)
def test_every_disturbance_is_counted(pair, name, value, expected):
    controller, stream = pair
    controller.set(name, value)
    before = stream.counts().received
    assert until(lambda: stream.counts().received > before + 50)
    assert {name: n for name, n in vars(stream.counts()).items() if n and name != "received"} == expected
    assert stream.latest().sound


def test_an_arm_that_is_stopped_for_safety_reads_nothing_sound(pair):
    controller, stream = pair
    controller.set("safety", PROTECTIVE_STOP)
    assert until(lambda: stream.counts().faulty > 10)
    assert not stream.latest().sound
    controller.set("safety", 1)
    assert until(lambda: stream.latest().sound)


def test_a_silence_is_counted_and_named_and_the_stream_goes_on(pair):
    controller, stream = pair
    controller.set("silent", True)
    assert until(lambda: stream.counts().silences >= 3)
    with pytest.raises(ConnectionError, match=rf"{controller.host}:30004: the arm no longer answers \(silence\)"):
        stream.record()
    controller.set("silent", False)
    silent = time.monotonic()
    assert until(lambda: stream.latest().time > silent)
    assert stream.record().arrival > silent


def test_a_controller_that_goes_away_is_named(pair):
    controller, stream = pair
    controller.__exit__()
    assert until(lambda: stream._lost)
    with pytest.raises(ConnectionError, match=r"the arm no longer answers \(it has ended the connection\)"):
        stream.record()


def test_a_controller_that_is_too_old_is_named(pair):
    controller, _ = pair
    controller.set("version", 3)
    with pytest.raises(ConnectionError, match=r":30004: the version of its controller is 3, and must be 5 at least"):
        RtdeWrench(controller.host)


def test_an_address_without_an_arm_is_named():
    with pytest.raises(ConnectionError, match=r"127.9.8.7:30004: no answer .* expected an arm of Universal Robots"):
        RtdeWrench("127.9.8.7")


def test_a_server_that_speaks_something_else_is_named():
    server = socket.create_server(("127.9.8.6", PORT))
    threading.Thread(target=lambda: server.accept()[0].sendall(b"\0\0\0"), daemon=True).start()
    with server, pytest.raises(ConnectionError, match=r"127.9.8.6:30004: .*; expected RTDE of an arm"):
        RtdeWrench("127.9.8.6")
