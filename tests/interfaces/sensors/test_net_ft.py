"""The client of a Net F/T sensor against its server, on loopback."""

import time
from contextlib import closing

import numpy as np
import pytest

from interfaces.sensors import net_ft
from interfaces.sensors.net_ft import ERROR, OUT_OF_RANGE, RECORD, NetFt, parse_calibration
from interfaces.sensors.net_ft_server import NetFtServer
from interfaces.sensors.wrench_stream import WINDOW, WRAP, RecordOrder, StreamCounts
from tests.waiting import until

WRENCH = (1.0, -2.0, 3.0, 1e-4, 2e-4, -3e-4)


@pytest.fixture
def pair(monkeypatch):
    """A server and its client, which has a first record."""
    monkeypatch.setattr(net_ft, "PAGE_PERIOD", 0.02)
    with (
        closing(NetFtServer()) as server,
        closing(NetFt("127.0.0.1", port=server.port, http_port=server.http_port)) as stream,
    ):
        assert until(lambda: server.send(WRENCH) or stream.latest() is not None)
        yield server, stream


def stop_receiving(stream):
    stream._ended.set()
    stream._threads[0].join()


def without_silences(stream):
    return {name: n for name, n in vars(stream.counts()).items() if n and name != "silences"}


def test_the_newest_record_is_read_in_si_units_while_the_thread_waits(pair):
    server, stream = pair
    stop_receiving(stream)
    server.send((7.0, *WRENCH[1:]))
    reading = stream.latest()
    np.testing.assert_allclose(reading.wrench, (7.0, *WRENCH[1:]))
    assert reading.sound
    assert time.monotonic() - reading.time < 0.5
    assert without_silences(stream) == {"received": server.number - 1}


@pytest.mark.parametrize(
    ("status", "counted"),
    [(ERROR | OUT_OF_RANGE, {"overloaded": 1}), (ERROR | 4, {"faulty": 1}), (1 << 16, {})],
    ids=["overload", "fault", "a latched monitor condition, which is no error"],
)
def test_overloads_and_faults_are_counted_and_not_sound(pair, status, counted):
    server, stream = pair
    server.send(WRENCH, status)
    assert stream.latest().sound is not bool(counted)
    assert without_silences(stream) == {"received": server.number - 1, **counted}


def test_what_is_late_or_no_record_is_counted_and_not_used(pair):
    server, stream = pair
    stop_receiving(stream)
    for time_, packet in enumerate([b"no record", *[RECORD.pack(server.number, 0, 0, *[10**6] * 6)] * 2]):
        stream._take(packet, float(time_))
    assert stream.latest().time == 1.0
    assert without_silences(stream) == {"received": server.number + 2, "late": 1, "malformed": 1}


def test_records_wait_while_the_program_is_busy(pair):
    server, stream = pair
    with stream._lock:  # the receiving thread waits
        for _ in range(450):
            server.send(WRENCH)
    assert until(lambda: stream.counts().received == server.number - 1)
    assert stream.counts().lost == 0


def test_a_restart_and_a_silence_are_counted_and_the_stream_goes_on(pair):
    server, stream = pair
    assert until(lambda: stream.counts().silences > 0)
    server.number, server._client, before = 1, None, time.monotonic()
    assert until(lambda: server.send(WRENCH) or stream.latest().time > before)
    assert (stream.counts().restarts, stream.counts().lost) == (1, 0)


def test_after_a_change_of_units_no_reading_is_sound(pair):
    server, stream = pair
    page = server.page().replace("<scfgfu>N<", "<scfgfu>lbf<")
    server.page = lambda: page
    assert until(lambda: stream.counts().unit_changes == 1)
    server.send(WRENCH)
    assert not stream.latest().sound


def test_an_address_without_a_sensor_is_named():
    with pytest.raises(
        ValueError, match=r"http://127.0.0.1:9/netftapi2.xml: no answer .* expected the page of a Net F/T"
    ):
        NetFt("127.0.0.1", http_port=9)


@pytest.mark.parametrize(
    ("page", "message"),
    [
        (b"<netft><cfgcpf>0</cfgcpf></netft>", "<cfgcpf> is '0', expected a positive number"),
        (
            b"<netft><cfgcpf>10</cfgcpf><scfgfu>stone</scfgfu></netft>",
            "<scfgfu> is 'stone', expected a unit such as n, kn",
        ),
        (b"no page", "no XML"),
    ],
)
def test_a_page_that_says_something_else_is_named(page, message):
    with pytest.raises(ValueError, match=message):
        parse_calibration(page, "here")


@pytest.mark.parametrize(("unit", "newtons"), [("kN", 1000.0), ("lbf", 4.4482216), ("kgf", 9.80665)])
def test_units_are_converted(unit, newtons):
    page = f"<a><cfgcpf>100</cfgcpf><scfgfu>{unit}</scfgfu><cfgcpt>1</cfgcpt><scfgtu>lbf-in</scfgtu></a>"
    found = parse_calibration(page.encode(), "here")
    assert found.force == pytest.approx(newtons / 100.0)
    assert found.torque == pytest.approx(0.112984829)


SILENCE = "silence"


@pytest.mark.parametrize(
    ("numbers", "counted"),
    [
        ((5, 6, 9, 7, 9, 10), {"lost": 2, "late": 2}),
        ((WRAP - 2, WRAP - 1, 0, 2), {"lost": 1}),
        ((WINDOW + 5, 6, WINDOW + 6), {"late": 1}),
        ((WINDOW + 5, 5, 6), {"restarts": 1}),
        ((5, SILENCE, 5, SILENCE, 1, 2, 1), {"late": 1, "restarts": 2}),
        ((5, SILENCE, 8, 9), {"lost": 2}),
    ],
)
def test_the_order_of_records_by_hand(numbers, counted):
    order, counts = RecordOrder(), StreamCounts()
    for number in numbers:
        if number == SILENCE:
            order.note_silence()
        else:
            counts = counts.plus(**order.place(number))
    assert counts == StreamCounts(**counted)
    assert counts.text() == ", ".join(f"{n} {name}" for name, n in counted.items())
