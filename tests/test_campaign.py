"""A short form of the kill campaign, and its own checks."""

import subprocess
import sys

import psutil
import pytest

from experiments.outputs.output_set import DEMONSTRATIONS, SetIndex
from skill.data.demonstration import write_demonstration
from tests.campaign import is_alive, run, state
from tests.campaign_folders import RecordLane, marks
from tests.trajectories import make_demonstration


@pytest.mark.nightly
@pytest.mark.slow
def test_ten_kills_lose_nothing():
    counts, faults = run(number=10, seed=1, jobs=1)
    assert faults == []
    for name in ("record", "train", "rig", "practise", "live"):
        assert counts[f"{name}: killed"] == 2
        assert counts[f"{name}: completed"] >= 1


@pytest.fixture
def lane(tmp_path):
    """A lane with two finished demonstrations of its first set."""
    lane = RecordLane(tmp_path)
    SetIndex(DEMONSTRATIONS, {"seed": 0}, ("000_good_a.parquet", "001_good_a.parquet")).write(lane.folder)
    for k in range(2):
        write_demonstration(make_demonstration(), lane.folder / f"00{k}_good_a.parquet")
    assert lane.faults_after_kill() == []
    assert len(lane.known) == 2
    return lane


def test_a_lost_demonstration_is_a_fault(lane):
    (lane.folder / "001_good_a.parquet").unlink()
    assert lane.faults_after_kill() == ["lost or made again: ['001_good_a.parquet']"]


def test_a_damaged_demonstration_is_a_fault(lane):
    path = lane.folder / "001_good_a.parquet"
    path.write_bytes(path.read_bytes()[:-50])
    assert any(fault.startswith("not readable") for fault in lane.faults_after_kill())


def test_a_mixture_of_two_sets_is_a_fault(lane):
    assert lane.faults_after_completion() == []
    assert lane.round == 1
    assert set(lane.old) == set(marks(lane.folder))
    (lane.folder / "000_good_a.parquet").unlink()
    assert lane.faults_after_kill() == ["the old set is not whole"]


def test_a_change_of_a_folder_and_the_end_of_a_process_are_seen(tmp_path):
    before = state(tmp_path)
    (tmp_path / ".new").mkdir()
    (tmp_path / ".new" / "x").touch()
    assert state(tmp_path) != before
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        worker = psutil.Process(process.pid)
        assert is_alive(worker)
        process.kill()
    assert not is_alive(worker)
