"""The fuzz test itself: that it finds defects, and that the files have none."""

import os
import signal
import time
from random import Random

import pytest

from skill.data import tables
from skill.data.demonstration import write_demonstration
from skill.data.files import check_seal
from tests import fuzz
from tests.trajectories import make_demonstration

RECORDING = "recording.parquet"


@pytest.fixture
def path(tmp_path):
    """A recording."""
    path = tmp_path / RECORDING
    write_demonstration(make_demonstration(), path)
    return path


@pytest.mark.nightly
@pytest.mark.slow
def test_no_change_of_a_file_is_a_defect():
    trials = list(fuzz.run(list(range(500)), seed=1, jobs=1))
    assert [t.number for t in trials] == list(range(500))
    assert [t for t in trials if t.outcome not in fuzz.GOOD] == []


def test_each_kind_of_defect_is_found(path, monkeypatch):
    held, _ = fuzz.load(RECORDING, path)
    assert fuzz.judge(RECORDING, held, path, sealed=True) == ("identical", "")
    assert fuzz.judge(RECORDING, b"other", path, sealed=True)[0] == "silent change"
    assert fuzz.judge(RECORDING, b"other", path, sealed=False)[0] == "another file"
    monkeypatch.setattr(fuzz, "load", lambda kind, path: (b"", False))
    assert fuzz.judge(RECORDING, held, path, sealed=False)[0] == "unsound"
    for error, outcome in (
        (TypeError("no"), "exception"),
        (SystemExit(1), "exception"),
        (ValueError("without a name"), "message"),
        (ValueError(f"{path}: two\nlines"), "message"),
        (ValueError(f"{path}: bad"), "refused"),
    ):

        def load(kind, path, error=error):
            raise error

        monkeypatch.setattr(fuzz, "load", load)
        assert fuzz.judge(RECORDING, held, path, sealed=True)[0] == outcome


def test_without_the_digest_it_finds_a_silent_change_and_a_forged_file_carries_one_that_fits(path, monkeypatch):
    original, (held, _) = path.read_bytes(), fuzz.load(RECORDING, path)
    path.write_bytes(original.replace(b'"peg_length": 0.06', b'"peg_length": 0.07'))
    assert fuzz.judge(RECORDING, held, path, sealed=True)[0] == "refused"
    monkeypatch.setattr(tables, "check_seal", lambda data, required: None)
    assert fuzz.judge(RECORDING, held, path, sealed=True)[0] == "silent change"
    for k in range(20):
        check_seal(fuzz.forge(RECORDING, original, Random(k)))  # raises no error


def crashes(number, seed, folder):
    """Stands in for `fuzz.attempt` in a process that is forked: it crashes, hangs, or does nothing."""
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 3:
        time.sleep(60.0)
    return fuzz.Trial(number, "run.parquet", "refused")


@pytest.mark.nightly
@pytest.mark.slow
def test_a_process_that_crashes_or_hangs_is_a_defect_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(fuzz, "attempt", crashes)
    monkeypatch.setattr(fuzz, "MAX_TIME", 1.0)
    trials = list(fuzz.run(list(range(5)), seed=0, jobs=1, method="fork"))
    assert [t.outcome for t in trials] == ["refused", "crash", "refused", "time", "refused"]
