"""Reading a folder of results: what is read, what is left out, and what is refused in one line."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from experiments.scoreboard.result_store import read_trials
from tests.experiments.scoreboard.simulated_trials import FAILED, LAW, LEARNT, write_sweep, write_trials


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


def test_of_each_engine_only_the_newest_code_counts_and_the_others_are_counted(tmp_path):
    write_trials(tmp_path, [{"code": "old", "began": "2026-01-01T00:00:00+00:00"}], engine="drake")
    zones = ("2026-02-01T00:30:00+02:00", "2026-01-31T23:00:00+00:00", "2025-12-01T00:00:00+00:00")
    rows = [{"trial": k, "code": "abc"[k % 3], "began": zones[k % 3]} for k in range(8)]
    write_trials(tmp_path, rows, engine="exact")
    found = read_trials(tmp_path)
    assert found.codes == {"drake": "old", "exact": "b"}  # 23:00 UTC is later than 0:30 two hours east of it
    assert found.table["trial"].tolist() == [0, 1, 4, 7]
    assert found.left_out == {"a": 3, "c": 2}


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


def test_sweeps_are_listed_with_their_titles_and_one_that_is_none_is_named(tmp_path):
    write_trials(tmp_path, [{}])
    write_sweep(tmp_path, "b", "'Friction: what it does'")
    (tmp_path / "sweeps" / "a.yaml").write_text("trials: 3\n")
    found = [(sweep.path.name, sweep.title) for sweep in read_trials(tmp_path).sweeps]
    assert found == [("a.yaml", "a"), ("b.yaml", "Friction: what it does")]
    for text in ("- a\n", "title: 3\n", "title: [\n"):
        write_sweep(tmp_path, "b").write_text(text)
        refused(tmp_path, tmp_path / "sweeps" / "b.yaml")


def test_unfinished_files_are_not_read_and_rows_in_two_files_count_once(tmp_path):
    path = write_trials(tmp_path, [{}])
    path.with_name(f".{path.name}.tmp-abcdefgh").write_bytes(b"PAR1")
    path.with_name("note.txt").write_text("x")
    write_trials(tmp_path, [{}, {"trial": 1}], block="0001")
    assert read_trials(tmp_path).table["trial"].tolist() == [0, 1]


# ------------------------------------------------------------ what is refused


def refused(folder, *parts):
    with pytest.raises(ValueError, match=r"^\S") as error:
        read_trials(folder)
    for part in parts:
        assert str(part) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_an_empty_and_a_foreign_folder_are_named(tmp_path):
    refused(tmp_path / "none", tmp_path / "none", "no folder 'trials'")
    refused(tmp_path, tmp_path, "no folder 'trials'")
    (tmp_path / "trials").mkdir()
    refused(tmp_path, tmp_path, "no trials yet")
    path = write_trials(tmp_path, [])
    refused(tmp_path, tmp_path, "no trials yet")
    other = tmp_path / "trials" / "policy=x" / "block.parquet"
    other.parent.mkdir()
    path.rename(other)
    refused(tmp_path, other, "not a file of trials")


@pytest.mark.parametrize(
    "columns", [{"wedged_s": None}, {"code": pa.array([None], pa.string())}, {"began": pa.array(["yesterday"])}]
)
def test_a_file_with_other_columns_is_named(tmp_path, columns):
    path = write_trials(tmp_path, [{}])
    table = pq.read_table(path, partitioning=None)
    for name, values in columns.items():
        place = table.schema.get_field_index(name)
        table = table.remove_column(place) if values is None else table.set_column(place, name, values)
    pq.write_table(table, path)
    refused(tmp_path, path)


def test_a_damaged_file_is_named(tmp_path):
    path = write_trials(tmp_path, [{}])
    path.write_bytes(path.read_bytes()[:-200])
    refused(tmp_path, path)


@pytest.mark.parametrize("demonstrations", [None, 2])
def test_a_trial_in_two_scenarios_of_the_same_name_is_named_with_both_files(tmp_path, demonstrations):
    same = {"trial": 3, "demonstration_set": demonstrations}
    one = write_trials(tmp_path, [same | {"key": "a", "friction": 0.1}, {"trial": 4}])
    other = write_trials(tmp_path, [same | {"key": "b", "friction": 0.2}], block="0001")
    refused(tmp_path, one, other, "trial 3 of one policy under the same conditions; the scenario has changed")
