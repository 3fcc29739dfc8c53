"""The servo in a process of its own, with a loopback device and with drivers that fail."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from multiprocessing import get_context
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.demonstration_run import ServedRun
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from skill.data.outcome import Outcome
from systems.servo.own_time import LONGEST_LOOK, OwnTime
from systems.servo.servo_client import SILENCE, ServoClient
from systems.servo.servo_process import REST, REST_SHARE, STALL, Pace, WatchedDevice
from systems.servo.shared_value import CHECKED, SharedValue
from tests.waiting import until

ROOT = Path(__file__).resolve().parents[3]
DRIVERS = "tests.systems.servo.drivers"


@pytest.fixture(scope="module")
def scenario():
    found = load_scenario("live")
    found.recorder.time_limit = 20.0
    return resolve_scenario(found, seed=1, stream=LIVE_STREAM)


def steps(run, number):
    """Simulates up to a number of contact steps; returns how the demonstration ended, if it did."""
    for _ in range(number):
        ending = run.step()
        if ending is not None:
            return ending
    return None


def test_a_demonstration_through_the_servo_is_recorded_and_felt(scenario):
    with ServoClient("loopback") as servo:
        run = ServedRun(scenario, servo)
        ending, loads = None, []
        while ending is None:
            ending = run.step()
            loads.append(np.linalg.norm(run.probe.wrench[3:]))
        times = servo.end()
        again = ServedRun(scenario, servo)  # the same process serves the next demonstration
        assert steps(again, 20) is None
        assert again.probe.ticks >= 60
    assert ending.outcome is Outcome.INSERTED
    assert max(loads) > 0.2
    assert len(times) >= run.probe.ticks
    assert (np.diff(times) > 0.0).all()
    assert run.time <= run.probe.time + 0.01  # the simulation does not run ahead


@pytest.mark.parametrize(
    ("driver", "reason"),
    [
        ("Raising", "unplugged"),
        ("Blocking", "it did not "),  # return for 50 ms, or tick, whichever the session notices first
    ],
)
def test_a_driver_that_fails_ends_the_demonstration_with_its_name(scenario, driver, reason, tmp_path, monkeypatch):
    monkeypatch.setenv("CLOSED", str(tmp_path / "closed.txt"))
    name = f"{DRIVERS}:{driver}"
    servo = ServoClient(name)
    run = ServedRun(scenario, servo)
    with pytest.raises(OSError, match=f"^device driver '{name}': {reason}"):
        steps(run, 2000)
    servo.close()
    assert driver != "Blocking" or (tmp_path / "closed.txt").read_text() == "closed"


@pytest.mark.parametrize(("state", "own"), [("S", 0.004), ("R", 0.002)])
def test_the_time_in_which_a_thread_waits_for_a_core_is_not_its_own(tmp_path, monkeypatch, state, own):
    """Of 7 ms it has run for 2 and waited for a core for 3; while it waits for one, the present wait is not counted."""
    now = iter([1.0, 1.007, 2.007])
    monkeypatch.setattr("systems.servo.own_time.Path", lambda folder: tmp_path)
    monkeypatch.setattr("systems.servo.own_time.time", SimpleNamespace(monotonic=lambda: next(now)))
    (tmp_path / "stat").write_text(f"7 (a) name) {state} 1")
    (tmp_path / "schedstat").write_text("1000000 0 3")
    dut = OwnTime(7)
    (tmp_path / "schedstat").write_text("3000000 3000000 4")
    assert dut.since_last() == pytest.approx(own)
    assert dut.since_last() == pytest.approx(LONGEST_LOOK if state == "S" else 0.0)


class Slow:
    """A device whose calls take the time that a test gives, and notes that it is closed."""

    def __init__(self, take):
        self.take, self.closed = take, 0

    def read_pose(self):
        self.take()

    def write_wrench(self, wrench):
        self.take()

    def close(self):
        self.closed += 1


def compute(seconds):
    """Computes without the interpreter's lock, as a driver in C does, for a time of the core."""
    block, began = bytes(2**18), time.thread_time()
    while time.thread_time() - began < seconds:
        hashlib.sha256(block)


@pytest.mark.parametrize(("name", "arguments"), [("read_pose", []), ("write_wrench", [np.zeros(6)])])
@pytest.mark.parametrize("take", [lambda: time.sleep(12 * STALL), lambda: compute(12 * STALL)])
def test_a_device_whose_own_call_takes_too_long_is_closed(name, arguments, take):
    device = Slow(take)
    dut = WatchedDevice(device)
    try:
        with pytest.raises(OSError, match=r"^it did not return for 50 ms$"):
            getattr(dut, name)(*arguments)
    finally:
        dut.close()
    assert device.closed == 1


def test_a_device_that_cannot_be_opened_is_an_error_with_its_name():
    with pytest.raises(OSError, match=r"^device driver 'nothing:device': ValueError: .*cannot be imported"):
        ServoClient("nothing:device")


def test_a_killed_servo_is_noticed(scenario):
    with ServoClient("loopback") as servo:
        run = ServedRun(scenario, servo)
        assert steps(run, 20) is None
        assert servo.has_priority == ((os.sched_getscheduler(servo.process) & ~os.SCHED_RESET_ON_FORK) == os.SCHED_FIFO)
        assert os.sched_getscheduler(0) == os.SCHED_OTHER
        os.kill(servo.process, signal.SIGKILL)
        with pytest.raises(OSError, match="'loopback': its process ended with code -9"):
            steps(run, 2000)


