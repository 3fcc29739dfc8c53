"""The files of cells: each row has one place, and is written whole."""

import os
from pathlib import Path
from types import SimpleNamespace

import duckdb
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.scoreboard.result_store import read_trials
from experiments.sweep.cell_files import SIZE, CellFile, files_of, row_key
from experiments.sweep.trial_files import SCHEMA
from tests.experiments.sweep.conftest import PARTITIONING
from tests.experiments.sweep.made_up_rows import made_up_row

DIGEST = "a" * 16


def files(folder, numbers, **changes):
    """The files of a cell that says no more than where its rows are."""
    cell = {"digest": DIGEST, "policy": "CA states, contexts + LWR", "trial_set": "usual", "engine": "drake"}
    return files_of(SimpleNamespace(**{**cell, "numbers": numbers, **changes}), folder)


@given(st.sets(st.integers(0, 1000), min_size=1), st.sets(st.integers(0, 1000), min_size=1))
def test_a_trial_has_the_same_file_whatever_else_is_wanted(one, other):
    places = [
        {n: file.path for file in files(Path("results"), numbers) for n in file.missing} for numbers in (one, other)
    ]
    assert set(places[0]) == one
    assert all(places[0][n] == places[1][n] for n in one & other)
    assert all(n // SIZE == m // SIZE for n in one for m in one if places[0][n] == places[0][m])


def test_rows_are_written_and_read_by_pandas_and_duckdb_without_us(tmp_path):
    for trial_set in ("usual", "hard"):
        for file in files(tmp_path, range(150), trial_set=trial_set, digest=f"{trial_set:a<16}"):
            numbers = sorted(file.missing)
            for number in numbers:
                file.add(made_up_row(number))
            assert file.write() == len(numbers)
    frame = pd.read_parquet(tmp_path / "trials")
    assert frame["key"].nunique() == len(frame) == 300
    assert set(frame.columns) == {*SCHEMA.names, "policy", "trial_set", "engine"}
    query = f"select trial_set, count(*) from '{tmp_path}/trials/**/*.parquet' group by trial_set order by trial_set"
    assert duckdb.sql(query).fetchall() == [("hard", 150), ("usual", 150)]


@pytest.mark.parametrize(
    "names", [("01", "1", "1.0"), ("2026-01-31", "31"), ("true", "null", "nan"), ("a b/c=%20", "a")]
)
def test_names_of_policies_stay_texts(tmp_path, names):
    for k, name in enumerate(names):
        (file,) = files(tmp_path, [3], policy=name, digest=f"{k:016}")
        file.add(made_up_row(3))
        file.write()
    frame = pd.read_parquet(tmp_path / "trials", partitioning=PARTITIONING)
    assert sorted(frame["policy"]) == sorted(names)
    assert sorted(read_trials(tmp_path).table["policy"].unique()) == sorted(names)


def test_a_file_goes_on_with_what_is_there_also_after_a_write_that_failed(tmp_path, monkeypatch):
    (file,) = files(tmp_path, range(5))
    file.add(made_up_row(3))
    assert file.write() == 1

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        file.add(made_up_row(2))
        with pytest.raises(OSError, match="No space"):
            file.write()
    assert files(tmp_path, range(5))[0].missing == {0, 1, 2, 4}
    assert file.write() == 1
    (again,) = files(tmp_path, range(8))
    assert again.missing == {0, 1, 4, 5, 6, 7}
    again.add({**made_up_row(0), "train_s": None, "demonstrations": None, "trusted": None})
    assert again.write() == 1
    assert again.write() == 0
    table = pq.read_table(again.path, partitioning=None)
    assert table.schema.equals(SCHEMA)
    assert table["trial"].to_pylist() == [0, 2, 3]
    assert table["key"].to_pylist() == [row_key(DIGEST, number) for number in (0, 2, 3)]
    assert [path.name for path in file.path.parent.iterdir()] == [file.path.name]
    other = SimpleNamespace(digest="b" * 16)
    with pytest.raises(ValueError, match="holds other trials than its name says"):
        CellFile(file.path, other, [3])
