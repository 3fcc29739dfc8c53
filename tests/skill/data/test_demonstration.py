import json
import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.data import tables
from skill.data.demonstration import (
    COLUMNS,
    FORMAT_VERSION,
    Demonstration,
    read_demonstration,
    read_demonstrations,
    write_demonstration,
)
from skill.data.outcome import Outcome
from tests.crafted_files import rewrite, sealed_parquet
from tests.trajectories import make_demonstration


@pytest.fixture
def demonstration(demonstrations):
    return demonstrations[0]


@pytest.fixture
def path(demonstration, tmp_path):
    path = tmp_path / "demonstration.parquet"
    write_demonstration(demonstration, path)
    return path


def rewritten(path, change):
    return rewrite(path, "demonstration", change)


def with_header(path, **changes):
    return rewrite(path, "demonstration", **changes)


def error_message(path):
    """The message with which a file is refused; one line that names the file."""
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_demonstration(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# -------------------------------------------------------------- round trip


def test_a_demonstration_is_read_back_bit_identically(demonstration, path):
    again = read_demonstration(path)
    pd.testing.assert_frame_equal(again.samples, demonstration.samples[list(COLUMNS)], check_exact=True)
    assert (again.good, again.outcome, again.metadata) == (
        demonstration.good,
        demonstration.outcome,
        demonstration.metadata,
    )
    assert again.duration == demonstration.duration


def test_the_order_of_the_columns_does_not_matter(demonstration, tmp_path):
    shuffled = Demonstration(demonstration.samples[list(COLUMNS)[::-1]], good=True, outcome="inserted")
    write_demonstration(shuffled, tmp_path / "a.parquet")
    assert tuple(read_demonstration(tmp_path / "a.parquet").samples.columns) == COLUMNS


def test_a_folder_is_read_in_the_order_of_file_names(demonstration, tmp_path):
    for name, outcome in (("010", "third"), ("002", "second"), ("001", "first")):
        write_demonstration(
            Demonstration(demonstration.samples, good=True, outcome=outcome), tmp_path / f"{name}.parquet"
        )
    (tmp_path / "notes.txt").write_text("not a recording")
    assert [d.reason for d in read_demonstrations(tmp_path)] == ["first", "second", "third"]


# --------------------------------------------------------------- bad input


def test_a_renamed_column_is_named_both_ways(path):
    message = error_message(rewritten(path, lambda frame: frame.rename(columns={"fx": "force_x"})))
    assert "missing columns ['fx']" in message
    assert "unknown columns ['force_x']" in message


@pytest.mark.parametrize("value", [np.nan, -np.inf])
def test_a_value_that_is_not_finite_is_named_with_its_row(path, value):
    def spoil(frame):
        frame.loc[[7, 11], "my"] = value
        return frame

    message = error_message(rewritten(path, spoil))
    assert "column 'my' is not finite in row 7 (2 such rows)" in message


@pytest.mark.parametrize("kept", [0, 3, 4, 100, 0.5, 0.99])
def test_a_truncated_file_is_refused(path, kept):
    data = path.read_bytes()
    path.write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    assert "not a complete Parquet file" in error_message(path)


def test_a_file_of_another_version_is_refused(path):
    message = error_message(with_header(path, format_version=FORMAT_VERSION + 1))
    assert f"version {FORMAT_VERSION + 1}, expected {FORMAT_VERSION}" in message


def test_a_foreign_parquet_file_is_refused(tmp_path):
    path = tmp_path / "foreign.parquet"
    pd.DataFrame({"a": [1.0, 2.0]}).to_parquet(path)
    assert "expected a file of this program" in error_message(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{not json", "damaged 'demonstration' metadata"),
        ("[]", "expected an object"),
        ("null", "found null, expected an object"),
        ("3", "expected an object"),
        ("[" * 100_000, "nested too deeply"),
        ("\udcff", "damaged 'demonstration' metadata"),
        ('{"format_version": 2}', "'good' in the metadata is None, expected true or false"),
        ('{"format_version": true, "good": true, "outcome": "inserted"}', "format version True"),
        ('{"format_version": [2], "good": true, "outcome": "inserted"}', "format version [2]"),
    ],
)
def test_damaged_metadata_is_refused(path, text, message):
    table = pq.read_table(path)
    path.write_bytes(sealed_parquet(table, {"demonstration": text.encode(errors="surrogateescape")}))
    assert message in error_message(path)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"good": "false"}, "'good' in the metadata is 'false', expected true or false"),
        ({"good": 1}, "'good' in the metadata is 1, expected true or false"),
        ({"outcome": 3}, "'outcome' in the metadata is 3, expected a text"),
        ({"outcome": None}, "'outcome' in the metadata is None, expected a text"),
        ({"geometry": [1]}, "geometry is [1]"),
    ],
)
def test_an_entry_of_the_wrong_type_is_refused(path, entry, message):
    assert message in error_message(with_header(path, **entry))


