"""Outputs are tried before the work, and failures of writing are one line."""

import shutil
from contextlib import nullcontext
from pathlib import Path

import pytest

from experiments.outputs.output_checks import check_file, check_folder, require_distinct
from tests.experiments.outputs.sets import make_set


@pytest.mark.parametrize("name", ["new", "new/deep/er", "there"])
def test_a_folder_that_can_be_written_passes_and_is_not_made(tmp_path, name):
    (tmp_path / "there").mkdir()
    check_folder(tmp_path / name)
    check_file(tmp_path / name / "x.json", ".json")
    assert [p.name for p in tmp_path.rglob("*")] == ["there"]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "taken").write_text("mine")
    for path in (tmp_path / "taken", tmp_path / "taken" / "deep"):
        with pytest.raises(OSError, match=r"--out .*taken is not a folder"):
            check_folder(path)
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(OSError, match="link is not a folder"):
        check_folder(tmp_path / "link" / "x")
    with pytest.raises(OSError, match=r"--out /proc/new: cannot write in /proc \("):
        check_folder(Path("/proc/new"))
    with pytest.raises(OSError, match=r"--json .*: is a folder"):
        check_file(tmp_path, ".json", option="--json")
    with pytest.raises(OSError, match="is a device or a pipe"):
        check_file(Path("/dev/null"), ".json")


def test_a_name_that_is_too_long_for_the_temporary_file_is_refused(tmp_path):
    check_file(tmp_path / ("x" * 241), ".json")
    with pytest.raises(OSError, match="File name too long"):
        check_file(tmp_path / ("x" * 250), ".json")


def test_too_little_room_is_refused_with_both_sizes(tmp_path):
    free = shutil.disk_usage(tmp_path).free
    check_folder(tmp_path, size=free // 2)
    with pytest.raises(OSError, match=r"needs about [\d,]+ MB, but only [\d,]+ MB are free"):
        check_folder(tmp_path / "new", size=2 * free)


KINDS = {
    ".npz": b"PK\x03\x04" + bytes(26) + b"a.npy",
    "trials.json": b'[\n {\n  "seed": 0',
    "query_states.json": b'[\n {\n  "trial": 0',
    "practice.json": b'{\n "versions": {',
    ".html": b"<!doctype html>",
    ".png": b"\x89PNG\r\n\x1a\n",
}
FOREIGN = {
    ".parquet": b"PAR1",
    ".json": b'{"mine": 1}',
    "list.json": b'[\n {\n  "mine": 1',
    ".txt": b"mine",
    ".zip": b"PK\x03\x04" + bytes(26) + b"letter.xml",
}


def test_only_a_file_of_the_same_kind_or_an_empty_one_is_replaced(tmp_path):
    for suffix, content in {**KINDS, **FOREIGN, "": b""}.items():
        (tmp_path / f"a{suffix}").write_bytes(content)
    for kind in KINDS:
        for path in sorted(tmp_path.iterdir()):
            is_same = path.name in (f"a{kind}", "a")
            with nullcontext() if is_same else pytest.raises(ValueError, match="is not replaced by"):
                check_file(path, kind)
    for name, found in (("a.npz", "a skill file"), ("a.json", "another JSON file")):
        expected = rf"--json .*{name}: is {found}, and is not replaced by a file of results \(JSON\); choose another"
        with pytest.raises(ValueError, match=expected):
            check_file(tmp_path / name, "trials.json", option="--json")


def test_a_file_of_a_set_and_its_index_are_not_replaced(tmp_path):
    make_set(tmp_path, 1)
    (tmp_path / "other.png").touch()
    check_file(tmp_path / "other.png", ".png")
    with pytest.raises(
        ValueError, match=r"demonstrations\.png: belongs to what .*index\.json lists; choose another --out"
    ):
        check_file(tmp_path / "demonstrations.png", ".png")
    with pytest.raises(ValueError, match=r"index\.json: belongs to .*; choose another --json"):
        check_file(tmp_path / "index.json", ".json", option="--json")


def test_two_options_with_one_file_are_refused(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "a.npz")
    require_distinct({"--skill": tmp_path / "a.npz", "--json": tmp_path / "b.json"})
    with pytest.raises(ValueError, match="--skill and --json are the same file"):
        require_distinct({"--skill": tmp_path / "a.npz", "--json": tmp_path / "link"})
