from dataclasses import astuple
from types import SimpleNamespace

import pytest

import systems.live.clock
from systems.live.clock import MAX_DELAY, Clock


@pytest.fixture
def wall(monkeypatch):
    """A wall clock that only moves when the test or a sleep moves it."""
    wall = SimpleNamespace(now=0.0)
    sleep = lambda seconds: setattr(wall, "now", wall.now + seconds)  # noqa: E731
    monkeypatch.setattr(systems.live.clock, "time", SimpleNamespace(monotonic=lambda: wall.now, sleep=sleep))
    return wall


def test_clock_waits_counts_late_ticks_and_makes_up_for_short_delays(wall):
    dut = Clock(period=1e-3, ticks_per_step=4, start=0.0)
    for cost in [2.5e-3, 1e-4, 1e-4, 1e-4] * 10:  # every contact step is in time, but makes two ticks late
        wall.now += cost
        dut.end_tick()
    assert astuple(dut.deadlines) == (0, 10, 20, 40)
    assert wall.now == pytest.approx(0.040)
    assert dut.time == pytest.approx(0.040)
    assert dut.next_time == pytest.approx(0.041)
    for cost in [5e-3, 1e-4, 1e-4, 1e-4] + [1e-4] * 4:  # one contact step is late, the next makes up for it
        wall.now += cost
        dut.end_tick()
    assert astuple(dut.deadlines) == (1, 12, 25, 48)
    assert wall.now == pytest.approx(0.048)


def test_clock_starts_anew_after_a_long_delay(wall):
    dut = Clock(period=1e-3, ticks_per_step=4, start=0.0)
    wall.now += 2 * MAX_DELAY
    dut.end_tick()
    start = wall.now
    for _ in range(10):
        dut.end_tick()
    assert wall.now == pytest.approx(start + 0.010)
