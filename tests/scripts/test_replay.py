from pathlib import Path

import numpy as np
import pytest

from skill.data.demonstration import Demonstration, write_demonstration
from skill.data.outcome import Outcome
from skill.data.rig_run import RigRun, write_rig_run
from skill.data.tables import write_table
from tests.scripts.commands import error_line, invoke
from tests.trajectories import make_demonstration, make_rig_run


@pytest.fixture
def demonstration_file(tmp_path: Path) -> Path:
    path = tmp_path / "demonstration.parquet"
    write_demonstration(make_demonstration(), path)
    return path


@pytest.fixture
def run_file(tmp_path: Path) -> Path:
    path = tmp_path / "run.parquet"
    write_rig_run(make_rig_run(), path)
    return path


def replay(*arguments):
    return invoke("replay", *arguments, "--no-open")


# -------------------------------------------------------------------- what it writes


def test_page_is_written_to_the_given_file(run_file, tmp_path):
    page = tmp_path / "other.html"
    result = replay(run_file, "--out", page)
    assert result.exit_code == 0, result.output
    text = page.read_text()
    assert "<title>run</title>" in text[:500]
    assert '"about":"rig run: inserted"' in text
    assert not run_file.with_suffix(".html").exists()


def test_page_is_written_beside_the_recording_with_the_given_speed(demonstration_file):
    assert replay(demonstration_file, "--speed", 8).exit_code == 0
    text = demonstration_file.with_suffix(".html").read_text()
    assert '"speed":8.0' in text
    assert '"about":"demonstration: inserted, good"' in text


def test_recording_is_not_overwritten(run_file):
    before = run_file.read_bytes()
    assert replay(run_file, "--out", run_file).exit_code == 1
    assert run_file.read_bytes() == before


# -------------------------------------------------------------------- what it imports


# -------------------------------------------------------------------- errors


def write_other_kind(path: Path) -> None:
    samples = make_rig_run().samples[["time", "fx"]]
    write_table(samples, ("time", "fx"), path, kind="notes", version=1, header={})


def write_without_geometry(path: Path) -> None:
    good = make_demonstration()
    write_demonstration(Demonstration(good.samples, True, Outcome.INSERTED, metadata={"seed": 1}), path)


def write_impossible_geometry(path: Path) -> None:
    good = make_rig_run()
    geometry = {**good.metadata["geometry"], "block_radius": 0.005}
    write_rig_run(RigRun(good.samples, good.result, {"geometry": geometry}), path)


def write_fractional_state(path: Path) -> None:
    run = make_rig_run()
    run.samples["state"] += np.where(run.samples.index == 3, 0.5, 0.0)
    write_rig_run(run, path)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.write_text("time,x\n0,1\n"), "not a complete Parquet file"),
        (write_other_kind, "neither a demonstration nor a rig run"),
        (write_without_geometry, "no geometry"),
        (write_impossible_geometry, "block radius 0.005"),
        (write_fractional_state, "column 'state' holds 0.5"),
    ],
)
def test_invalid_file_gives_one_error_line_that_names_it(tmp_path, write, message):
    path = tmp_path / "bad.parquet"
    write(path)
    before = sorted(tmp_path.iterdir())
    line = error_line(replay(path))
    assert str(path) in line
    assert message in line
    assert sorted(tmp_path.iterdir()) == before


def test_error_names_a_missing_skill(demonstration_file, tmp_path):
    line = error_line(replay(demonstration_file, "--skill", tmp_path / "none.npz"))
    assert "none.npz" in line
    assert not demonstration_file.with_suffix(".html").exists()
