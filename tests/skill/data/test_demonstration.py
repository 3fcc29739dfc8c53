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


@pytest.fixture
def demonstration(demonstrations):
    return demonstrations[0]


@pytest.fixture
def path(demonstration, tmp_path):
    path = tmp_path / "shown.parquet"
    write_demonstration(demonstration, path)
    return path


def rewritten(path, change):
    """The file at ``path`` with its table changed and its metadata kept."""
    table = pq.read_table(path)
    frame = change(table.to_pandas())
    new = pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(table.schema.metadata)
    pq.write_table(new, path)
    return path


def with_header(path, **changes):
    table = pq.read_table(path)
    header = json.loads(table.schema.metadata[b"demonstration"])
    header.update(changes)
    pq.write_table(table.replace_schema_metadata({b"demonstration": json.dumps(header).encode()}), path)
    return path


def refusal(path):
    """The one message that reading ``path`` gives; it names the file."""
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_demonstration(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# -------------------------------------------------------------- round trip


def test_what_is_read_is_what_was_written_to_the_last_bit(demonstration, path):
    again = read_demonstration(path)
    pd.testing.assert_frame_equal(again.samples, demonstration.samples[list(COLUMNS)], check_exact=True)
    assert (again.good, again.outcome, again.metadata) == (
        demonstration.good,
        demonstration.outcome,
        demonstration.metadata,
    )
    assert again.duration == demonstration.duration


def test_the_order_of_the_columns_in_the_table_does_not_matter(demonstration, tmp_path):
    shuffled = Demonstration(demonstration.samples[list(COLUMNS)[::-1]], good=True, outcome="inserted")
    write_demonstration(shuffled, tmp_path / "a.parquet")
    assert tuple(read_demonstration(tmp_path / "a.parquet").samples.columns) == COLUMNS


def test_a_folder_is_read_in_the_order_of_names(demonstration, tmp_path):
    for name, outcome in (("010", "third"), ("002", "second"), ("001", "first")):
        write_demonstration(
            Demonstration(demonstration.samples, good=True, outcome=outcome), tmp_path / f"{name}.parquet"
        )
    (tmp_path / "notes.txt").write_text("not a recording")
    assert [d.reason for d in read_demonstrations(tmp_path)] == ["first", "second", "third"]


# --------------------------------------------------------------- bad input


@pytest.mark.parametrize("column", ["time", "fx", "angle", "dangle", "rz"])
def test_a_missing_column_is_named(path, column):
    said = refusal(rewritten(path, lambda frame: frame.drop(columns=column)))
    assert f"missing columns ['{column}']" in said


def test_a_renamed_column_is_named_both_ways(path):
    said = refusal(rewritten(path, lambda frame: frame.rename(columns={"fx": "force_x"})))
    assert "missing columns ['fx']" in said
    assert "unknown columns ['force_x']" in said


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["z", "my", "ux"])
def test_a_number_that_is_none_is_named_with_its_row(path, column, value):
    def spoil(frame):
        frame.loc[[7, 11], column] = value
        return frame

    said = refusal(rewritten(path, spoil))
    assert f"column '{column}' is not finite in row 7 (2 such rows)" in said


def test_words_are_no_numbers(path):
    said = refusal(rewritten(path, lambda frame: frame.assign(mz="much")))
    assert "column 'mz'" in said
    assert "expected numbers" in said


def test_time_runs_forward(path):
    def swap(frame):
        frame.loc[5, "time"] = frame.loc[4, "time"]
        return frame

    assert "column 'time' does not increase after row 4" in refusal(rewritten(path, swap))


def test_an_axis_has_length_one(path):
    def stretch(frame):
        frame.loc[3, ["ax", "ay", "az"]] = [0.0, 0.6, 0.9]
        return frame

    said = refusal(rewritten(path, stretch))
    assert "row 3" in said
    assert "unit axis" in said


def test_one_sample_is_no_demonstration(path):
    assert "found 1 samples" in refusal(rewritten(path, lambda frame: frame.head(1)))


@pytest.mark.parametrize("kept", [0, 3, 4, 100, 0.5, 0.99])
def test_a_truncated_file_is_refused(path, kept):
    data = path.read_bytes()
    path.write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    assert "not a complete Parquet file" in refusal(path)


def test_a_file_of_another_version_is_refused(path):
    said = refusal(with_header(path, format_version=FORMAT_VERSION + 1))
    assert f"version {FORMAT_VERSION + 1}, expected {FORMAT_VERSION}" in said


def test_a_foreign_parquet_file_is_refused(tmp_path):
    path = tmp_path / "foreign.parquet"
    pd.DataFrame({"a": [1.0, 2.0]}).to_parquet(path)
    assert "expected a demonstration file" in refusal(path)


def test_damaged_metadata_are_refused(path):
    table = pq.read_table(path)
    pq.write_table(table.replace_schema_metadata({b"demonstration": b"{not json"}), path)
    assert "demonstration" in refusal(path)


def test_metadata_without_an_outcome_are_refused(path):
    table = pq.read_table(path)
    header = json.dumps({"format_version": FORMAT_VERSION}).encode()
    pq.write_table(table.replace_schema_metadata({b"demonstration": header}), path)
    assert "good" in refusal(path)


def test_a_file_that_is_not_there_is_named(tmp_path):
    assert "no such demonstration file" in refusal(tmp_path / "nowhere.parquet")


def test_a_folder_without_recordings_says_so(tmp_path):
    with pytest.raises(ValueError, match="no demonstrations"):
        read_demonstrations(tmp_path)
    with pytest.raises(ValueError, match="no demonstrations"):
        read_demonstrations(tmp_path / "nowhere")


def test_a_demonstration_cannot_be_made_of_bad_samples(demonstration):
    samples = demonstration.samples.copy()
    samples.loc[2, "fx"] = np.nan
    with pytest.raises(ValueError, match="'fx' is not finite in row 2"):
        Demonstration(samples, good=True, outcome="inserted")


# ----------------------------------------------------- whole or not at all


def test_a_write_that_fails_half_way_leaves_nothing(demonstration, tmp_path, monkeypatch):
    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tables.os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_demonstration(demonstration, tmp_path / "shown.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_write_that_fails_leaves_the_old_file_as_it_was(demonstration, path, monkeypatch):
    before = path.read_bytes()

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tables.os, "fsync", full)
    other = Demonstration(demonstration.samples.head(5), good=False, outcome="jammed")
    with pytest.raises(OSError, match="No space"):
        write_demonstration(other, path)
    assert path.read_bytes() == before
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_metadata_that_cannot_be_written_leave_nothing(demonstration, tmp_path):
    strange = Demonstration(demonstration.samples, good=True, outcome="inserted", metadata={"habit": object()})
    with pytest.raises(TypeError):
        write_demonstration(strange, tmp_path / "shown.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_a_file_is_an_error_and_stays_a_file(demonstration, tmp_path):
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(OSError, match="taken"):
        write_demonstration(demonstration, tmp_path / "taken" / "shown.parquet")
    assert (tmp_path / "taken").read_text() == "mine"