@pytest.mark.parametrize("name", ["good", "outcome", "format_version"])
def test_metadata_cannot_replace_what_the_file_says_itself(demonstration, tmp_path, name):
    strange = Demonstration(demonstration.samples, good=True, outcome="inserted", metadata={name: 1})
    with pytest.raises(ValueError, match=f"metadata named .'{name}'. cannot be stored"):
        write_demonstration(strange, tmp_path / "demonstration.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_file_is_named(tmp_path):
    assert "no such demonstration file" in error_message(tmp_path / "nowhere.parquet")


def test_a_folder_without_recordings_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no demonstrations"):
        read_demonstrations(tmp_path)
    with pytest.raises(ValueError, match="no demonstrations"):
        read_demonstrations(tmp_path / "nowhere")


@pytest.mark.parametrize("good", ["false", 1, 0.0, None])
def test_a_verdict_that_is_neither_true_nor_false_is_refused(good):
    samples = make_demonstration().samples
    with pytest.raises(ValueError, match=rf"^demonstration: 'good' is {good!r}, expected true or false$"):
        Demonstration(samples, good, "inserted")


def test_a_verdict_of_numpy_becomes_a_bool_and_is_read_back(tmp_path):
    made = Demonstration(make_demonstration().samples, np.bool_(True), "inserted")
    write_demonstration(made, tmp_path / "demonstration.parquet")
    assert (made.good, read_demonstration(tmp_path / "demonstration.parquet").good) == (True, True)
    assert type(made.good) is bool


# ------------------------------------------------------------------ tables


TABLE = pd.DataFrame({"time": [0.0, 1.0], "a": [1.0, 2.0]})


def test_a_table_needs_a_minimum_of_rows():
    tables.validate_table(TABLE, ("time", "a"), "here")
    tables.validate_table(TABLE.head(1), ("time", "a"), "here", min_rows=1)
    with pytest.raises(ValueError, match="here: found 1 samples, expected at least 2"):
        tables.validate_table(TABLE.head(1), ("time", "a"), "here")


def test_equal_times_are_refused_in_the_first_row_too():
    with pytest.raises(ValueError, match="here: column 'time' does not increase after row 0"):
        tables.validate_table(TABLE.assign(time=0.0), ("time", "a"), "here")


def test_a_table_is_written_with_its_header(tmp_path):
    path = tmp_path / "new" / "folder" / "a.parquet"
    tables.write_table(TABLE, ("a", "time"), path, kind="thing", version=7, header={"x": 1})
    assert path.stat().st_mode & 0o777 == 0o644
    table, header = tables.read_table(path, ("a", "time"), kind="thing", version=7, entries={"x": int})
    assert list(table.columns) == ["a", "time"]
    assert header == {"x": 1}
    with pytest.raises(ValueError, match="'y' in the metadata is None, expected a text"):
        tables.read_table(path, ("a", "time"), kind="thing", version=7, entries={"y": str})


def test_an_axis_may_be_rounded_and_a_duration_is_the_time_between_the_first_and_the_last_sample():
    made = make_demonstration()
    samples = made.samples.copy()
    samples[["ax", "ay", "az"]] *= 1.0 + 5e-7
    shifted = Demonstration(samples.assign(time=samples["time"] + 3.0), good=True, outcome="inserted")
    assert shifted.duration == pytest.approx(made.samples["time"].iloc[-1])
    samples[["ax", "ay", "az"]] *= 1.0 + 5e-6
    with pytest.raises(ValueError, match=r"length 1\.00001 in row 0, expected a unit axis"):
        Demonstration(samples, good=True, outcome="inserted")


def test_a_detail_is_kept_beside_an_outcome_and_replaced_by_that_of_a_text():
    samples = make_demonstration().samples
    assert Demonstration(samples, True, Outcome.JAMMED, detail="at 3 mm").reason == "jammed: at 3 mm"
    assert Demonstration(samples, True, "jammed: at 4 mm", detail="at 3 mm").reason == "jammed: at 4 mm"
    assert Demonstration(samples, True, "jammed", detail="at 3 mm").reason == "jammed: at 3 mm"


# ------------------------------------------------------------ damaged files


@pytest.mark.parametrize(
    ("column", "message"),
    [
        (pa.array([[1.0]] * 400), "column 'fx' has type list"),
        (pa.array([{"a": 1.0}] * 400), "column 'fx' has type struct"),
        (pa.array([True] * 400), "column 'fx' has type bool"),
        (pa.array(["much"] * 400), "column 'fx' has type string"),
        (pa.array(range(400), pa.timestamp("ns")), "column 'fx' has type timestamp"),
        (pa.nulls(400, pa.float64()), "column 'fx' is not finite"),
    ],
)
def test_a_column_that_holds_no_plain_numbers_is_refused(path, column, message):
    table = pq.read_table(path)
    k = table.column_names.index("fx")
    changed = table.set_column(k, "fx", column.slice(0, table.num_rows))
    path.write_bytes(sealed_parquet(changed, {"demonstration": table.schema.metadata[b"demonstration"]}))
    assert message in error_message(path)


def test_a_column_that_is_there_twice_is_refused(path):
    table = pq.read_table(path)
    changed = table.append_column("fx", table.column("fy"))
    path.write_bytes(sealed_parquet(changed, {"demonstration": table.schema.metadata[b"demonstration"]}))
    assert "columns ['fx'] occur more than once" in error_message(path)
    with pytest.raises(ValueError, match=r"here: columns \['a'\] occur more than once"):
        tables.validate_table(pd.concat([TABLE, TABLE[["a"]]], axis=1), ("time", "a"), "here")


def test_the_columns_that_pandas_would_take_for_an_index_are_unknown(path):
    table = pq.read_table(path)
    frame = table.to_pandas().set_index("fx")
    indexed = pa.Table.from_pandas(frame, preserve_index=True)
    header = json.loads(table.schema.metadata[b"demonstration"])
    path.write_bytes(sealed_parquet(indexed, {**indexed.schema.metadata, "demonstration": json.dumps(header)}))
    assert tuple(sorted(read_demonstration(path).samples.columns)) == tuple(sorted(COLUMNS))


def test_a_page_carries_a_checksum_of_its_own(path, monkeypatch):
    monkeypatch.setattr(tables, "check_seal", lambda data, required: None)
    data = path.read_bytes()
    start = pq.ParquetFile(path).metadata.row_group(0).column(5).data_page_offset
    place = start + 200
    path.write_bytes(data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :])
    assert "crc" in error_message(path).lower()


def test_a_recording_without_its_digest_is_refused(path):
    table = pq.read_table(path)
    header = {b"demonstration": table.schema.metadata[b"demonstration"]}
    pq.write_table(table.replace_schema_metadata(header), path)
    assert "no SHA-256 digest of the content" in error_message(path)


def test_the_number_of_samples_is_limited(demonstration, path, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "MAX_ROWS", len(demonstration.samples) - 1)
    assert f"found {len(demonstration.samples)} samples, expected at most" in error_message(path)
    with pytest.raises(ValueError, match=r"new\.parquet: found .* samples, expected at most"):
        write_demonstration(demonstration, tmp_path / "new.parquet")


def test_the_length_of_metadata_is_limited(demonstration, path, tmp_path):
    table = pq.read_table(path)
    path.write_bytes(sealed_parquet(table, {"demonstration": '{"a": [' + "[]," * 4_000_000 + "1]}"}))
    assert "12000010 characters, expected at most 10000000" in error_message(path)
    long = Demonstration(demonstration.samples, good=True, outcome="inserted", metadata={"notes": "x" * 10_000_000})
    with pytest.raises(ValueError, match=r"long\.parquet: metadata of"):
        write_demonstration(long, tmp_path / "long.parquet")
