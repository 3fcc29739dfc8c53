"""A stream with every disturbance, each counted exactly."""

import math
import time
from collections import Counter
from contextlib import closing

import numpy as np
import pytest

from interfaces.sensors.net_ft import ERROR, RECORD, SILENCE, NetFt
from interfaces.sensors.wrench_stream import WRAP
from tests.interfaces.sensors.net_ft_server import BLOCK, WRENCH, DisturbedNetFtServer
from tests.interfaces.sensors.test_net_ft import until

KINDS = ("lost", "late", "doubled", "malformed", "overloaded", "faulty")
CYCLE = 400  # blocks from one change of units, one silence, ... to the next


class Disturbances:
    """An order of blocks that disturbs every other one, and interrupts the stream five times in a cycle.

    The first and the last record of a block stay where they are: what is missing beside a restart is not seen.

    Attributes:
        injected: number of each disturbance, by the name of its count.
        wraps: number of times that the counter of the records passed its end.
        stalls: times when the machine was so late with a block that it may have been a silence.
    """

    def __init__(self, server, *, blocks, seed):
        self.injected, self.wraps, self.stalls = Counter(), 0, 0
        self._server, self._blocks, self._rng = server, blocks, np.random.default_rng(seed)
        self._block, self._kind, self._last = 0, "", math.inf

    @property
    def done(self):
        return self._block >= self._blocks

    def __call__(self, records):
        gap = time.monotonic() - max(self._last, self._server.silent_until)
        self.stalls += gap > 0.8 * SILENCE
        first, last = (RECORD.unpack(records[k])[0] for k in (0, -1))
        self.wraps += first > last
        packets = self._disturbed(list(records))
        self._block += 1
        self._kind, self._server.wrench, self._server.status = "", WRENCH, 0
        if not self.done:
            self._prepare()
        self._last = time.monotonic()
        return packets

    def _disturbed(self, records):
        i, j = np.sort(self._rng.choice(np.arange(1, BLOCK - 1), 2, replace=False))
        number = 1
        if self._kind == "lost":
            number = j - i
            del records[i:j]
        elif self._kind == "late":
            records.insert(j, records.pop(i))
        elif self._kind == "doubled":
            records.insert(j, records[i])
        elif self._kind == "malformed":
            records.insert(j, bytes(self._rng.choice([0, 8, RECORD.size - 1, RECORD.size + 1, 500])))
        else:
            number = BLOCK
        if self._kind:
            self.injected[self._kind] += int(number)
        return records

    def _prepare(self):
        server = self._server
        if self._rng.random() < 0.5:
            self._kind = str(self._rng.choice(KINDS))
        if self._kind == "overloaded":
            server.wrench = (3000.0, *WRENCH[1:])
        if self._kind == "faulty":
            server.status = ERROR | 4
        event = self._block % CYCLE
        if event == 30:
            server.unit = "lbf" if server.unit == "N" else "N"
            self.injected["unit_changes"] += 1
        if event in (100, 170):
            server.silent_until = time.monotonic() + self._rng.uniform(3.0, 6.0) * SILENCE
            self.injected["silences"] += 1
        if event == 170:
            server.number = server.sample = 1
            self.injected["restarts"] += 1
        if event == 240:
            server.number = 1
            self.injected["restarts"] += 1
        if event == 310:
            server.number, server.sample = WRAP - 4 * BLOCK - 5, WRAP - 50 * BLOCK
            self.injected["restarts"] += 1


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [5, pytest.param(120, marks=pytest.mark.nightly)])
def test_every_disturbance_of_a_long_stream_is_counted_exactly(seconds):
    with (
        DisturbedNetFtServer() as server,
        closing(NetFt("127.0.0.1", port=server.port, http_port=server.http_port)) as stream,
    ):
        assert until(lambda: stream.counts().received >= BLOCK)
        before = stream.counts()
        assert before.text() == f"{before.received} received"
        server.order = disturbances = Disturbances(server, blocks=100 * seconds, seed=5)
        assert until(lambda: disturbances.done, 2.0 * seconds)
        expected = disturbances.injected
        assert until(lambda: stream.counts().unit_changes == expected["unit_changes"])
        server.silent_until = math.inf
        expected["silences"] += 1
        assert until(lambda: stream.counts().silences >= expected["silences"])
        counts = stream.counts()
    found = vars(counts)
    assert 0 <= found["silences"] - expected["silences"] <= disturbances.stalls
    expected |= {"silences": found["silences"], "received": server.sent}
    assert found == expected
    assert all(f"{number} {name.replace('_', ' ')}" in counts.text() for name, number in expected.items())
    assert disturbances.wraps == sum(block % CYCLE == 310 for block in range(1, 100 * seconds))
    print(f"\n{counts.text()}; {disturbances.wraps} wraps, {disturbances.stalls} stalls")
