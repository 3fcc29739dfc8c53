"""Texts of other programs: separators, decimal signs, comments, missing values; each refusal names the line."""

import re

import numpy as np
import pandas as pd
import pytest

from skill.recordings import column_table, csv_file
from skill.recordings.column_table import ColumnChoice
from skill.recordings.csv_file import read_csv_file

HEADER = "time,fx,fy,fz\n"


@pytest.fixture
def read(tmp_path):
    def read_text(text, **options):
        path = tmp_path / "snap.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_csv_file(path, ColumnChoice(**options))

    return read_text


def test_a_file_of_pandas_is_read(tmp_path):
    rng = np.random.default_rng(0)
    table = pd.DataFrame(rng.normal(size=(500, 7)), columns=["Fz [N]", "Fx [mN]", "Fy [N]", "note", "mx", "my", "mz"])
    table = table.assign(timestamp_ms=np.arange(500.0) * 2, note="some, text", phase=np.repeat(["a", "b"], 250))
    table.to_csv(tmp_path / "snap.csv")
    [found] = read_csv_file(tmp_path / "snap.csv")
    assert found.name == "snap.csv"
    assert found.channels == ("fx", "fy", "fz", "mx", "my", "mz")
    np.testing.assert_array_equal(found.time, np.arange(500.0) * 2 * 1e-3)
    np.testing.assert_allclose(found.values[:, 0], table["Fx [mN]"] * 1e-3, rtol=1e-12)
    np.testing.assert_allclose(found.values[:, 1:], table[["Fy [N]", "Fz [N]", "mx", "my", "mz"]], rtol=1e-12)
    assert found.phases.tolist() == table["phase"].tolist()


@pytest.mark.parametrize("column", ["trial", "Episode", "episode_index", "run"])
def test_a_column_of_trials_splits_the_table(read, column):
    text = f"t,fx,fy,fz,{column}\n0,1,2,3,7\n0.01,1,2,3,7\n5,4,5,6,3\n5.01,4,5,6,3\n0.02,7,8,9,7\n"
    with pytest.raises(ValueError, match=f"column '{column}' changes 2 times between 2 values"):
        read(text)
    first, second = read(text, trial_column=column)
    word = column.lower().removesuffix("_index")
    assert [first.name, second.name] == [f"snap.csv, {word} 7", f"snap.csv, {word} 3"]
    assert [first.trial, second.trial] == ["7", "3"]
    np.testing.assert_array_equal(first.values, [[1, 2, 3], [1, 2, 3], [7, 8, 9]])  # rows of a trial may stand apart
    np.testing.assert_array_equal(second.time, [5, 5.01])


def test_trials_are_named_as_in_the_file(read):
    found = read(f"{HEADER[:-1]},trial\n" + "".join(f"0.0{k},1,2,3,{trial}\n" for trial in ("1", "01") for k in (1, 2)))
    assert [recording.trial for recording in found] == ["1", "01"]


@pytest.mark.parametrize("note", ["23.11.2026", "ok.", "1.5"])
def test_other_columns_do_not_decide_the_decimal_sign(read, note):
    [found] = read(f"time;fx;fy;fz;note\n0,01;1,5;2;3;{note}\n0,02;1;2;3;{note}\n")
    np.testing.assert_allclose(found.values[:, 0], [1.5, 1.0])


def test_a_column_that_holds_no_phases_can_be_left_out(read):
    table = f"{HEADER[:-1]},label\n0.01,1,2,3,good\n0.02,1,2,3,\n"
    remedy = "; to leave the phases out, give an empty name for their column"
    with pytest.raises(ValueError, match=rf"column 'label' has no value in line 3 \(1 such rows\){remedy}$"):
        read(table)
    [found] = read(table, phase_column="")
    assert found.phases is None
    table = f"{HEADER[:-1]},phase\n" + "".join(f"{0.01 * k},1,2,3,{0.5 * k}\n" for k in range(300))
    with pytest.raises(ValueError, match=f"'phase' has 300 different values, expected at most 200 phases{remedy}$"):
        read(table)


