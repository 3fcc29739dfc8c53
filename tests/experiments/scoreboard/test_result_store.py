"""Reading a folder of results: what is read, what is left out, and what is refused in one line."""

import math
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from experiments.scoreboard.result_store import read_trials
from tests.experiments.scoreboard.simulated_trials import FAILED, LAW, LEARNT, write_results, write_sweep, write_trials

ROOT = Path(__file__).resolve().parents[3]


def test_rows_have_their_partition_and_the_types_that_statistics_need(tmp_path):
    write_trials(tmp_path, [{"trial": 5, "demonstration_set": 2}, FAILED | {"trusted": None}], policy=LAW)
    write_trials(tmp_path, [{}], policy=LEARNT, trial_set="hard", engine="exact")
    found = read_trials(tmp_path)
    table = found.table.sort_values(["policy", "trial"])
    assert table["policy"].tolist() == [LEARNT, LAW, LAW]
    assert table["trial_set"].tolist() == ["hard", "usual", "usual"]
    assert table["engine"].tolist() == ["exact", "drake", "drake"]
    assert table["trial"].tolist() == [0, 1, 5]
    assert table["inserted"].tolist() == [True, False, True]
    assert table["inserted"].dtype == bool
    np.testing.assert_array_equal(table["trusted"], [1.0, np.nan, 1.0])
    np.testing.assert_array_equal(table["demonstration_set"], [np.nan, np.nan, 2.0])
    assert set(found.codes.values()) == {"c0de0001"}
    assert found.left_out == {}


def test_only_the_newest_code_counts_and_the_others_are_counted(tmp_path):
    zones = ("2026-02-01T00:30:00+02:00", "2026-01-31T23:00:00+00:00", "2025-12-01T00:00:00+00:00")
    rows = [{"trial": k, "code": "abc"[k % 3], "began": zones[k % 3]} for k in range(8)]
    write_trials(tmp_path, rows)
    found = read_trials(tmp_path)
    assert set(found.codes.values()) == {"b"}  # 23:00 UTC is later than 0:30 two hours east of it
    assert found.table["trial"].tolist() == [1, 4, 7]
    assert found.left_out == {"a": 3, "c": 2}


def test_each_engine_has_its_newest_code(tmp_path):
    write_trials(tmp_path, [{"code": "old", "began": "2026-01-01T00:00:00+00:00"}], engine="drake")
    rows = [{"trial": k, "code": code, "began": f"2026-02-0{k + 1}T00:00:00+00:00"} for k, code in enumerate("ab")]
    write_trials(tmp_path, rows, engine="exact")
    found = read_trials(tmp_path)
    assert found.codes == {"drake": "old", "exact": "b"}
    assert found.left_out == {"a": 1}
    assert sorted(found.table["engine"]) == ["drake", "exact"]


def test_of_a_policy_that_was_made_anew_only_the_newest_counts(tmp_path):
    def trials(skill, began, numbers, **same):
        when = {"began": f"2026-02-0{began}T00:00:00+00:00"}
        return [{"trial": k, "key": f"{skill}/{k}", "skill": skill, **when, **same} for k in numbers]

    first, again = trials("old", 1, range(3), demonstration_set=1), trials("new", 2, range(2), demonstration_set=1)
    write_trials(tmp_path, [*first, *again])
    write_trials(tmp_path, trials("same", 1, range(4), demonstration_set=2), block="0001")
    write_trials(tmp_path, trials("alone", 1, range(5)), policy=LAW)
    found = read_trials(tmp_path)
    assert found.table["skill"].value_counts().to_dict() == {"alone": 5, "same": 4, "new": 2}
    assert (found.replaced, found.skills) == (3, ("alone", "new", "same"))
    assert found.left_out == {}


