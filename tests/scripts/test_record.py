"""Recordings that are finished stay complete, however the session ends."""

import errno
import json
import os
import signal
import subprocess
import sys
import time

import pytest
import yaml

import skill.figures.paper_figures  # noqa: F401  imports write_atomically before a test replaces it
from experiments.demonstration_set import OPERATORS, requests
from models.scenario import dump_scenario, load_scenario
from scripts.live_session import record_live
from scripts.record_session import record
from skill.data.demonstration import read_demonstration
from skill.data.tables import write_atomically
from tests.scripts.commands import ROOT, error_line, invoke

QUICK = {
    "geometry": {"hole_depth": 0.003, "peg_length": 0.02},
    "start": {"height": 2e-4, "tilt": [0.0, 0.0]},
    "recorder": {"rough_force": 500.0},
    "operator": {"insertion_speed": 0.06},
}


@pytest.fixture
def quick(tmp_path):
    """Path of a scenario in which an insertion takes a fraction of a second."""
    path = tmp_path / "quick.yaml"
    path.write_text(yaml.safe_dump(QUICK))
    return str(path)


def start_recording(out, scenario, *, jobs=1):
    """Starts a recording of forty demonstrations in a process group of its own, and waits for the first file."""
    process = subprocess.Popen(
        [
            *(sys.executable, "-m", "scripts.record", "--scenario", scenario, "--out", str(out)),
            *("--good", "40", "--bad", "0", "--jobs", str(jobs)),
        ],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    end = time.monotonic() + 90
    while not list(out.glob("*.parquet")):
        assert time.monotonic() < end
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    return process


def test_thirty_demonstrations_are_three_by_each_of_ten_operators():
    requested = requests(24, 6)
    assert OPERATORS == 10
    assert [sum(r.operator == person for r in requested) for person in range(10)] == [3] * 10
    assert sum(r.good for r in requested) == 24
    for person in range(10):
        habits = {r.habit for r in requested if r.operator == person and r.good}
        assert len(habits) == 1  # an operator is either a novice or an expert


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [0.05, 0.5, 1.1])
def test_a_killed_recording_leaves_complete_files_and_goes_on_where_it_stopped(tmp_path, quick, seconds):
    out = tmp_path / "out"
    with start_recording(out, quick) as process:
        time.sleep(seconds)
        os.killpg(process.pid, signal.SIGKILL)
    finished = {path: path.stat().st_mtime_ns for path in out.glob("*.parquet")}
    assert 1 <= len(finished) < 40
    for path in finished:
        assert read_demonstration(path).good
    (out / ".001_good_novice.parquet.tmp-abcdefgh").write_bytes(b"PAR1 half")
    process = start_recording(out, quick)
    end = time.monotonic() + 90
    while len(list(out.glob("*.parquet"))) < len(finished) + 2:
        assert time.monotonic() < end
        time.sleep(0.01)
    process.terminate()
    assert process.wait(60) == 143
    assert process.stderr.read() == "terminated\n"
    assert {path: path.stat().st_mtime_ns for path in finished} == finished
    names = {path.name for path in out.iterdir()}
    assert {path.name for path in out.glob(".*")} == set()
    assert names <= {"index.json", *json.loads((out / "index.json").read_text())["files"]}


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_ends_a_recording_with_one_line_and_exit_code_130(tmp_path, quick, jobs):
    out = tmp_path / "out"
    with start_recording(out, quick, jobs=jobs) as process:
        os.killpg(process.pid, signal.SIGINT)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert stderr == "interrupted\n"
    assert list(out.glob(".*")) == []
    for path in out.glob("*.parquet"):
        read_demonstration(path)


@pytest.mark.slow
def test_a_full_disk_is_reported_and_finished_recordings_stay(tmp_path, quick, monkeypatch):
    written = []

    def write_until_full(path, data):
        if path.suffix == ".parquet" and len(written) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        write_atomically(path, data)
        written.append(path)

    monkeypatch.setattr("skill.data.tables.write_atomically", write_until_full)
    out = tmp_path / "out"
    line = error_line(invoke("record", "--out", out, "--good", 4, "--bad", 0, "--scenario", quick, "--jobs", 1))
    assert "002_good_expert.parquet: not written (No space left on device); 2 of 4 demonstrations" in line
    assert "make room and give the same command again" in line
    finished = sorted(out.glob("*.parquet"))
    assert [path.name for path in finished] == ["000_good_expert.parquet", "001_good_novice.parquet"]
    for path in finished:
        read_demonstration(path)


def test_the_margins_are_printed_and_an_unstable_scenario_is_refused(tmp_path, quick, capfd):
    record(out=tmp_path / "out", good=1, bad=0, seed=0, scenario=quick, jobs=1, overwrite=False)
    assert "Colgate" in capfd.readouterr().out
    path = tmp_path / "hard.yaml"
    path.write_text(yaml.safe_dump({**QUICK, "coupling": {"force_scale": 1.0}}))
    line = error_line(invoke("record", "--out", tmp_path / "hard", "--good", 1, "--bad", 0, "--scenario", path))
    assert "not stable" in line
    assert not (tmp_path / "hard").exists()
    load_scenario(str(path))  # the file itself is valid


def test_the_functions_behind_the_commands_raise_their_errors(tmp_path):
    from experiments.practice_rounds import Practice
    from experiments.trial import Arm
    from scripts import demo, practice_session
    from scripts.rig_session import run
    from scripts.train_session import train

    nowhere = tmp_path / "nowhere"
    with pytest.raises(ValueError, match="nominel"):
        demo.demo(out=nowhere, good=1, bad=0, trials=1, seed=0, scenario="nominel", jobs=1)
    with pytest.raises(ValueError, match="nominel"):
        record_live(out=nowhere, seed=0, scenario="nominel", driver=None, port=None)
    with pytest.raises(ValueError, match="no demonstrations"):
        train(demonstrations=[nowhere], out=nowhere / "skill.npz", seed=0)
    rig = {"trials": 1, "seed": 0, "tilt_deg": None, "friction": None, "out": nowhere, "json": None, "jobs": 1}
    rig |= {"overwrite": False, "arm": Arm.DEFAULT}
    with pytest.raises(ValueError, match="no such skill file"):
        run(skill=nowhere, scenario="nominal", **rig)
    with pytest.raises(ValueError, match="no such skill file"):
        practice_session.run(
            **{"skill": nowhere, "out": nowhere, "practice": Practice(), "held_out": 2, "held_out_seed": 0},
            **{"scenario": "nominal", "jobs": 1},
        )


def test_a_skill_of_another_hole_or_period_cannot_watch(tmp_path, quick_scenario, skill_file):
    page = {"out": tmp_path, "seed": 0, "driver": None, "port": None, "skill": skill_file}
    with pytest.raises(ValueError, match="the skill was trained for geometry"):
        record_live(scenario="nominal", **page)
    quick_scenario.recorder.period = 0.01
    path = tmp_path / "fast.yaml"
    path.write_text(dump_scenario(quick_scenario))
    with pytest.raises(ValueError, match=r"the skill acts every 0.02 s, the scenario records every 0.01 s"):
        record_live(scenario=str(path), **page)
