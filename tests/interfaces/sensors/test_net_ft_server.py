"""The server of a Net F/T sensor, read by hand."""

import socket
from contextlib import closing

import numpy as np
import pytest

from interfaces.sensors.net_ft import ERROR, HEADER, OUT_OF_RANGE, RECORD, REQUEST, START, STOP, read_calibration
from interfaces.sensors.net_ft_server import NetFtServer

WRENCH = (1.5, -2.0, 0.0, 2e-6, 0.25, -1.0)


@pytest.fixture
def server():
    with closing(NetFtServer()) as server:
        yield server


def client(server):
    """A socket that has asked for records."""
    asking = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    asking.settimeout(0.5)
    asking.connect(("127.0.0.1", server.port))
    asking.send(REQUEST.pack(HEADER, START, 0))
    return asking


def test_a_record_has_the_next_counters_of_32_bits_and_the_counts_of_the_page(server):
    server.number = server.sample = last = (1 << 32) - 1
    server.send(WRENCH)  # nobody has asked: a sample, but no record
    with client(server) as asking:
        server.send(WRENCH, status=4)
        server.send(WRENCH)
        assert RECORD.unpack(asking.recv(64)) == (last, 0, 4, 1_500_000, -2_000_000, 0, 2, 250_000, -1_000_000)
        assert RECORD.unpack(asking.recv(64))[:3] == (0, 1, 0)
    assert read_calibration("127.0.0.1", server.http_port) == (1e-6, 1e-6)


def test_a_wrench_beyond_the_range_is_clipped_and_flagged_and_one_that_is_no_number_is_refused(server):
    with client(server) as asking:
        server.send([3000.0, -np.inf, 2147.0, 0.0, 0.0, 0.0])
        _, _, status, *counts = RECORD.unpack(asking.recv(64))
    assert status == ERROR | OUT_OF_RANGE
    assert counts == [(1 << 31) - 1, -(1 << 31), 2_147_000_000, 0, 0, 0]
    with pytest.raises(ValueError, match="NaN"):
        server.send([np.nan] * 6)


def test_who_asks_last_is_answered_until_it_is_enough(server):
    with client(server) as first, client(server) as second:
        for request in (b"no request", REQUEST.pack(HEADER + 1, STOP, 0)):
            first.send(request)
        server.send(WRENCH)
        assert len(second.recv(64)) == RECORD.size
        second.send(REQUEST.pack(HEADER, STOP, 0))
        server.send(WRENCH)
        assert server.number == 2
        for asking in (first, second):
            asking.setblocking(False)
            with pytest.raises(BlockingIOError):
                asking.recv(64)