def test_sweeps_are_listed_with_their_titles(tmp_path):
    write_trials(tmp_path, [{}])
    write_sweep(tmp_path, "b", "'Friction: what it does'")
    (tmp_path / "sweeps" / "a.yaml").write_text("trials: 3\n")
    (tmp_path / "sweeps" / "c.yaml").write_text("title: >\n  over\n  two lines\n")
    (tmp_path / "sweeps" / "d.yaml").write_text("title: friction # a draft\n")
    assert [(s.path.name, s.title) for s in read_trials(tmp_path).sweeps] == [
        ("a.yaml", "a"),
        ("b.yaml", "Friction: what it does"),
        ("c.yaml", "over two lines"),
        ("d.yaml", "friction"),
    ]


@pytest.mark.parametrize("text", ["- a\n", "title: 3\n", "title: [\n", "'"])
def test_a_stored_sweep_that_is_none_is_named(tmp_path, text):
    write_trials(tmp_path, [{}])
    write_sweep(tmp_path, "b").write_text(text)
    refused(tmp_path, tmp_path / "sweeps" / "b.yaml")


def test_unfinished_files_are_not_read(tmp_path):
    path = write_trials(tmp_path, [{}])
    path.with_name(f".{path.name}.tmp-abcdefgh").write_bytes(b"PAR1")
    path.with_name("note.txt").write_text("x")
    assert len(read_trials(tmp_path).table) == 1


# ------------------------------------------------------------ what is refused


def refused(folder, *parts):
    with pytest.raises(ValueError, match=r"^\S") as error:
        read_trials(folder)
    for part in parts:
        assert str(part) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_an_empty_and_a_foreign_folder_are_named(tmp_path):
    refused(tmp_path / "none", tmp_path / "none", "no such folder")
    refused(tmp_path, tmp_path, "no folder 'trials'")
    (tmp_path / "trials").mkdir()
    refused(tmp_path, tmp_path, "no trials yet")
    (tmp_path / "file").write_text("x")
    refused(tmp_path / "file", "is a file")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("time_s", v) for v in (math.inf, -5.0, math.nan)),
        *(("time_limit_s", -math.inf), ("trial", -3), ("demonstration_set", -1), ("lost_steps", -2)),
        *(("peak_load_n", math.inf), ("wedged_s", -0.5)),
    ],
)
def test_numbers_that_no_trial_has_are_named(tmp_path, name, value):
    path = write_trials(tmp_path, [{}, {"trial": 1, name: value}])
    refused(tmp_path, path, f"'{name}' in row 1 is {value:g}, expected a finite number from 0 on")


def test_a_score_may_be_negative_but_not_infinite(tmp_path):
    write_trials(tmp_path / "a", [{"field_score": -11.0}])
    assert read_trials(tmp_path / "a").table["field_score"].tolist() == [-11.0]
    path = write_trials(tmp_path / "b", [{"field_score": -math.inf}])
    refused(tmp_path / "b", path, "'field_score' in row 0 is -inf, expected a finite number")


def test_half_a_trial_is_named(tmp_path):
    path = write_trials(tmp_path, [{}])
    table = pq.read_table(path)
    place = table.schema.get_field_index("trial")
    pq.write_table(table.set_column(place, "trial", pa.array([0.5])), path)
    refused(tmp_path, path, "column 'trial' has type double, expected int64")


@pytest.mark.parametrize("kind", ["pipe", "folder", "link"])
@pytest.mark.parametrize("place", ["trials", "sweeps"])
def test_what_is_no_file_is_named_and_not_waited_for(tmp_path, kind, place):
    path, message = write_trials(tmp_path, [{}]).with_name("y.parquet"), "no such file"
    if place == "sweeps":
        path, message = write_sweep(tmp_path, "b").with_name("y.yaml"), "no regular file"
    elif kind != "link":
        message = "expected a file"
    {"pipe": os.mkfifo, "folder": os.mkdir, "link": lambda p: p.symlink_to("nowhere")}[kind](path)
    # With an open end, a pipe that is read fails the test instead of hanging it.
    with os.fdopen(os.open(path, os.O_RDWR), "r+b", 0) if kind == "pipe" else nullcontext():
        refused(tmp_path, path, message)


