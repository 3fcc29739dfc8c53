"""Recordings that were finished stay whole, whatever ends the session."""

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from models.scenario import load_scenario
from scripts.record_demonstrations import record, sweep
from skill.data.demonstration import read_demonstration
from skill.data.tables import write_atomically
from systems.runs.demonstration_set import OPERATORS, requests

ROOT = Path(__file__).resolve().parents[2]
QUICK = {
    "geometry": {"hole_depth": 0.003, "peg_length": 0.02},
    "start": {"height": 2e-4, "tilt": [0.0, 0.0]},
    "recorder": {"rough_force": 500.0},
    "operator": {"insertion_speed": 0.06},
}


@pytest.fixture
def quick(tmp_path):
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(QUICK))
    return str(path)


def test_thirty_are_three_by_each_of_ten():
    wanted = requests(24, 6)
    assert OPERATORS == 10
    assert [sum(r.operator == person for r in wanted) for person in range(10)] == [3] * 10
    assert sum(r.good for r in wanted) == 24
    for person in range(10):
        assert len({r.habit for r in wanted if r.operator == person and r.good}) == 1  # novice or expert, for good


@pytest.mark.parametrize("seconds", [0.05, 0.13, 0.31, 0.5, 0.77, 1.1])
def test_a_killed_session_leaves_every_finished_recording_readable_and_no_half_one(tmp_path, quick, seconds):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "scripts.record_demonstrations", "--scenario", quick, "--out", str(out)]
    options = ["--good", "40", "--bad", "0", "--jobs", "1"]
    with subprocess.Popen(
        [*command, *options], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ) as process:
        end = time.monotonic() + 90
        while not list(out.glob("*.parquet")):  # the moment is counted from the first recording on
            assert time.monotonic() < end
            assert process.poll() is None
            time.sleep(0.002)
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        process.wait()
    finished = sorted(out.glob("*.parquet"))
    assert finished
    for path in finished:
        assert read_demonstration(path).good
    sweep(out)
    assert sorted(p for p in out.iterdir() if p.name != "demonstrations.png") == finished


def test_what_a_killed_write_left_is_swept_and_nothing_else(tmp_path):
    (tmp_path / ".000_good_expert.parquet.abc123").write_bytes(b"PAR1 half")
    (tmp_path / "000_good_expert.parquet").write_bytes(b"whole")
    (tmp_path / "notes.txt").write_text("mine")
    sweep(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["000_good_expert.parquet", "notes.txt"]


def test_a_full_disk_is_said_and_what_was_finished_stays(tmp_path, quick, capfd, monkeypatch):
    import typer

    import skill.data.demonstration

    written = []

    def until_full(path, data):
        if len(written) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        write_atomically(path, data)
        written.append(path)

    monkeypatch.setattr("skill.data.tables.write_atomically", until_full)
    assert skill.data.demonstration
    with pytest.raises(typer.Exit) as ended:
        record(out=tmp_path / "out", good=4, bad=0, seed=0, scenario=quick, jobs=1, overwrite=False)
    assert ended.value.exit_code == 1
    assert "No space left on device" in capfd.readouterr().err
    finished = sorted((tmp_path / "out").iterdir())
    assert len(finished) == 2
    for path in finished:
        read_demonstration(path)


def test_the_margins_are_printed_and_a_violation_refused(tmp_path, quick, capfd):
    import typer

    record(out=tmp_path / "out", good=1, bad=0, seed=0, scenario=quick, jobs=1, overwrite=False)
    assert "Colgate" in capfd.readouterr().out
    hard = {**QUICK, "coupling": {"force_scale": 1.0}}
    (tmp_path / "hard.yaml").write_text(yaml.safe_dump(hard))
    with pytest.raises(typer.Exit):
        record(
            out=tmp_path / "hard", good=1, bad=0, seed=0, scenario=str(tmp_path / "hard.yaml"), jobs=1, overwrite=False
        )
    assert "not stable" in capfd.readouterr().err
    assert not (tmp_path / "hard").exists()
    load_scenario(str(tmp_path / "hard.yaml"))  # the file itself is in order
