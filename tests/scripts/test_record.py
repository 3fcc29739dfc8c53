"""Recordings that are finished stay complete, however the session ends."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest
import yaml

import skill.figures.paper_figures  # noqa: F401  imports write_atomically before a test replaces it
from models.scenario import dump_scenario
from scripts.record import record_live
from skill.data.demonstration import read_demonstration
from tests.scripts.commands import HAPTIC_SKILL, ROOT, invoke

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
            *(sys.executable, *HAPTIC_SKILL, "record", "--scenario", scenario, "--out", str(out)),
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


@pytest.mark.slow
def test_a_killed_recording_leaves_complete_files_and_goes_on_where_it_stopped(tmp_path, quick):
    out = tmp_path / "out"
    with start_recording(out, quick) as process:
        time.sleep(0.3)
        os.killpg(process.pid, signal.SIGKILL)
    finished = {path: path.stat().st_mtime_ns for path in out.glob("*.parquet")}
    assert 1 <= len(finished) < 40
    for path in finished:
        assert read_demonstration(path).good
    (out / ".001_good_novice.parquet.tmp-abcdefgh").write_bytes(b"PAR1 half")
    process = start_recording(out, quick, jobs=2)
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
def test_the_margins_are_a_line_or_a_table(tmp_path, quick):
    few = ("--good", 1, "--bad", 0, "--scenario", quick, "--jobs", 1)
    done = invoke("record", "--out", tmp_path / "out", *few, columns=80)
    assert "the coupling is stable: smallest margin x" in done.output
    assert "the haptic display produced at most 0." in done.output
    assert "\n1 demonstration in " in done.output
    assert "stability margins of the coupling" not in done.output
    assert "stability margins of the coupling" in invoke("record", "--out", tmp_path / "out", *few, "--verbose").output


@pytest.mark.parametrize(
    ("text", "engine", "message"),
    [
        ("geometry: {mates: [[0, 0, 0.004, 0, 0]]}", None, "contact.engine is drake, expected exact: the mesh"),
        ("geometry: {section: star}", "exact", "geometry.section is star, expected another shape"),
        ("rig: {clocking_stage: true}", "exact", "rig.clocking_stage is true, expected false: a round part"),
        (
            "coupling: {angular_damping: 20.0}",
            "exact",
            "scenario.coupling is not stable with device .paper.: B dt/m, rotation",
        ),
    ],
)
def test_a_part_that_cannot_be_felt_at_the_page_is_refused_in_a_line(tmp_path, text, engine, message):
    path = tmp_path / "part.yaml"
    path.write_text(text)
    options = () if engine is None else ("--engine", engine)
    done = invoke("record", "--live", "--scenario", path, "--out", tmp_path / "out", *options)
    assert done.exit_code == 1
    (line,) = done.stderr.strip().splitlines()
    assert re.search(message, line)


def test_a_skill_of_another_hole_or_period_cannot_watch(tmp_path, quick_scenario, skill_file):
    page = {"out": tmp_path, "seed": 0, "driver": None, "port": None, "observer": skill_file}
    with pytest.raises(ValueError, match="the skill was trained for geometry"):
        record_live(scenario="nominal", **page)
    quick_scenario.recorder.period = 0.01
    path = tmp_path / "fast.yaml"
    path.write_text(dump_scenario(quick_scenario))
    with pytest.raises(ValueError, match=r"the skill acts every 0.02 s, the scenario records every 0.01 s"):
        record_live(scenario=str(path), **page)
