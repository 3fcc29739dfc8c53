"""Folders of one request: continued, protected, and replaced as a whole."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.outputs.folder_lock import remove_unfinished
from experiments.outputs.output_set import (
    NEW,
    READY,
    RUNS,
    SetIndex,
    find_recordings,
    finish_replacement,
    open_live_folder,
    open_set,
    read_index,
)
from skill.data.demonstration import read_demonstration, write_demonstration
from skill.data.rig_run import write_rig_run
from tests.experiments.outputs.sets import NAMES, index_of, make_set, write_item
from tests.scripts.commands import files
from tests.trajectories import make_demonstration, make_rig_run

WHOLE = sorted([*NAMES, "demonstrations.png", "index.json"])


def seeds(folder, names=NAMES):
    return [read_demonstration(folder / name).metadata["seed"] for name in names]


def test_an_interrupted_set_goes_on_and_repeats_nothing(tmp_path):
    out = tmp_path / "a" / "out"
    make_set(out, 1, stop_after=0)
    assert list(tmp_path.iterdir()) == []  # nothing before the first item
    make_set(out, 1, stop_after=2)
    times = [(out / name).stat().st_mtime_ns for name in NAMES[:2]]
    assert find_recordings(out)[1].endswith("2 of 3 demonstrations are there; record again to complete the set")
    assert sorted(make_set(out, 1).finished) == list(NAMES[:2])
    assert files(out) == WHOLE
    assert read_index(out) == index_of(1)
    assert find_recordings(out) == ([out / name for name in NAMES], "")
    assert [(out / name).stat().st_mtime_ns for name in NAMES[:2]] == times


def test_a_run_without_a_valid_result_is_made_again(tmp_path):
    index = SetIndex(RUNS, {}, ("run_0000.parquet",))
    with open_set(tmp_path, index, overwrite=False) as runs:
        runs.write("run_0000.parquet", lambda path: write_rig_run(replace(make_rig_run(), result={}), path))
    with open_set(tmp_path, index, overwrite=False) as runs:
        assert (runs.finished, runs.damaged) == ({}, ["run_0000.parquet"])


def test_another_set_is_replaced_only_when_asked_and_by_a_complete_one(tmp_path):
    make_set(tmp_path, 1)
    with pytest.raises(ValueError, match=r"holds 3 demonstrations of another request \(seed 1, here 2\).*--overwrite"):
        make_set(tmp_path, 2)
    make_set(tmp_path, 2, overwrite=True, stop_after=2)
    assert seeds(tmp_path) == [1, 1, 1]
    assert files(tmp_path / NEW) == [*NAMES[:2], "index.json"]
    with open_set(tmp_path, index_of(2), overwrite=True) as items:
        assert sorted(items.finished) == list(NAMES[:2])
        write_item(items, NAMES[2], 2)
        items.complete()
    assert seeds(tmp_path) == [2, 2, 2]
    assert files(tmp_path) == [*NAMES, "index.json"]  # without the figure of the old set
    make_set(tmp_path, 2, overwrite=True)  # only the figure was missing
    assert files(tmp_path) == WHOLE


def test_a_smaller_set_removes_the_rest_of_the_old_one_and_no_other_file(tmp_path):
    make_set(tmp_path, 1)
    write_demonstration(make_demonstration(seed=9), tmp_path / "mine.parquet")
    (tmp_path / "notes.txt").write_text("mine")
    make_set(tmp_path, 2, NAMES[:2], overwrite=True)
    assert files(tmp_path) == sorted(["demonstrations.png", "index.json", "mine.parquet", "notes.txt", *NAMES[:2]])
    found, note = find_recordings(tmp_path)
    assert found == [tmp_path / name for name in NAMES[:2]]
    assert note.endswith("1 files are not in its index and are not read: mine.parquet")


def test_a_complete_set_is_made_anew_only_on_request(tmp_path):
    make_set(tmp_path, 1)
    times = [(tmp_path / name).stat().st_mtime_ns for name in NAMES]
    make_set(tmp_path, 1)
    assert [(tmp_path / name).stat().st_mtime_ns for name in NAMES] == times
    make_set(tmp_path, 1, overwrite=True)
    assert [(tmp_path / name).stat().st_mtime_ns for name in NAMES] != times


def test_results_never_stand_beside_the_runs_of_another_set(tmp_path, monkeypatch):
    """After each change of the folder during a replacement, for sets that share the name of a run."""
    names = {"old": ["run_0000.parquet", "run_0001.parquet"], "new": ["run_0001.parquet", "run_0002.parquet"]}
    for text, place in (("old", tmp_path), ("new", tmp_path / READY)):
        SetIndex(RUNS, {"set": text}, (*names[text], "results.json")).write(place)
        for name in (*names[text], "results.json"):
            (place / name).write_text(text)
    seen = []

    def watch(method):
        original = getattr(Path, method)

        def changed(*arguments, **options):
            original(*arguments, **options)
            results = tmp_path / "results.json"
            runs = {path.name: path.read_text() for path in tmp_path.glob("*.parquet")}
            seen.append((results.read_text() if results.exists() else None, runs))

        monkeypatch.setattr(Path, method, changed)

    watch("unlink")
    watch("replace")
    finish_replacement(tmp_path)
    assert seen[-1][0] == "new"
    for results, runs in seen:
        assert results is None or runs == dict.fromkeys(names[results], results)


# ------------------------------------------------------- what was not written by this program


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (NAMES[1], "not a file of this set"),
        ("000_good_live.parquet", "a recording of no set, which no command replaces"),
    ],
)
def test_a_recording_of_no_set_is_never_replaced(tmp_path, name, message):
    write_demonstration(make_demonstration(habit="live"), tmp_path / name)
    with pytest.raises(ValueError, match=f"{name}: {message}"):
        make_set(tmp_path, 2, overwrite=True)
    assert files(tmp_path) == [name]


def test_a_folder_of_live_recordings_is_only_for_live_sessions(tmp_path):
    folder = tmp_path / "live"
    with open_live_folder(folder):
        pass
    assert list(tmp_path.iterdir()) == []
    with open_live_folder(folder):
        write_demonstration(make_demonstration(habit="live"), folder / "000_good_live.parquet")
    with open_live_folder(folder):
        write_demonstration(make_demonstration(habit="live"), folder / "001_bad_live.parquet")
    assert [path.name for path in find_recordings(folder)[0]] == ["000_good_live.parquet", "001_bad_live.parquet"]
    with pytest.raises(ValueError, match="holds live recordings, not demonstrations; choose another --out"):
        make_set(folder, 1, overwrite=True)
    make_set(tmp_path / "set", 1)
    with (
        pytest.raises(ValueError, match="holds demonstrations; choose another --out"),
        open_live_folder(tmp_path / "set"),
    ):
        pass


def test_a_killed_live_session_leaves_no_temporary_file(tmp_path):
    (tmp_path / ".004_good_live.parquet.tmp-abcd1234").write_bytes(b"PAR1 half")
    (tmp_path / ".profile.parquet.txt").write_text("mine")
    write_demonstration(make_demonstration(habit="live"), tmp_path / "000_good_live.parquet")
    with open_live_folder(tmp_path):
        assert read_index(tmp_path) is not None  # also if this session is killed
    assert files(tmp_path) == [".profile.parquet.txt", "000_good_live.parquet", "index.json"]


def test_a_folder_of_runs_takes_no_demonstrations(tmp_path):
    SetIndex(RUNS, {}).write(tmp_path)
    with pytest.raises(ValueError, match="holds runs, not demonstrations"):
        make_set(tmp_path, 1, overwrite=True)
    with pytest.raises(ValueError, match="holds runs; expected demonstrations"):
        find_recordings(tmp_path)


@pytest.mark.parametrize(
    "content",
    [
        "{",
        '{"kind": "demonstrations"}',
        json.dumps({"index_version": 2, "kind": "demonstrations", "request": {}, "files": [], "reports": []}),
        json.dumps(
            {"index_version": 1, "kind": "demonstrations", "request": {}, "files": ["../x.parquet"], "reports": []}
        ),
        json.dumps({"index_version": 1, "kind": "demonstrations", "request": {}, "files": [], "reports": ["mine.txt"]}),
        "[" * 100_000,
        b"\xff\xfe",
    ],
)
def test_a_foreign_index_is_one_error_and_nothing_is_touched(tmp_path, content):
    outside = tmp_path / "x.parquet"
    outside.write_text("mine")
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "index.json").write_bytes(content if isinstance(content, bytes) else content.encode())
    write_demonstration(make_demonstration(), folder / NAMES[0])
    for use in (find_recordings, lambda f: make_set(f, 1, overwrite=True)):
        with pytest.raises(ValueError, match=r"index\.json: not an index of this program"):
            use(folder)
    assert files(tmp_path) == [f"set/{NAMES[0]}", "set/index.json", "x.parquet"]


def test_a_folder_without_an_index_is_read_whole_and_an_empty_one_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="no demonstrations"):
        find_recordings(tmp_path)
    with pytest.raises(ValueError, match="no demonstrations"):
        find_recordings(tmp_path / "nowhere")
    for name in ("b.parquet", "a.parquet"):
        write_demonstration(make_demonstration(), tmp_path / name)
    assert [path.name for path in find_recordings(tmp_path)[0]] == ["a.parquet", "b.parquet"]


@pytest.mark.parametrize("name", [NEW, READY])
def test_a_foreign_file_in_a_hidden_folder_stays(tmp_path, name):
    make_set(tmp_path, 1)
    (tmp_path / name).mkdir()
    (tmp_path / name / "letter.txt").write_text("mine")
    with pytest.raises(OSError, match=f"not empty.*{name}"):
        make_set(tmp_path, 2, overwrite=True)
    assert (tmp_path / name / "letter.txt").exists()
    assert files(tmp_path) == sorted([f"{name}/letter.txt", *WHOLE])


# ------------------------------------------------------- failures


def test_only_temporary_files_of_known_names_are_removed(tmp_path):
    for name in (
        ".a.npz.tmp-abcd123_",
        ".b.npz.tmp-abcd1234",
        ".a.npz.original",
        ".a.npz.lock",
        "a.npz",
        ".a.npz.tmp-ABCD1234",
    ):
        (tmp_path / name).touch()
    remove_unfinished(tmp_path, ["a.npz"])
    assert files(tmp_path) == [".a.npz.lock", ".a.npz.original", ".a.npz.tmp-ABCD1234", ".b.npz.tmp-abcd1234", "a.npz"]


def test_a_write_that_fails_names_the_file_and_what_is_kept(tmp_path):
    with open_set(tmp_path, index_of(1), overwrite=False) as items:
        write_item(items, NAMES[0], 1)
        with pytest.raises(OSError, match=f"{NAMES[1]}: not written .No space left on device.; 1 of 3 demonstrations"):
            items.write(NAMES[1], lambda path: write_to_full_device())


def write_to_full_device():
    with Path("/dev/full").open("wb", buffering=0) as device:
        device.write(b"x")
