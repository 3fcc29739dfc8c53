"""The client of a Net F/T sensor, against a server on loopback whose stream is disturbed."""

import math
import time
from contextlib import closing

import numpy as np
import pytest

from interfaces.sensors.net_ft import ERROR, OUT_OF_RANGE, SILENCE, NetFt, parse_calibration
from interfaces.sensors.net_ft_server import NetFtServer
from interfaces.sensors.wrench_stream import Arrival, RecordOrder
from tests.interfaces.sensors.net_ft_server import WRENCH, DisturbedNetFtServer
from tests.interfaces.sensors.waiting import until


@pytest.fixture
def pair():
    with DisturbedNetFtServer() as server:
        stream = NetFt("127.0.0.1", port=server.port, http_port=server.http_port)
        assert until(lambda: stream.latest() is not None)
        yield server, stream
        stream.close()


def test_a_sound_stream_is_read_in_si_units_and_nothing_is_counted(pair):
    _, stream = pair
    assert until(lambda: stream.counts().received >= 300)
    np.testing.assert_allclose(stream.latest().wrench, WRENCH)
    assert stream.latest().sound
    assert time.monotonic() - stream.latest().time < 0.5
    counts = stream.counts()
    assert counts.text() == f"{counts.received} received"


@pytest.mark.parametrize(
    ("order", "expected"),
    [
        (lambda r: [r[k] for k in (0, 1, 2, 4, 5, 6, 7, 8, 9)], {"lost": 1}),
        (lambda r: [r[k] for k in (0, 2, 1, 3, 4, 5, 6, 7, 8, 9)], {"late": 1}),
        (lambda r: [r[k] for k in (0, 1, 1, 2, 3, 4, 5, 6, 7, 8, 9)], {"doubled": 1}),
        (lambda r: [*r, b"no record"], {"malformed": 1}),
    ],
    ids=["lost", "late", "doubled", "malformed"],
)
def test_every_disturbed_record_is_counted(pair, order, expected):
    server, stream = pair
    server.order = order
    assert until(lambda: server.sent >= 400)
    server.order = lambda records: records
    sent = server.sent
    assert until(lambda: stream.counts().received >= sent)
    found = {name: n for name, n in vars(stream.counts()).items() if n and name != "received"}
    if server.longest_pause + 0.02 > SILENCE:  # a busy machine, and a block of records is sent at once
        found.pop("silences", None)
    ((name, each),) = expected.items()
    assert list(found) == [name]
    assert found[name] == pytest.approx(sent / 10 * each, abs=12)
    assert stream.latest().sound


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
    assert until(lambda: stream.counts().received > 200)
    server.silent_until = math.inf
    assert until(lambda: stream.counts().silences > 0)
    server.number, server.sample, server.silent_until = 1, 2, 0.0
    before = time.monotonic()
    assert until(lambda: stream.latest().time > before)
    assert until(lambda: stream.counts().restarts == 1)
    assert stream.counts().lost == 0


def test_counters_that_wrap_are_no_event():
    with DisturbedNetFtServer() as server:
        server.number = (1 << 32) - 50
        stream = NetFt("127.0.0.1", port=server.port, http_port=server.http_port)
        assert until(lambda: stream.counts().received >= 150)
        counts = stream.counts()
        stream.close()
    assert counts.text() == f"{counts.received} received"


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
