"""Parquet files of other programs, with any compression, within limits of what they unpack to."""

import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.recordings import column_table, parquet_file
from skill.recordings.column_table import ColumnChoice
from skill.recordings.parquet_file import read_columns, read_parquet_file


def wrench(rows=300):
    rng = np.random.default_rng(0)
    table = pd.DataFrame(rng.normal(size=(rows, 6)), columns=["fx", "fy", "fz", "mx", "my", "mz"])
    table.insert(0, "time", np.arange(rows) / 1000)
    return table


@pytest.mark.parametrize("compression", ["snappy", "gzip", "zstd", "brotli", "lz4", None])
@pytest.mark.parametrize("version", ["1.0", "2.0"])
def test_a_file_of_pandas_is_read(tmp_path, compression, version):
    table = wrench()
    table["phase"] = np.repeat(["approach", "insertion", "insertion"], 100)
    table["trial"] = np.repeat([5, 2, 5], 100)
    table["note"] = [f"{k}" * 50 for k in range(300)]
    table.to_parquet(tmp_path / "a.parquet", compression=compression, data_page_version=version, row_group_size=70)
    first, second = read_parquet_file(tmp_path / "a.parquet", ColumnChoice(trial_column="trial"))
    assert [first.name, second.name] == ["a.parquet, trial 5", "a.parquet, trial 2"]
    np.testing.assert_array_equal(second.values, table.iloc[100:200, 1:7])
    np.testing.assert_array_equal(first.time, table["time"][table["trial"] == 5])
    assert first.phases.tolist() == ["approach"] * 100 + ["insertion"] * 100


def test_types_of_numbers(tmp_path):
    table = wrench(50).astype({"fx": "float32", "fz": "int64"}).assign(fy=pd.array([7] * 50, "Int16"))
    table["phase"] = pd.Categorical(["a"] * 20 + ["b"] * 30)
    table.to_parquet(tmp_path / "a.parquet")
    [found] = read_parquet_file(tmp_path / "a.parquet")
    np.testing.assert_array_equal(found.values, table.iloc[:, 1:7].to_numpy(dtype=float))
    assert found.phases.tolist() == table["phase"].tolist()


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_time_stamps_and_durations_have_their_own_unit(tmp_path, unit):
    table = wrench(3)
    ticks = np.array([0, 1, 2]) * {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit] + 7
    for kind in (pa.timestamp(unit), pa.timestamp(unit, tz="UTC"), pa.duration(unit)):
        rows = pa.Table.from_pandas(table.drop(columns="time")).append_column(
            "stamp", pa.array(ticks, pa.int64()).cast(kind)
        )
        pq.write_table(rows, tmp_path / "a.parquet")
        [found] = read_parquet_file(tmp_path / "a.parquet")
        np.testing.assert_allclose(found.time - found.time[0], [0, 1, 2], rtol=1e-12)


def test_an_index_of_pandas_is_a_column(tmp_path):
    wrench().set_index("time").to_parquet(tmp_path / "a.parquet")
    assert read_parquet_file(tmp_path / "a.parquet")[0].rate == pytest.approx(1000)


def test_the_action_of_a_demonstration_is_no_orientation(tmp_path):
    table = wrench()
    table[["rx", "ry", "rz"]] = 0.0
    rows = pa.Table.from_pandas(table, preserve_index=False)
    pq.write_table(rows, tmp_path / "a.parquet")
    assert read_parquet_file(tmp_path / "a.parquet")[0].channels[-3:] == ("rx", "ry", "rz")
    pq.write_table(rows.replace_schema_metadata({"demonstration": "{}"}), tmp_path / "a.parquet")
    assert read_parquet_file(tmp_path / "a.parquet")[0].channels == ("fx", "fy", "fz", "mx", "my", "mz")
    assert read_parquet_file(tmp_path / "a.parquet", ColumnChoice(["rx=rx:deg"]))[0].channels[-1] == "rx"


def refused(path, message, **options):
    with pytest.raises(ValueError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)):
        read_parquet_file(path, ColumnChoice(**options))


def test_wrong_columns_are_refused(tmp_path):
    path = tmp_path / "a.parquet"
    wrench().assign(fx="1.0").to_parquet(path)
    refused(path, "column 'fx' has type")
    wrench().assign(fx=True).to_parquet(path)
    refused(path, "column 'fx' has type bool, expected numbers")
    table = wrench()
    table.loc[7:9, "fx"] = np.nan
    table.to_parquet(path)
    refused(path, "column 'fx' has no value in row 7 (3 such rows)")
    table.loc[7:9, "fy":"mz"] = np.nan
    table.to_parquet(path)
    assert len(read_parquet_file(path)[0].time) == 297


def test_a_damaged_file_is_refused(tmp_path):
    path = tmp_path / "a.parquet"
    wrench().to_parquet(path)
    data = path.read_bytes()
    for part in (b"", data[:-1], data[: len(data) // 2], data[: len(data) // 2] + data[-2000:], b"time,fx\n"):
        path.write_bytes(part)
        refused(path, "not a complete Parquet file")
    refused(tmp_path / "b.parquet", "no such file")
    refused(tmp_path, "not a complete Parquet file (a folder, expected a file)")


@pytest.mark.slow
def test_changed_bytes_raise_nothing_but_value_errors(tmp_path):
    path = tmp_path / "a.parquet"
    wrench(40).to_parquet(path)
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    refusals = []
    for place in rng.integers(0, len(data), 300):
        path.write_bytes(data[:place] + bytes([int(rng.integers(256))]) + data[place + 1 :])
        try:
            read_parquet_file(path)
        except ValueError as error:
            refusals.append(str(error))
    assert len(refusals) > 30
    assert all("a.parquet" in text for text in refusals)


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    wrench(5000).assign(time=np.arange(5000), note="x" * 9999).to_parquet(path, compression="zstd")
    monkeypatch.setattr(parquet_file, "MAX_UNPACKED", 400_000)
    read_parquet_file(path, ColumnChoice(["time=time:ms"]))  # the note is not unpacked
    monkeypatch.setattr(parquet_file, "MAX_UNPACKED", 240_000)
    refused(path, "expected at most 0 MB and 1 values in a row", columns=["time=time:ms"])
    monkeypatch.setattr(parquet_file, "MAX_UNPACKED", 400_000)
    monkeypatch.setattr(column_table, "MAX_SAMPLES", 4999)
    refused(path, "5000 samples, expected at most 4999")
    monkeypatch.setattr(parquet_file, "MAX_BYTES", 1000)
    refused(path, "MB, expected at most 0 MB")


def test_lists_longer_than_their_width_are_refused_before_they_are_unpacked(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": [[0.0] * 7] * 10}), path)
    assert read_columns(path, lambda _: ["a"], width=7).num_rows == 10
    with pytest.raises(ValueError, match=r"unpack to 0 MB and 70 values in 10 rows, expected .* 6 values in a row"):
        read_columns(path, lambda _: ["a"], width=6)


def test_a_column_within_another_name_is_not_mixed_up(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": [1.0, 2.0], "a.b": [3.0, 4.0]}), path)
    assert read_columns(path, lambda _: ["a"]).to_pydict() == {"a": [1.0, 2.0]}
    with pytest.raises(ValueError, match=r"no column \['c'\]; columns are \['a', 'a\.b'\]"):
        read_columns(path, lambda _: ["c"])
