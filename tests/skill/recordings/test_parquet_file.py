"""Parquet files of other programs, with any compression, within limits of what they unpack to."""

import re
from decimal import Decimal

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.recordings import column_table, parquet_file
from skill.recordings.column_table import ColumnChoice
from skill.recordings.parquet_file import open_parquet, read_columns, read_parquet_file


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


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_times_have_their_own_unit(tmp_path, unit):
    ticks = np.arange(7, 10) * {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    time_of_day = pa.time32(unit) if unit in ("s", "ms") else pa.time64(unit)
    for kind in (time_of_day, pa.timestamp(unit), pa.timestamp(unit, tz="UTC"), pa.duration(unit)):
        stamps = pa.array(ticks, pa.int32() if pa.types.is_time32(kind) else pa.int64()).cast(kind)
        pq.write_table(pa.Table.from_pandas(wrench(3)).set_column(0, "time", stamps), tmp_path / "a.parquet")
        np.testing.assert_allclose(read_parquet_file(tmp_path / "a.parquet")[0].time, [7, 8, 9])


NUMBERS = {
    "decimals": pa.array([Decimal(k).scaleb(-2) for k in range(50)], pa.decimal128(9, 2)),
    "long decimals": pa.array([Decimal(k).scaleb(-2) for k in range(50)], pa.decimal256(60, 2)),
    "a dictionary": pa.array(np.arange(50) / 100).dictionary_encode(),
    "floats": pa.array((np.arange(50) / 100).astype("f4")),
    "half floats": pa.array((np.arange(50) / 128).astype("f2")),
    "bytes": pa.array(np.arange(50), pa.uint8()),
}


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("with_schema", [True, False])
def test_numbers_of_other_types_are_read(tmp_path, name, with_schema):
    rows = pa.Table.from_pandas(wrench(50), preserve_index=False)
    for column in ("time", "fy"):
        rows = rows.set_column(rows.schema.get_field_index(column), column, NUMBERS[name])
    pq.write_table(rows, tmp_path / "a.parquet", store_schema=with_schema)
    [found] = read_parquet_file(tmp_path / "a.parquet", ColumnChoice(["time=time:ms"]))
    expected = np.array([float(value) for value in NUMBERS[name].to_pylist()])
    np.testing.assert_allclose(found.values[:, 1], expected, rtol=1e-15)
    np.testing.assert_allclose(found.time, expected * 1e-3, rtol=1e-15)


TEXTS = {
    "texts": pa.array(["a"] * 20 + ["b"] * 30),
    "long texts": pa.array(["a"] * 20 + ["b"] * 30, pa.large_string()),
    "views": pa.array(["a"] * 20 + ["b"] * 30, pa.string_view()),
    "bytes": pa.array([b"a"] * 20 + [b"b"] * 30),
    "a dictionary": pa.array(["a"] * 20 + ["b"] * 30).dictionary_encode(),
    "a dictionary of bytes": pa.array([b"a"] * 20 + [b"b"] * 30).dictionary_encode(),
}


@pytest.mark.parametrize("name", TEXTS)
def test_labels_are_texts_however_they_are_stored(tmp_path, name):
    rows = pa.Table.from_pandas(wrench(50), preserve_index=False)
    rows = rows.append_column("trial", TEXTS[name]).append_column("label", TEXTS[name])
    pq.write_table(rows, tmp_path / "a.parquet")
    found = read_parquet_file(tmp_path / "a.parquet")
    assert [(r.trial, len(r.time), set(r.phases)) for r in found] == [("a", 20, {"a"}), ("b", 30, {"b"})]


NESTED = {
    "struct<id: int64>": pa.array([{"id": 1}] * 50),
    "list<element: int64>": pa.array([[1]] * 50),
    "list<element: list<element: double>>": pa.array([[[1.0]]] * 50),
    "fixed_size_list<element: float>[3]": pa.array([[1.0, 2.0, 3.0]] * 50, pa.list_(pa.float32(), 3)),
    "map<string, int64": pa.array([[("a", 1)]] * 50, pa.map_(pa.string(), pa.int64())),
}
NO_NUMBERS = NESTED | {
    "bool": pa.array([True, False] * 25),
    "string": pa.array(["1.5"] * 50),
    "binary": pa.array([b"1"] * 50),
    "date32[day]": pa.array(range(50), pa.date32()),
    "timestamp[us, tz=UTC]": pa.array(range(50), pa.timestamp("us", "UTC")),
    "duration[ms]": pa.array(range(50), pa.duration("ms")),
}


REFUSED_TYPES = [
    *((column, kind) for column in ("trial", "run", "phase", "fx", "time") for kind in NESTED),
    *((column, kind) for column in ("fx", "time") for kind in ("bool", "string", "binary", "date32[day]")),
    *(("fx", kind) for kind in ("timestamp[us, tz=UTC]", "duration[ms]")),
]


@pytest.mark.parametrize(("column", "kind"), REFUSED_TYPES)
def test_columns_of_other_types_are_refused(tmp_path, column, kind):
    rows = pa.Table.from_pandas(wrench(50), preserve_index=False)
    if column in rows.column_names:
        rows = rows.drop_columns(column)
    pq.write_table(rows.append_column(column, NO_NUMBERS[kind]), tmp_path / "a.parquet")
    refused(tmp_path / "a.parquet", f"column '{column}' has type {kind}")
    if column not in ("fx", "time"):  # labels can be left out
        refused(tmp_path / "a.parquet", "expected single values; an empty name leaves it out")
        option = "phase_column" if column == "phase" else "trial_column"
        assert len(read_parquet_file(tmp_path / "a.parquet", ColumnChoice(**{option: ""}))) == 1


def test_bytes_that_are_no_text_are_refused(tmp_path):
    rows = pa.Table.from_pandas(wrench(50), preserve_index=False).append_column("phase", pa.array([b"\xff"] * 50))
    pq.write_table(rows, tmp_path / "a.parquet")
    refused(tmp_path / "a.parquet", "column 'phase' has bytes that are no text in UTF-8")


@pytest.mark.parametrize("change", [{}, {"phase": "a"}, {"trial": 1}, {"trial": True, "phase": b"a"}])
def test_a_table_without_rows_is_refused(tmp_path, change):
    table = wrench(4).assign(**change).iloc[:0]
    for empty in (table, pd.DataFrame(columns=list(table), dtype=object)):  # with and without types
        empty.to_parquet(tmp_path / "a.parquet")
        refused(tmp_path / "a.parquet", "no samples; expected at least 2 rows with values")


def test_a_column_without_any_value_is_refused(tmp_path):
    path = tmp_path / "a.parquet"
    wrench(4).assign(mz=None).to_parquet(path)
    refused(path, "column 'mz' has no value in row 0 (4 such rows)")


def test_a_file_that_may_not_be_read_is_refused(tmp_path, monkeypatch):
    """Root may read everything, so that opening is what fails."""
    path = tmp_path / "a.parquet"
    wrench().to_parquet(path)

    def forbidden(*_):
        raise PermissionError

    monkeypatch.setattr("pathlib.Path.open", forbidden)
    refused(path, "no permission to read this file")


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


def test_a_damaged_file_is_refused(tmp_path):
    path = tmp_path / "a.parquet"
    wrench().to_parquet(path)
    data = path.read_bytes()
    for part in (b"", data[:-1], data[: len(data) // 2] + data[-2000:]):
        path.write_bytes(part)
        refused(path, "not a complete Parquet file")
    refused(tmp_path, "not a complete Parquet file (a folder, expected a file)")


def test_what_unpacks_to_too_much_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.parquet"
    wrench(5000).assign(time=np.arange(5000), note="x" * 9999).to_parquet(path, compression="zstd")
    monkeypatch.setattr(parquet_file, "MAX_UNPACKED", 400_000)
    read_parquet_file(path, ColumnChoice(["time=time:ms"]))  # the note is not unpacked
    monkeypatch.setattr(parquet_file, "MAX_UNPACKED", 240_000)
    refused(path, "unpack to 0 MB, expected at most 0 MB", columns=["time=time:ms"])
    monkeypatch.setattr(column_table, "MAX_SAMPLES", 4999)
    refused(path, "5000 samples, expected at most 4999")
    monkeypatch.setattr(parquet_file, "MAX_BYTES", 1000)
    refused(path, "MB, expected at most 0 MB")


def test_a_column_within_another_name_is_not_mixed_up(tmp_path):
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"a": [1.0, 2.0], "a.b": [3.0, 4.0]}), path)
    assert read_columns(open_parquet(path), ["a"], path).to_pydict() == {"a": [1.0, 2.0]}
    with pytest.raises(ValueError, match=r"no column \['c'\]; columns are \['a', 'a\.b'\]"):
        read_columns(open_parquet(path), ["c"], path)