def test_a_file_without_rows_is_no_trial(tmp_path):
    path = write_trials(tmp_path, [])
    refused(tmp_path, tmp_path, "no trials yet")
    write_trials(tmp_path, [{}], block="0001")
    assert len(read_trials(tmp_path).table) == 1
    assert path.exists()


def test_a_file_in_another_place_is_named(tmp_path):
    path = write_trials(tmp_path, [{}])
    other = tmp_path / "trials" / "policy=x" / "block.parquet"
    other.parent.mkdir()
    path.rename(other)
    refused(tmp_path, other, "not a file of trials")


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-200], lambda b: b"", lambda b: b[: len(b) // 2] + b"x" + b[len(b) // 2 :]]
)
def test_a_damaged_file_is_named(tmp_path, damage):
    write_trials(tmp_path, [{}])
    path = write_trials(tmp_path, [{"trial": 1}], block="0001")
    path.write_bytes(damage(path.read_bytes()))
    refused(tmp_path, path)


def change(path, **columns):
    table = pq.read_table(path, partitioning=None)
    for name, values in columns.items():
        place = table.schema.get_field_index(name)
        table = table.remove_column(place) if values is None else table.set_column(place, name, values)
    pq.write_table(table, path)


@pytest.mark.parametrize(
    ("name", "values", "part"),
    [
        ("wedged_s", None, "lacks the columns ['wedged_s']"),
        ("time_s", pa.array(["2.5"]), "column 'time_s' has type string, expected double"),
        ("code", pa.array([None], pa.string()), "column 'code' is empty in 1 rows, expected a value"),
        ("began", pa.array(["yesterday"]), "'began' is no time"),
    ],
)
def test_a_file_with_other_columns_is_named(tmp_path, name, values, part):
    path = write_trials(tmp_path, [{}])
    change(path, **{name: values})
    refused(tmp_path, path, part)


def test_a_trial_that_is_stored_twice_is_named_with_both_files(tmp_path):
    one = write_trials(tmp_path, [{"trial": 3}])
    other = write_trials(tmp_path, [{"trial": 4}, {"trial": 3}], block="0001")
    refused(tmp_path, one, other, "trial 3")


@pytest.mark.parametrize("demonstrations", [None, 2])
def test_a_trial_in_two_scenarios_of_the_same_name_is_named_with_both_files(tmp_path, demonstrations):
    same = {"trial": 3, "demonstration_set": demonstrations}
    one = write_trials(tmp_path, [same | {"key": "a", "friction": 0.1}, {"trial": 4}])
    other = write_trials(tmp_path, [same | {"key": "b", "friction": 0.2}], block="0001")
    refused(tmp_path, one, other, "trial 3 of one policy and cell; the scenario, which has changed")


# ------------------------------------------------------------ memory


@pytest.mark.nightly
@pytest.mark.slow
def test_ten_thousand_trials_need_little_memory(tmp_path):
    """Each row has a scenario of 20 kB, 200 MB in all; reading and summarising adds less than 60 MB."""
    filler = np.random.default_rng(0).bytes(10_000).hex()
    for block in range(20):
        rows = [{"trial": 500 * block + k, "scenario": f"{k} {block} {filler}"} for k in range(500)]
        write_trials(tmp_path, rows, block=f"{block:04d}")
    code = """
import resource, sys
from contextlib import nullcontext
from pathlib import Path
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
import tests.experiments.scoreboard.simulated_trials as simulated
small, large = (Path(a) for a in sys.argv[1:])
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
make_scoreboard(read_trials(small))
before = peak()
assert make_scoreboard(read_trials(large)).trials == 10_000
print(peak() - before)
"""
    small = write_results(tmp_path / "small", count=4)
    done = subprocess.run(
        [sys.executable, "-c", code, small, tmp_path],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        env={"PYTHONPATH": str(ROOT), "PATH": "", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 60.0
