"""Blocks of the data set: each row has one place, and is written whole."""

import os
from pathlib import Path

import duckdb
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.scoreboard.result_store import read_trials
from experiments.sweep.blocks import BLOCK, Block, blocks_of, row_key
from experiments.sweep.trial_files import SCHEMA
from tests.experiments.sweep.conftest import PARTITIONING
from tests.experiments.sweep.made_up_rows import made_up_row

NAMES = {"policy": "CA states, contexts + LWR", "trial_set": "usual", "engine": "drake"}


def one_block(folder, numbers, cell="a" * 16):
    (block,) = blocks_of(folder, cell, numbers, **NAMES)
    return block


@given(st.sets(st.integers(0, 1000), min_size=1), st.sets(st.integers(0, 1000), min_size=1))
def test_a_trial_has_the_same_block_whatever_else_is_wanted(one, other):
    places = [
        {n: block.path for block in blocks_of(Path("results"), "s", numbers, **NAMES) for n in block.missing}
        for numbers in (one, other)
    ]
    assert set(places[0]) == one
    assert all(places[0][n] == places[1][n] for n in one & other)
    assert all(n // BLOCK == m // BLOCK for n in one for m in one if places[0][n] == places[0][m])


def test_rows_are_written_and_read_by_pandas_and_duckdb_without_us(tmp_path):
    for trial_set in ("usual", "hard"):
        for block in blocks_of(tmp_path, f"{trial_set:a<16}", range(150), **{**NAMES, "trial_set": trial_set}):
            numbers = sorted(block.missing)
            for number in numbers:
                block.add(made_up_row(number))
            assert block.write() == len(numbers)
    frame = pd.read_parquet(tmp_path / "trials")
    assert len(frame) == 300
    assert frame["key"].is_unique
    assert set(frame["policy"]) == {NAMES["policy"]}
    assert set(frame.columns) == {*SCHEMA.names, "policy", "trial_set", "engine"}
    files = f"'{tmp_path}/trials/**/*.parquet'"
    query = f"select trial_set, count(*), sum(inserted::int) from {files} group by trial_set order by trial_set"
    assert duckdb.sql(query).fetchall() == [
        (trial_set, 150, int(frame.inserted[frame.trial_set == trial_set].sum())) for trial_set in ("hard", "usual")
    ]


@pytest.mark.parametrize(
    "names", [("01", "1", "1.0"), ("2026-01-31", "31"), ("true", "null", "nan"), ("a b/c=%20", "a")]
)
def test_names_of_policies_stay_texts(tmp_path, names):
    for k, name in enumerate(names):
        (block,) = blocks_of(tmp_path, f"{k:016}", [3], **{**NAMES, "policy": name})
        block.add(made_up_row(3))
        block.write()
    frame = pd.read_parquet(tmp_path / "trials", partitioning=PARTITIONING)
    assert sorted(frame["policy"]) == sorted(names)
    assert set(frame["engine"]) == {"drake"}
    assert sorted(read_trials(tmp_path).table["policy"].unique()) == sorted(names)


def test_a_block_goes_on_with_what_is_there(tmp_path):
    block = one_block(tmp_path, range(5))
    block.add(made_up_row(3))
    assert block.write() == 1
    block.add(made_up_row(2))
    assert block.write() == 1
    again = one_block(tmp_path, range(8))
    assert again.missing == {0, 1, 4, 5, 6, 7}
    again.add(made_up_row(0))
    assert again.write() == 1
    assert again.write() == 0
    table = pq.read_table(again.path, partitioning=None)
    assert table["trial"].to_pylist() == [0, 2, 3]
    assert table["key"].to_pylist() == [row_key("a" * 16, number) for number in (0, 2, 3)]


def test_a_write_that_fails_keeps_what_was_there_and_can_be_repeated(tmp_path, monkeypatch):
    block = one_block(tmp_path, range(3))
    block.add(made_up_row(0))
    block.write()

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        block.add(made_up_row(1))
        with pytest.raises(OSError, match="No space"):
            block.write()
    assert one_block(tmp_path, range(3)).missing == {1, 2}
    assert block.write() == 1
    assert one_block(tmp_path, range(3)).missing == {2}
    assert [path.name for path in block.path.parent.iterdir() if "tmp" in path.name] == []


def test_a_block_under_a_wrong_name_is_refused_and_its_columns_are_those_of_the_schema(tmp_path):
    block = one_block(tmp_path, [7])
    block.add({**made_up_row(7), "train_s": None, "demonstrations": None, "trusted": None})
    block.write()
    assert pq.read_schema(block.path).equals(SCHEMA)
    other = block.path.with_name("b" * 16 + "_0000000000.parquet")
    block.path.rename(other)
    with pytest.raises(ValueError, match="holds other trials than its name says"):
        Block(other, "b" * 16, (7,))
