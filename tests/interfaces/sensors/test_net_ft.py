"""The client of a Net F/T sensor, against a server on loopback whose stream is disturbed."""

import math
import time
from collections import Counter
from contextlib import closing

import numpy as np
import pytest

from interfaces.sensors import net_ft
from interfaces.sensors.net_ft import ERROR, OUT_OF_RANGE, RECORD, NetFt, parse_calibration
from interfaces.sensors.net_ft_server import NetFtServer
from interfaces.sensors.wrench_stream import WRAP, Arrival, RecordOrder
from tests.interfaces.sensors.net_ft_server import WRENCH, DisturbedNetFtServer
from tests.interfaces.sensors.waiting import until


@pytest.fixture
def pair(monkeypatch):
    monkeypatch.setattr(net_ft, "PAGE_PERIOD", 0.02)
    with DisturbedNetFtServer() as server:
        stream = NetFt("127.0.0.1", port=server.port, http_port=server.http_port)
        assert until(lambda: stream.latest() is not None)
        yield server, stream
        stream.close()


def test_a_sound_stream_is_read_in_si_units_and_nothing_is_counted(pair):
    _, stream = pair
    assert until(lambda: stream.counts().received >= 50)
    np.testing.assert_allclose(stream.latest().wrench, WRENCH)
    assert stream.latest().sound
    assert time.monotonic() - stream.latest().time < 0.5
    assert {name for name, count in vars(stream.counts()).items() if count} <= {"received", "silences"}  # if it is busy


DISTURBANCES = {  # what happens to a block of records, and how many are counted
    "lost": (lambda block: block[:3] + block[5:], 2),
    "late": (lambda block: [*block[:3], *block[4:6], block[3], *block[6:]], 1),
    "doubled": (lambda block: [*block[:5], block[3], *block[5:]], 1),
    "malformed": (lambda block: [*block[:5], b"no record", block[5] + b"1", *block[5:]], 2),
    "overloaded": (lambda block: [with_status(packet, ERROR | OUT_OF_RANGE) for packet in block], 10),
    "faulty": (lambda block: [with_status(packet, ERROR | 4) for packet in block], 10),
}


def with_status(packet, status):
    number, sample, _, *counts = RECORD.unpack(packet)
    return RECORD.pack(number, sample, status, *counts)


def test_every_disturbance_of_a_long_stream_is_counted_exactly():
    """Without the threads: blocks of ten records, over the end of the counters and a restart."""
    rng = np.random.default_rng(5)
    injected, number, received = Counter(), WRAP - 1234, 0
    with (
        closing(NetFtServer()) as server,
        closing(NetFt("127.0.0.1", port=server.port, http_port=server.http_port)) as stream,
    ):
        stream._ended.set()
        for thread in stream._threads:
            thread.join()
        for block in range(1000):
            if block == 700:
                number = 5
                injected["restarts"] += 1
            packets = [RECORD.pack((number + k) % WRAP, (number + k) % WRAP, 0, *[10**6] * 6) for k in range(10)]
            number += 10
            if block % 100 and rng.random() < 0.5:
                kind = str(rng.choice(list(DISTURBANCES)))
                disturbed, count = DISTURBANCES[kind]
                packets = disturbed(packets)
                injected[kind] += count
            for packet in packets:
                stream._take(packet, 0.1 * block)
            received += len(packets)
        found = {name: count for name, count in vars(stream.counts()).items() if count and name != "silences"}
        assert found == {"received": received, **injected}
        assert set(injected) == {*DISTURBANCES, "restarts"}
        assert all(f"{count} {name}" in stream.counts().text() for name, count in injected.items())


def test_overloads_and_faults_are_counted_and_not_sound(pair):
    server, stream = pair
    for status, name in ((ERROR | OUT_OF_RANGE, "overloaded"), (ERROR | 4, "faulty")):
        server.status = status
        assert until(lambda name=name: getattr(stream.counts(), name) > 20)
        assert not stream.latest().sound
    server.status = 1 << 16  # a latched monitor condition is no error
    assert until(lambda: stream.latest().sound)


def test_records_wait_while_the_program_is_busy():
    with (
        closing(NetFtServer()) as server,
        closing(NetFt("127.0.0.1", port=server.port, http_port=server.http_port)) as stream,
    ):
        assert until(lambda: server.send(WRENCH) or stream.latest() is not None)
        with stream._lock:  # the receiving thread waits
            for _ in range(450):
                server.send(WRENCH)
        assert until(lambda: stream.counts().received == server.number - 1)
        assert stream.counts().lost == 0


def test_the_newest_record_is_read_while_the_thread_waits():
    with (
        closing(NetFtServer()) as server,
        closing(NetFt("127.0.0.1", port=server.port, http_port=server.http_port)) as stream,
    ):
        assert until(lambda: server.send(WRENCH) or stream.latest() is not None)
        stream._ended.set()
        stream._threads[0].join()
        server.send((7.0, *WRENCH[1:]))
        assert stream.latest().wrench[0] == pytest.approx(7.0)


def test_a_restart_and_a_silence_are_counted_and_the_stream_goes_on(pair):
    server, stream = pair
    assert until(lambda: stream.counts().received > 50)
    server.silent_until = math.inf
    assert until(lambda: stream.counts().silences > 0)
    server.number, server.sample, server.silent_until = 1, 2, 0.0
    before = time.monotonic()
    assert until(lambda: stream.latest().time > before)
    assert until(lambda: stream.counts().restarts == 1)
    assert stream.counts().lost == 0


def test_after_a_change_of_units_no_reading_is_sound(pair):
    server, stream = pair
    server.unit = "lbf"
    assert until(lambda: stream.counts().unit_changes == 1)
    assert until(lambda: not stream.latest().sound)


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


def test_the_order_of_records_by_hand():
    order = RecordOrder()
    arrivals = [order.place(number, number) for number in (5, 6, 9, 7, 9, 10)]
    new, late, doubled = Arrival.NEW, Arrival.LATE, Arrival.DOUBLED
    assert arrivals == [new, new, new, late, doubled, new]
    assert order.lost == 1  # number 8
    assert order.place(1, 100) is Arrival.RESTARTED
    assert order.place(2, 101) is new
    assert order.lost == 1


def test_the_same_counters_are_a_restart_after_a_silence_and_for_another_sample():
    order = RecordOrder()
    for number in range(1, 6):
        order.place(number, number)
    order.forget()
    assert [order.place(number, number) for number in (5, 1, 2)] == [Arrival.RESTARTED, Arrival.RESTARTED, Arrival.NEW]
    assert order.place(2, 100) is Arrival.RESTARTED
    assert order.lost == 0


def test_a_restart_into_a_gap_is_not_late():
    order = RecordOrder()
    for number in (1, 4):
        order.place(number, number)
    assert order.place(2, 5) is Arrival.RESTARTED
    assert order.lost == 2
    order.place(5, 8)
    order.forget()
    assert order.place(3, 3) is Arrival.RESTARTED  # an older sample, which would have been late before the silence
    assert order.lost == 4
