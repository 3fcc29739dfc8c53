from pathlib import Path

import pytest

from skill.data.demonstration import write_demonstration
from skill.data.rig_run import write_rig_run
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
    assert '<p class="about">rig run: inserted</p>' in text
    assert not run_file.with_suffix(".html").exists()


def test_page_is_written_beside_the_recording_with_the_given_speed(demonstration_file):
    assert replay(demonstration_file, "--speed", 8).exit_code == 0
    text = demonstration_file.with_suffix(".html").read_text()
    assert '"speed":8.0' in text
    assert '<p class="about">demonstration: inserted, good</p>' in text


def test_recording_is_not_overwritten(run_file):
    before = run_file.read_bytes()
    assert replay(run_file, "--out", run_file).exit_code == 1
    assert run_file.read_bytes() == before


# -------------------------------------------------------------------- what it imports


# -------------------------------------------------------------------- errors


def write_other_kind(path: Path) -> None:
    samples = make_rig_run().samples[["time", "fx"]]
    write_table(samples, ("time", "fx"), path, kind="notes", version=1, header={})


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda path: None, "no such file"),
        (lambda path: path.write_text("time,x\n0,1\n"), "not a complete Parquet file"),
        (write_other_kind, "neither a demonstration nor a rig run"),
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
