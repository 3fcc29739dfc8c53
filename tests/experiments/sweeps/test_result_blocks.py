"""Blocks of the data set: each row has one place, is written whole, and one process at a time holds it."""

import os
import subprocess
import sys
from pathlib import Path

import duckdb
import pandas as pd
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.scoreboard.result_store import read_trials
from experiments.sweeps.result_blocks import BLOCK, Block, blocks_of, hold, read_block
from experiments.sweeps.trial_files import PARTITIONING, SCHEMA
from experiments.sweeps.trial_rows import row_key
from tests.experiments.sweeps.made_up_rows import made_up_row

NAMES = {"policy": "CA states, contexts + LWR", "trial_set": "usual", "engine": "drake"}


def one_block(folder, numbers, source="a" * 16):
    (block,) = blocks_of(folder, source, numbers, **NAMES)
    return block


@given(st.sets(st.integers(0, 1000), min_size=1), st.sets(st.integers(0, 1000), min_size=1))
def test_a_trial_has_the_same_block_whatever_else_is_wanted(one, other):
    places = [
        {n: block.path for block in blocks_of(Path("results"), "s", numbers, **NAMES) for n in block.numbers}
        for numbers in (one, other)
    ]
    assert set(places[0]) == one
    assert all(places[0][n] == places[1][n] for n in one & other)
    assert all(n // BLOCK == m // BLOCK for n in one for m in one if places[0][n] == places[0][m])


def test_rows_are_written_and_read_by_pandas_and_duckdb_without_us(tmp_path):
    for trial_set in ("usual", "hard"):
        for block in blocks_of(tmp_path, f"{trial_set:a<16}", range(150), **{**NAMES, "trial_set": trial_set}):
            held = hold(block)
            for number in block.numbers:
                held.add(made_up_row(number))
            assert held.write() == len(block.numbers)
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
        held = hold(block)
        held.add(made_up_row(3))
        held.write()
    frame = pd.read_parquet(tmp_path / "trials", partitioning=PARTITIONING)
    assert sorted(frame["policy"]) == sorted(names)
    assert set(frame["engine"]) == {"drake"}
    assert sorted(read_trials(tmp_path).table["policy"].unique()) == sorted(names)


def test_a_block_goes_on_with_what_is_there(tmp_path):
    held = hold(one_block(tmp_path, range(5)))
    held.add(made_up_row(3))
    held.write()
    held.release()
    again = hold(one_block(tmp_path, range(8)))
    assert again.missing == {0, 1, 2, 4, 5, 6, 7}
    again.add(made_up_row(0))
    assert again.write() == 1
    table = read_block(again.block.path)
    assert table["trial"].to_pylist() == [0, 3]
    assert table["key"].to_pylist() == [row_key("a" * 16, 0), row_key("a" * 16, 3)]


def test_a_block_is_let_go_when_nothing_is_missing(tmp_path):
    block = one_block(tmp_path, [7])
    held = hold(block)
    held.add(made_up_row(7))
    assert in_another_process(block) == "busy"
    held.write()
    assert in_another_process(block) == "free"
    assert block.missing() == []


def test_a_write_that_fails_keeps_what_was_there_and_can_be_repeated(tmp_path, monkeypatch):
    held = hold(one_block(tmp_path, range(3)))
    held.add(made_up_row(0))
    held.write()

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        held.add(made_up_row(1))
        with pytest.raises(OSError, match="No space"):
            held.write()
    assert held.block.missing() == [1, 2]
    assert held.write() == 1
    assert held.block.missing() == [2]
    assert [path.name for path in held.block.path.parent.iterdir() if "tmp" in path.name] == []


def test_a_file_that_is_no_block_is_named(tmp_path):
    block = one_block(tmp_path, [7])
    block.path.parent.mkdir(parents=True)
    block.path.write_bytes(b"PAR1 but no Parquet")
    with pytest.raises(ValueError, match="not a complete Parquet file") as error:
        block.missing()
    assert str(block.path) in str(error.value)


def test_a_block_under_a_wrong_name_is_refused_and_its_columns_are_those_of_the_schema(tmp_path):
    held = hold(one_block(tmp_path, [7]))
    held.add({**made_up_row(7), "train_s": None, "demonstrations": None, "trusted": None})
    held.write()
    assert pq.read_schema(held.block.path).equals(SCHEMA)
    other = Block(held.block.path.with_name("b" * 16 + "_0000000000.parquet"), "b" * 16, (7,))
    held.block.path.rename(other.path)
    with pytest.raises(ValueError, match="holds other trials than its name says"):
        other.missing()


def environment():
    return {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])}


def in_another_process(block):
    code = f"""
from pathlib import Path
from experiments.sweeps.result_blocks import Block, hold
held = hold(Block(Path({str(block.path)!r}), {block.source!r}, {block.numbers!r}))
print("busy" if held is None else "free")
"""
    return subprocess.run(
        [sys.executable, "-c", code], check=True, env=environment(), capture_output=True, text=True
    ).stdout.strip()