ACCEPTED = {  # texts of the same two samples
    "plain": HEADER + "0,1,2,3\n0.01,4,5,6\n",
    "comments": "# made by x, y\n\n" + HEADER + "#0,1,2,3\n0,1,2,3\n\n  \n # more\n0.01,4,5,6\n# end\n",
    "quotes": '"time","fx","fy","fz"\n"0","1","2","3"\n"0.01",4,5,6\n',
    "spaces": "time, fx, fy, fz\n0, 1, 2, 3\n 0.01, 4, 5, 6\n",
    "spaces alone": "time  fx fy  fz\n 0 1   2 3\n0.01\t4 5 6  \n",
    "header in a comment": "# a\n# time,fx,fy,fz\n0,1,2,3\n0.01,4,5,6\n",
    "decimal comma in the first row": "# time;fx;fy;fz\n0,0;1;2;3\n1e-2;4;5;6\n",
    "commas at the end": "time,fx,fy,fz,\n0,1,2,3,\n0.01,4,5,6,\n",
    "commas at the end of numbers": HEADER + "0,1,2,3,\n0.01,4,5,6,\n",
    "empty rows": HEADER + ",,,\n0,1,2,3\n0.005,nan,NaN,\n,,NA,null\n0.01,4,5,6\n",
    "other columns": "time,fx,fy,fz,who\n0,1,2,3,me\n0.01,4,5,6\n",
    "old line ends": HEADER.replace("\n", "\r") + "0,1,2,3\r0.01,4,5,6",
    "exponents": HEADER + "0e0,+1,0.2E1,300e-2\n1e-2,4,5,6\n",
    "UTF-16": (HEADER + "0,1,2,3\n0.01,4,5,6\n").encode("utf-16"),
    "texts of two lines": 'time,fx,fy,fz,"a\nb"\n0,1,2,3,"c\n\n# d\n"\n0.01,4,5,6,"5 "" e"\n',
    "comments of some rows": HEADER[:-1] + ",comment\n0,1,2,3,start\n0.01,4,5,6\n",
    "a column that is nowhere": HEADER[:-1] + ",comment\n0,1,2,3\n0.01,4,5,6\n",
    "signs of sharp and inches": HEADER[:-1] + ',no #\n0,1,2,3,part #1 5"\n0.01,4,5,6,#2\n',
    "missing first": "fx,fy,fz,time\n#N/A,#N/A,#N/A,-1\n1,2,3,0\n#NV,-1.#IND,-,0.005\n4,5,6,0.01\n",
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_variants_of_the_format_are_read(read, name):
    [found] = read(ACCEPTED[name])
    np.testing.assert_array_equal(found.time, [0, 0.01])
    np.testing.assert_array_equal(found.values, [[1, 2, 3], [4, 5, 6]])


REFUSED = {
    "text": (HEADER + "\n# x\n0,1,2,3\n0.01,1,broken,3\n", "line 5: 'broken' in column 'fy', expected a number"),
    "words": (HEADER + "a,b,c,d\n0,1,2,3\n", "line 2: 'a' in column 'time', expected a number"),
    "comment in a row": (HEADER + "0,1,2,3 # first\n", "line 2: '3 # first' in column 'fz', expected a number"),
    "time of day": (HEADER + "12:00:01,1,2,3\n", "'12:00:01' in column 'time', expected a number; convert dates to"),
    "date": (
        HEADER + "2026-01-31T00:00:00,1,2,3\n",
        "line 2: '2026-01-31T00:00:00' in column 'time', expected a number; convert dates to seconds first",
    ),
    "decimal comma": (HEADER + "0,01,1,5,2,1,3,5\n", "line 2 has 8 fields, expected 4"),
    "two widths": (HEADER[:-1] + ",temp\n0,1,2,3,20\n0.01,1,3,20\n", "line 3 has 4 fields, expected 5"),
    "one field more": (HEADER + "0,1,2,3\n0.01,1,2,3,9\n", "line 3 has 5 fields, expected 4"),
    "mixed signs": (
        "time;fx;fy;fz\n0;1,5;2.5;3\n",
        "line 2: '1,5' in column 'fx', expected a number with a decimal point, as '2.5' in line 2",
    ),
    "point and comma": (
        "time;fx;fy;fz\n" + "0;1,5;2;3\n" * 100 + "0;1.5;2;3\n",
        "line 102: '1.5' in column 'fx', expected a number with a decimal comma, as '1,5' in line 2",
    ),
    "quote": (
        HEADER + '0,1,"2,3\n0.01,1,2,3\n',
        "line 3 looks like data, but is inside a text in quotes that begins in",
    ),
    "two quotes": (
        HEADER[:-1] + ',note\n0,1,2,3,"a\n1,1,2,3,b\n2,1,2,3,c"\n',
        "line 3 looks like data, but is inside a text in quotes that begins in line 2",
    ),
    "open quote": (HEADER + '0,1,2,3\n0.01,1,2,"3\n', "line 3: damaged text (unexpected end of data)"),
    "after two lines": (
        HEADER[:-1] + ",note\n" + '0,1,2,3,"a\nb"\n' * 50 + '0,x,2,3,"a\nb"\n',
        "line 102: 'x' in column 'fx', expected a number",
    ),
    "hole after two lines": (
        HEADER[:-1] + ",trial\n# c\n" + '0,1,2,3,"a\n\nb"\n' * 9 + '0,,2,3,"a\n\nb"\n',
        "column 'fx' has no value in line 30 (1 such rows)",
    ),
    "a label like a comment": (
        "trial,time,fx,fy,fz\n#0,0,1,2,3\n#0,1,1,2,3\n",
        "line 2 looks like data, but is a comment; put '#0' in double quotes, or remove the line",
    ),
    "a later label": ("phase,time,fx,fy,fz\na,0,1,2,3\n#a,1,1,2,3\n", "line 3 looks like data, but is a comment; put"),
    "truncated": (HEADER + "0,1,2,3\n0.01,1,2", "line 3 has 3 fields, expected 4"),
    "holes": (HEADER + "0,1,2,3\n#\n0.01,,2,3\n0.02,,2,3\n", "column 'fx' has no value in line 4 (2 such rows)"),
    "no time": (HEADER + "0,1,2,3\n,1,2,3\n", "column 'time' has no value in line 3 (1 such rows)"),
    "infinite": (HEADER + "0,1,2,3\n0.01,1,-inf,3\n", "column 'fy' is infinite in line 3 (1 such rows)"),
    "NUL": (HEADER + "0,1,2\0,3\n", "NUL bytes, expected a text in UTF-8, or in UTF-16 with a byte order mark"),
    "UTF-16 without mark": (
        HEADER.encode("utf-16-le"),
        "NUL bytes, expected a text in UTF-8, or in UTF-16 with a byte",
    ),
    "odd UTF-16": (HEADER.encode("utf-16") + b"a", "not a text in UTF-8 ('utf-16-le' codec can't decode byte 0x61"),
    "Latin-1": ("time [µs],fx,fy,fz\n".encode("latin-1"), "not a text in UTF-8 ('utf-8' codec can't decode byte 0xb5"),
    "late Latin-1": (HEADER.encode() + b"0,1,2,3\n" * 9000 + b"\xb5", "not a text in UTF-8 ('utf-8' codec can't"),
    "empty": ("", "no line of column names; the file has no data"),
    "no rows": (HEADER, "no samples; expected at least 2 rows with values"),
    "no header": (
        "0,1,2,3\n0.01,1,2,3\n",
        "line 1 has 4 numbers, expected the names of the columns",
    ),
    "missing trial": ("time,fx,fy,fz,trial\n0,1,2,3,1\n0.01,1,2,3,\n", "column 'trial' has no value in line 3"),
    "long label": (
        f"time,fx,fy,fz,phase\n0,1,2,3,{'a' * 61}\n",
        "'phase' has a text of 61 characters, expected at most 60",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_wrong_file_is_refused(read, tmp_path, name):
    text, message = REFUSED[name]
    with pytest.raises(
        ValueError, match=re.escape(f"{tmp_path / 'snap.csv'}: ") + ".*" + re.escape(message)
    ) as refused:
        read(text)
    assert "\n" not in str(refused.value)


def stamped(step, *, start=0.0, name="time", number=60):
    """A recording with time stamps that are so far apart."""
    return f"{name},fx,fy,fz\n" + "".join(f"{start + k * step:.12g},1,2,3\n" for k in range(number))


UNCLEAR = {  # interval in the file, units with which it is plausible
    **{0.1: ("s", "ms"), 0.05: ("s", "ms"), 0.04: ("s", "ms"), 1 / 30: ("s", "ms"), 0.2: ("s", "ms")},
    **{1: ("s", "ms", "us"), 10: ("s", "ms", "us"), 100: ("s", "ms", "us"), 1000: ("s", "us", "ns"), 1e6: ("s", "ns")},
    1e-7: ("s",),
}


@pytest.mark.parametrize("step", UNCLEAR)
def test_a_time_of_which_the_unit_is_not_clear_is_asked_for(read, step):
    with pytest.raises(ValueError, match=r"^snap\.csv: column 'a b' does not say its unit: ") as refused:
        read(stamped(step, name="a b"), columns=["time=a b"])
    remedies = re.findall(r"([\d.e+-]+) Hz with --columns '(time=a b:(\w+))'", str(refused.value))
    assert tuple(unit for *_, unit in remedies) == UNCLEAR[step]
    for rate, choice, _ in remedies:
        [found] = read(stamped(step, name="a b"), columns=[choice])
        assert found.rate == pytest.approx(float(rate), rel=1e-5)


@pytest.mark.parametrize("rate", [50, 100, 1000, 7000, 1e6])
def test_a_fast_recording_is_in_seconds(read, rate):
    [found] = read(stamped(1 / rate))
    assert found.rate == pytest.approx(rate)


def test_a_long_recording_may_be_a_fast_one_in_milliseconds(read):
    with pytest.raises(ValueError, match=r"100 Hz with --columns time=time:s or 100000 Hz with --columns time=time:ms"):
        read(HEADER + "0,1,2,3\n" + "".join(f"{3700 + 0.01 * k:.2f},1,2,3\n" for k in range(9)))


@pytest.mark.parametrize("size", [1, 1e3, 1e6, 1e9])
def test_time_stamps_since_1970_show_their_unit(read, size):
    [found] = read(stamped(0.04 * size, start=1.7e9 * size))
    assert found.time[0] == pytest.approx(1.7e9)
    assert found.rate == pytest.approx(25, rel=1e-3)


@pytest.mark.parametrize("rows", [130, 2 * csv_file.CHUNK + 7])
def test_decimal_commas_may_begin_late(read, rows):
    text = "time [ms];fx;fy;fz\n" + "".join(f"{k};{'0,5' if k == rows - 1 else 0};0;0\n" for k in range(rows))
    [found] = read(text)
    assert found.values[:, 0].tolist() == [0.0] * (rows - 1) + [0.5]
    for late, message in (("0.5", " with a decimal comma, as '0,5' in line"), ("x", "$")):
        with pytest.raises(ValueError, match=rf"line {rows + 2}: '{late}' in column 'fy', expected a number{message}"):
            read(f"{text}{rows};0;{late};0\n")


THOUSANDS = {  # rows of two samples at 10 and 20 ms, with 1234.5 N
    "points and commas": "time [us];fx;fy;fz\n10.000;1.234,5;2;3\n20.000;1.234,5;2;3\n",
    "in quotes": 'time [us],fx,fy,fz\n"10,000","1,234.5",2,3\n"20,000","1,234.5",2,3\n',
    "spaces": "time [us]\tfx\tfy\tfz\n10 000\t1 234,5\t2\t3\n20 000\t1 234,5\t2\t3\n",
    "narrow spaces": "time [us];fx;fy;fz\n10\u202f000;1\u202f234,5;2;3\n20\u202f000;1\u202f234,5;2;3\n",
    "apostrophes": "time [us],fx,fy,fz\n10'000,1'234.5,2,3\n20'000,1'234.5,2,3\n",
    "millions": "time [ns];fx;fy;fz\n10.000.000;1234,5;2;3\n20.000.000;1234,5;2;3\n",
}


@pytest.mark.parametrize("name", THOUSANDS)
def test_signs_between_thousands_are_no_decimal_signs(read, name):
    [found] = read(THOUSANDS[name])
    np.testing.assert_allclose(found.time, [0.01, 0.02])
    np.testing.assert_array_equal(found.values, [[1234.5, 2, 3]] * 2)


@pytest.mark.parametrize(("one", "point"), [("1.000", 1), ("1,000", 1000)])
def test_thousands_that_could_be_decimals_are_asked_for(read, one, point):
    text = f"time [ms];fx;fy;fz\n0;5;5;5\n10;5;{one};3\n"
    message = f"line 3: column 'fy' is {point} with decimal points, {1001 - point} with decimal commas; say which"
    with pytest.raises(ValueError, match=message):
        read(text)
    assert read(text, decimal=".")[0].values[1, 1] == point
    assert read(text, decimal=",")[0].values[1, 1] == 1001 - point
    assert read(text + "20;5;0,5;3\n")[0].values[1, 1] == 1001 - point  # another number settles it
    with pytest.raises(ValueError, match=r"line 4: '0,5' in column 'fy', expected a number with a decimal point$"):
        read(text + "20;5;0,5;3\n", decimal=".")


def test_limits(read, tmp_path, monkeypatch):
    text = HEADER + "0,1,2,3\n" * 3000
    monkeypatch.setattr(csv_file, "MAX_BYTES", 24_013)
    with pytest.raises(ValueError, match=r"snap\.csv: 0 MB, expected at most 0 MB"):
        read(text)
    monkeypatch.setattr(csv_file, "MAX_BYTES", 24_014)
    monkeypatch.setattr(column_table, "MAX_SAMPLES", 2000)
    with pytest.raises(ValueError, match=r"snap\.csv: 3000 samples, expected at most 2000; lower the rate"):
        read(text)
    with pytest.raises(ValueError, match="expected a file"):
        read_csv_file(tmp_path)
