"""Outputs are tried before the work, and failures of writing are one line."""

import errno
import os
import shutil
from pathlib import Path

import pytest

from systems.outputs.output_checks import check_file, check_folder, named_errors, require_distinct


@pytest.mark.parametrize("name", ["new", "new/deep/er", "there"])
def test_a_folder_that_can_be_written_passes_and_is_not_made(tmp_path, name):
    (tmp_path / "there").mkdir()
    check_folder(tmp_path / name)
    check_file(tmp_path / name / "x.json")
    assert [p.name for p in tmp_path.rglob("*")] == ["there"]


def test_a_relative_path_of_one_name_passes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_folder(Path("out"))
    check_file(Path("x.json"))


def test_a_file_in_the_place_of_a_folder_is_named(tmp_path):
    (tmp_path / "taken").write_text("mine")
    for path in (tmp_path / "taken", tmp_path / "taken" / "deep"):
        with pytest.raises(OSError, match=r"--out .*taken is not a folder"):
            check_folder(path)
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(OSError, match="link is not a folder"):
        check_folder(tmp_path / "link" / "x")


def test_a_file_output_must_be_an_ordinary_file(tmp_path):
    with pytest.raises(OSError, match=r"--json .*: is a folder"):
        check_file(tmp_path, option="--json")
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/null")):
        with pytest.raises(OSError, match="is a device or a pipe"):
            check_file(path)


def test_a_place_that_cannot_be_written_is_named():
    with pytest.raises(OSError, match=r"--out /proc/new: cannot write in /proc \("):
        check_folder(Path("/proc/new"))


def test_a_name_that_is_too_long_for_the_temporary_file_is_refused(tmp_path):
    check_file(tmp_path / ("x" * 244))
    with pytest.raises(OSError, match="the name is longer than 245 bytes"):
        check_file(tmp_path / ("x" * 246))
    with pytest.raises(OSError, match="the name is longer"):
        check_folder(tmp_path / ("x" * 246))


def test_too_little_room_is_refused_with_both_sizes(tmp_path):
    free = shutil.disk_usage(tmp_path).free
    check_folder(tmp_path, size=free // 2)
    with pytest.raises(OSError, match=r"needs about [\d,]+ MB, but only [\d,]+ MB are free"):
        check_folder(tmp_path / "new", size=2 * free)


def test_two_options_with_one_file_are_refused(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "a.npz")
    require_distinct({"--skill": tmp_path / "a.npz", "--json": tmp_path / "b.json"})
    with pytest.raises(ValueError, match="--skill and --json are the same file"):
        require_distinct({"--skill": tmp_path / "a.npz", "--json": tmp_path / "link"})


def test_an_error_without_a_file_name_gets_one(tmp_path):
    with (
        pytest.raises(OSError, match=r"x\.json: not written \(No space left on device\); all else is kept$"),
        named_errors(tmp_path / "x.json", "all else is kept"),
    ):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
