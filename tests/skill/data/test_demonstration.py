import re

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from skill.data import tables
from skill.data.demonstration import (
    COLUMNS,
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


def test_a_folder_is_read_in_the_order_of_file_names(demonstration, tmp_path):
    for name, outcome in (("010", "third"), ("002", "second"), ("001", "first")):
        write_demonstration(
            Demonstration(demonstration.samples, good=True, outcome=outcome), tmp_path / f"{name}.parquet"
        )
    (tmp_path / "notes.txt").write_text("not a recording")
    assert [d.reason for d in read_demonstrations(tmp_path)] == ["first", "second", "third"]
    with pytest.raises(ValueError, match="nowhere: no demonstrations"):
        read_demonstrations(tmp_path / "nowhere")


# --------------------------------------------------------------- bad input


@pytest.mark.parametrize("kept", [0, 3, 4, 100, 0.5, 0.99])
def test_a_truncated_file_is_refused(path, kept):
    data = path.read_bytes()
    path.write_bytes(data[: kept if isinstance(kept, int) else int(kept * len(data))])
    assert "not a complete Parquet file" in error_message(path)


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
        ('{"format_version": 3}', "demonstration format version 3, expected 2"),
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


@pytest.mark.parametrize("good", ["false", 1, 0.0, None])
def test_a_verdict_that_is_neither_true_nor_false_is_refused(good):
    samples = make_demonstration().samples
    with pytest.raises(ValueError, match=rf"^demonstration: 'good' is {good!r}, expected true or false$"):
        Demonstration(samples, good, "inserted")


# ------------------------------------------------------------------ tables


TABLE = pd.DataFrame({"time": [0.0, 1.0], "a": [1.0, 2.0]})


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (TABLE.head(1), "found 1 samples, expected at least 2"),
        (TABLE.assign(time=0.0), "column 'time' does not increase after row 0"),
        (TABLE.rename(columns={"a": "b"}), "missing columns ['a'], unknown columns ['b']; expected exactly"),
        (pd.concat([TABLE, TABLE[["a"]]], axis=1), "columns ['a'] occur more than once"),
        (TABLE.assign(a=[1.0, -np.inf]), "column 'a' is not finite in row 1 (1 such rows)"),
        (TABLE.assign(a=[1.0, np.nan]), "column 'a' is not finite in row 1 (1 such rows)"),
        (TABLE.assign(a=True), "column 'a' has type bool, expected numbers"),
        (TABLE.assign(a=1j), "column 'a' has type complex128, expected numbers"),
        (TABLE.assign(a=[None, None]), "column 'a' has type object, expected numbers"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(table, message):
    with pytest.raises(ValueError, match="^here: " + re.escape(message)):
        tables.validate_table(table, ("time", "a"), "here")


def test_a_table_is_written_with_its_header(tmp_path):
    path = tmp_path / "new" / "folder" / "a.parquet"
    tables.write_table(TABLE, ("a", "time"), path, kind="thing", version=7, header={"x": 1})
    assert path.stat().st_mode & 0o777 == 0o644
    table, header = tables.read_table(path, kind="thing", version=7, entries={"x": int})
    assert list(table.columns) == ["a", "time"]
    assert header == {"x": 1}


def test_an_axis_may_be_rounded_and_a_duration_is_the_time_between_the_first_and_the_last_sample():
    samples = make_demonstration().samples
    samples[["ax", "ay", "az"]] *= 1.0 + 5e-7
    shifted = Demonstration(samples.assign(time=samples["time"] + 3.0), good=np.bool_(True), outcome="inserted")
    assert (shifted.duration, type(shifted.good)) == (pytest.approx(samples["time"].iloc[-1]), bool)
    samples[["ax", "ay", "az"]] *= 1.0 + 5e-6
    with pytest.raises(ValueError, match=r"length 1\.00001 in row 0, expected a unit axis"):
        Demonstration(samples, good=True, outcome="inserted")


def test_a_detail_is_kept_beside_an_outcome_and_replaced_by_that_of_a_text():
    samples = make_demonstration().samples
    assert Demonstration(samples, True, Outcome.JAMMED, detail="at 3 mm").reason == "jammed: at 3 mm"
    assert Demonstration(samples, True, "jammed: at 4 mm", detail="at 3 mm").reason == "jammed: at 4 mm"
    assert Demonstration(samples, True, "jammed", detail="at 3 mm").reason == "jammed: at 3 mm"


# ------------------------------------------------------------ damaged files


def test_a_recording_without_its_digest_is_refused(path):
    pq.read_table(path).to_pandas().to_parquet(path)
    assert "no SHA-256 digest of the content; expected a file of this program" in error_message(path)


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
