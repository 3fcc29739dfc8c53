from pathlib import Path

import pytest

from skill.data.demonstration import write_demonstration
from skill.data.rig_run import write_rig_run
from skill.data.tables import write_table
from tests.scripts.commands import error_line, invoke
from tests.trajectories import make_demonstration, make_rig_run


def replay(*arguments):
    return invoke("replay", *arguments, "--no-open")


# -------------------------------------------------------------------- what it writes


def test_page_is_written_to_the_given_file(tmp_path):
    run_file, page = tmp_path / "run.parquet", tmp_path / "other.html"
    write_rig_run(make_rig_run(), run_file)
    result = replay(run_file, "--out", page)
    assert result.exit_code == 0, result.output
    text = page.read_text()
    assert "<title>run</title>" in text[:500]
    assert '<p class="about">rig run: inserted</p>' in text
    assert not run_file.with_suffix(".html").exists()
    assert "is the recording; choose another file" in error_line(replay(run_file, "--out", run_file))
    line = error_line(replay(run_file, "--skill", "skill.npz"))
    assert line.endswith("run.parquet: a rig run, which contains its own contact states; expected no --skill")


def test_page_is_written_beside_the_recording_with_the_given_speed(tmp_path):
    demonstration_file = tmp_path / "demonstration.parquet"
    write_demonstration(make_demonstration(), demonstration_file)
    assert replay(demonstration_file, "--speed", 8).exit_code == 0
    text = demonstration_file.with_suffix(".html").read_text()
    assert '"speed":8.0' in text
    assert '<p class="about">demonstration: inserted, good</p>' in text


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