def test_a_servo_that_stands_still_is_silent_and_begins_again_from_no_force(scenario):
    """It is silent for as long as this process looks, not while this one was away too."""
    driver = f"{DRIVERS}:Still"
    with ServoClient(driver) as servo:
        run, gains = ServedRun(scenario, servo), []
        assert steps(run, 20) is None
        for order in (signal.SIGSTOP, signal.SIGCONT):
            os.kill(servo.process, order)
            time.sleep(2 * SILENCE)
        for _ in range(100):
            assert run.step() is None
            gains.append(run.probe.gain)
        assert run.probe.stalls >= 1
        assert min(gains) < 0.9
        os.kill(servo.process, signal.SIGSTOP)
        with pytest.raises(OSError, match=rf"'{driver}': it did not tick for 0\.5 s"):
            steps(run, 200)
        os.kill(servo.process, signal.SIGCONT)


ORPHAN = f"""
import os
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from experiments.demonstration_run import ServedRun
from systems.servo.servo_client import ServoClient

if __name__ == "__main__":
    servo = ServoClient("{DRIVERS}:Noted")
    run = ServedRun(resolve_scenario(load_scenario("live"), seed=1, stream=LIVE_STREAM), servo)
    for _ in range(20):
        run.step()
    print(servo.process, flush=True)
    os._exit(1)
"""


def test_a_servo_whose_session_has_died_lets_the_device_go_and_ends(tmp_path):
    script = tmp_path / "orphan.py"
    script.write_text(ORPHAN)
    closed = tmp_path / "closed.txt"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "CLOSED": str(closed)}
    found = subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True, timeout=120)
    assert found.stdout.strip().isdigit(), found.stderr
    assert until(closed.exists, 20.0)
    assert closed.read_text() == str([0.0] * 6)


class Clock:
    """A clock that a test sets; each look takes 0.01 ms. Sleeps move it on, by ``stop`` more than they should."""

    def __init__(self):
        self.now, self.stop, self.slept = 0.0, 0.0, []

    def __call__(self):
        self.now += 1e-5
        return self.now

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now += seconds + self.stop


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr("systems.servo.servo_process.time", SimpleNamespace(sleep=found.sleep))
    return found


def test_the_pace_counts_late_ticks_and_starts_anew_after_a_stall(clock):
    pace = Pace(1e-3, clock)
    assert pace.wait()
    assert (pace.ticks, pace.late) == (1, 0)
    assert clock.now == pytest.approx(1e-3, abs=1e-4)
    clock.now += 2.5e-3  # two late ticks, made up for by the third
    assert [pace.wait() for _ in range(3)] == [True] * 3
    assert (pace.ticks, pace.late, pace.stalls) == (4, 2, 0)
    assert clock.now == pytest.approx(4e-3, abs=1e-4)
    clock.now += 2 * STALL
    begun = clock.now
    assert not pace.wait()
    assert (pace.late, pace.stalls) == (3, 1)
    assert all(pace.wait() for _ in range(20))
    assert clock.now - begun == pytest.approx(0.020, abs=1e-4)
    clock.stop = 2 * STALL
    assert pace.wait()
    assert not pace.wait()  # a stop while it waited is a stall too
    assert pace.stalls == 2


def test_a_servo_that_is_always_late_does_not_stall(clock):
    pace = Pace(1e-3, clock)
    for _ in range(200):
        clock.now += 1.5e-3
        assert pace.wait()
    assert (pace.ticks, pace.late, pace.stalls) == (200, 200, 0)


@pytest.mark.parametrize(("spin", "looks"), [(0.0, 3), (5e-4, 52)])
def test_the_pace_sleeps_until_its_last_part(clock, spin, looks):
    """A look at this clock takes 0.01 ms: the last 0.5 ms are 50 of them."""
    pace, slept = Pace(1e-3, clock, spin=spin), clock.slept
    begun = clock.now
    assert pace.wait()
    assert slept == [pytest.approx(1e-3 - spin, abs=2e-5)]
    assert (clock.now - begun - slept[0]) / 1e-5 == pytest.approx(looks, abs=1.5)
    clock.now += 5e-4
    assert pace.wait()
    assert slept[1] < 1e-3
    for late in (1.2e-3, 2.5e-3, 0.01):  # a late servo too leaves its core to others: Linux asks for 5 % of the time
        clock.now += late
        assert pace.wait()
        assert slept[-1] == pytest.approx(max(REST, REST_SHARE * late), rel=0.3)
        assert slept[-1] > 0.05 * (late + slept[-1])


def test_a_reader_never_sees_half_of_a_value():
    dut = SharedValue(get_context("spawn"), 3)
    assert dut.read_new() is None
    dut.write(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(dut.read_new(), [1.0, 2.0, 3.0])
    assert dut.read_new() is None
    for place in range(CHECKED + 3):  # a write of which one number has not come
        before = dut._memory[place]
        dut.write(np.full(3, 4.0 + place))
        whole, dut._memory[place] = dut._memory[place], before
        assert dut.read_new() is None
        dut._memory[place] = whole
        np.testing.assert_array_equal(dut.read_new(), 4.0 + place)
