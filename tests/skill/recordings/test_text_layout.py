"""Where the names, units and numbers of a text are: loggers' preambles, lines of units, texts without names."""

import re
import shlex

import numpy as np
import pytest

from skill.recordings.reading import read_recordings

SIX = "fx,fy,fz,mx,my,mz"


@pytest.fixture
def read(tmp_path):
    def read_text(text, **options):
        path = tmp_path / "snap.txt"
        path.write_text(text)
        return read_recordings(path, **options)

    return read_text


def rows(*values, separator=",", step=0.01, number=4):
    """Rows of a time and these values."""
    return "".join(separator.join([f"{k * step:g}", *values]) + "\n" for k in range(number))


LABVIEW = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    "X_Columns\tOne\nDate\t2020/01/01\nTime\t12:00:00.123\n***End_of_Header***\t\n\t\nChannels\t3\t\t\t\nSamples\t4\t4\t4\t\n"
    "Date\t2020/01/01\t2020/01/01\t2020/01/01\t\nY_Unit_Label\tNewtons\tNewtons\tNewtons\t\n"
    "X_Dimension\tTime\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.01\t0.01\t0.01\t\n"
    "***End_of_Header***\t\t\t\t\nX_Value\tFx\tFy\tFz\tComment\n"
)
ATI = (
    "Start Time:,5/29/2013 10:00:00 AM\nRDT Sample Rate:,7000\nForce Units:,N\nCounts per Unit Force:,1000000\n"
    "Torque Units:,Nm\nCounts per Unit Torque:,1000000\n"
)
LAYOUTS = {  # texts of four samples at 100 Hz with 1, 2, 3 N
    "LabVIEW": LABVIEW + rows("1", "2", "3", separator="\t"),
    "LabVIEW with tabs at the end": LABVIEW + rows("1", "2", "3", "", separator="\t"),
    "LabVIEW with a comment": LABVIEW + "-0.01\t1\t2\t3\tstart\n" + rows("1", "2", "3", separator="\t", number=3),
    "LabVIEW in German": LABVIEW.replace(".", ",") + rows("1", "2", "3", separator="\t").replace(".", ","),
    "ATI": f"{ATI}Status (hex),RDT Sequence,Fx,Fy,Fz,Time\n" + "".join(f"0x0,{k},1,2,3,{k / 100}\n" for k in range(4)),
    "ATI in quotes": f'{ATI}"Status","Fx","Fy","Fz","Time"\n'
    + "".join(f'"0","1","2","3","{k / 100}"\n' for k in range(4)),
    "Excel": "sep=;\ntime;fx;fy;fz\n" + rows("1", "2", "3", separator=";").replace(".", ","),
    "groups of names": "left,,,,right,,\ntime,fx,fy,fz,gx,gy,gz\n" + rows("1", "2", "3", "4", "5", "6"),
    "another table above": "1 2 3 4 5 6\n" * 6 + "time fx fy fz\n" + rows("1", "2", "3", separator=" "),
    "numpy.savetxt": "# made by NumPy\n# time fx fy fz\n" + rows("1.000000000000000000e+00", "2", "3", separator=" "),
    "names with other separators": "# time,fx,fy,fz\n" + rows("1", "2", "3", separator=" "),
    "MATLAB": "% time fx fy fz\n" + rows("1", "2", "3", separator="  "),
    "aligned": "   Time [ms]   Fx [N]   Fy [N] Fz [mN]\n" + rows("1", "2", "3000", separator="     ", step=10),
    "names of two lines": '"time\n[ms]","force x\n(N)",fy,fz\n' + rows("1", "2", "3", step=10),
    "units below": "time;fx;fy;fz\nms;mN;N;kN\n" + rows("1000", "2", "0.003", separator=";", step=10),
    "units in brackets": "t;fx;fy;fz\n[s];[N];[N];[mN]\n" + rows("1", "2", "3000", separator=";"),
    "units in a comment": "# time fx fy fz\n# ms N N N\n" + rows("1", "2", "3", separator=" ", step=10),
    "units above": "ms,mN,N,N,\ntime,fx,fy,fz,note\n" + rows("1000", "2", "3", "N", step=10),
    "units of other columns": "time,fx,fy,fz,temp,status\ns,mN,N,N,degC,-\n" + rows("1000", "2", "3", "20", "ok"),
    "units twice": "time [ms];fx [N];fy;fz\nms;N;N;N\n" + rows("1", "2", "3", separator=";", step=10),
    "a force in words": "Largest force: 2 kN\nForce Units: N\ntime,fx,fy,fz\n" + rows("1", "2", "3"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_names_units_and_numbers_are_found(read, name):
    [found] = read(LAYOUTS[name])
    assert found.channels == ("fx", "fy", "fz")
    assert found.rate == pytest.approx(100)
    np.testing.assert_allclose(found.values, [[1, 2, 3]] * 4)


def test_units_tell_translations_from_torques(read):
    text = "time,fx,fy,fz,tx,ty,tz,qw,qx,qy,qz\n"
    data = rows("1", "2", "3", "4", "5", "6", "1", "0", "0", "0")
    for unit, channel, size in (("mm", "px", 1e-3), ("Nmm", "mx", 1e-3)):
        [found] = read(f"{text}s,N,N,N,{unit},{unit},{unit},1,1,1,1\n{data}")
        assert found.values[0, found.channels.index(channel)] == pytest.approx(4 * size)
    with pytest.raises(ValueError, match="could be moments or positions"):
        read(text + data)


REFUSED = {
    "units that differ": (
        "time,fx [N],fy,fz\ns,mN,N,N\n",
        "column 'fx [N]' has the unit 'mN' beside its name, expected",
    ),
    "a wrong unit": ("time,fx,fy,fz\ns,N,V,N\n", "column 'fy': 'V' is no unit of force"),
    "units in words": (
        "Force Units:,lbf\ntime,fx,fy,fz\n",
        "line 1 speaks of 'lbf', but column 'fx' has no unit; say the units, e.g. --columns fx=fx:lbf"
        " --columns fy=fy:lbf --columns fz=fz:lbf",
    ),
    "units in a comment": ("# forces in mN\ntime,fx,fy,fz\n", "line 1 speaks of 'mN', but column 'fx' has no unit"),
    "names of LabVIEW": (
        LABVIEW.replace("Fx\tFy\tFz", "Untitled\tUntitled 1\tUntitled 2").replace("\t", ","),
        "no column for fx, fy, fz; columns are ['X_Value', 'Untitled', 'Untitled 1', 'Untitled 2', 'Comment']",
    ),
    "rows above the names": (
        rows("1", "2", "3") + "time,fx,fy,fz\n",
        "line 1 looks like data, but the names of the columns are in line 5",
    ),
    "names twice": (
        "time,fx,fy,fz\n" + rows("1", "2", "3") + "time,fx,fy,fz\n",
        "line 6: 'time' in column 'time', expected",
    ),
    "no time": ("fx,fy,fz,mz\n", "no column for time, mx, my; columns are"),
    "a damaged first row": ("time,fx,fy,fz\n-1,x,2,3\n", "line 2: 'x' in column 'fx', expected a number"),
    "too long a preamble": ("note\n" * 1000 + "time,fx,fy,fz\n", "no line of column names such as time,fx,fy,fz"),
    "words": ("hello\nworld\n", "line 3 has 4 numbers, expected the names of the columns"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_unclear_is_refused(read, name):
    text, message = REFUSED[name]
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        read(text + rows("1", "2", "3"))
    assert "\n" not in str(refused.value)


# ------------------------------------------------------------ without names


def options_of(message):
    """The options in the remedy of a message, as those of `read_recordings`."""
    words = shlex.split(message.partition("e.g. ")[2])
    said = [words[k : k + 2] for k, word in enumerate(words) if word.startswith("--")]
    rates = [float(value) for option, value in said if option == "--sampling-rate"]
    return {
        "columns": [value for option, value in said if option == "--columns"],
        "sampling_rate": rates[0] if rates else None,
    }


@pytest.mark.parametrize("separator", [" ", ",", ";", "\t", "   ", ", "])
@pytest.mark.parametrize(
    ("count", "names"),
    {1: "fz", 2: "time,fz", 3: "fx,fy,fz", 4: "time,fx,fy,fz", 6: SIX, 7: f"time,{SIX}", 9: f"time,{SIX},,"}.items(),
)
def test_the_remedy_for_numbers_without_names_works(read, tmp_path, separator, count, names):
    timed = names.startswith("time")
    table = 0.5 + np.arange(5.0 * count).reshape(5, count)
    table[:, 0] *= 1.0 if not timed else 0.01 / count
    text = "".join(separator.join(map(str, row)) + "\n" for row in table)
    with pytest.raises(ValueError, match=f"line 1 has {count} numbers, expected the names of the columns") as refused:
        read(text)
    line = f"haptic-skill states {tmp_path / 'snap.txt'} --columns {names}{'' if timed else ' --sampling-rate 100'}"
    assert str(refused.value).endswith(f"e.g. {line}")
    [found] = read(text, **options_of(str(refused.value)))
    channels = [name for name in names.split(",") if name not in ("time", "")]
    assert list(found.channels) == channels
    assert found.rate == pytest.approx(100)
    np.testing.assert_array_equal(found.values, table[:, timed : timed + len(channels)])


BARE = {  # text, options: value of fz in the third row
    "units": ("1 2 3\n" * 3, {"columns": ["fx,fy,fz:mN"], "sampling_rate": 10}, 3e-3),
    "line of units": ("N N kN\n" + "1 2 3\n" * 3, {"columns": ["fx,fy,fz"], "sampling_rate": 10}, 3e3),
    "preamble": ("made by\n# a b c\n\n" + "1 2 3\n" * 3, {"columns": ["fx", "fy", "fz"], "sampling_rate": 10}, 3),
    "decimal commas": ("1,5 2,5 3,5\n" * 3, {"columns": ["fx,fy,fz"], "sampling_rate": 10}, 3.5),
    "numbers of columns": (rows("9", "1", "2", "3"), {"columns": ["time=1", "fx=3", "fy=4", "fz=5:mN"]}, 3e-3),
    "words in a comment": (
        "# made by our logger now\n" + rows("9", "1", "2", "3", "4", "5"),
        {"columns": ["time=1", "fx=3", "fy=4", "fz=5"]},
        3,
    ),
    "words like names": (
        "Fx Fy Fz in N at time\n" + rows("1", "2", "3", "4", "5", "6", "7"),
        {"columns": [f"time,{SIX},"]},
        3,
    ),
    "both": (rows("9", "1", "2", "3"), {"columns": ["time,,fx,fy,fz", "load=2:N"]}, 3),
    "the other order": ("3 2 1\n" * 3, {"columns": ["fz,fy,fx"], "sampling_rate": 10}, 3),
    "a unit in addition": (rows("1", "2", "3", step=0.05), {"columns": ["time,fx,fy,fz", "time=time:ms"]}, 3),
    "a single channel": ("3\n" * 3, {"columns": ["fz"], "sampling_rate": 10}, 3),
    "with phases": (rows("1", "2", "3", "x"), {"columns": ["time,fx,fy,fz,phase"]}, 3),
    "missing at the begin": ("nan nan nan\n" + "1 2 3\n" * 3, {"columns": ["fx,fy,fz"], "sampling_rate": 10}, 3),
    "missing beside": ("nan 1 2 3\n" * 3, {"columns": ["fx=2", "fy=3", "fz=4"], "sampling_rate": 10}, 3),
    "names without a time": ("fx,fy,fz\n" + "1,2,3\n" * 3, {"sampling_rate": 10}, 3),
}


@pytest.mark.parametrize("name", BARE)
def test_the_user_names_columns_in_their_order_or_by_their_numbers(read, name):
    text, options, fz = BARE[name]
    [found] = read(text, **options)
    assert found.values[2, found.channels.index("fz")] == pytest.approx(fz)


def test_the_rate_counts_all_rows_of_a_trial(read):
    [found] = read("nan nan nan\n1 2 3\n1 2 3\nnan nan nan\n1 2 3\n", columns=["fx,fy,fz"], sampling_rate=10)
    np.testing.assert_allclose(found.time, [0.1, 0.2, 0.4])
    first, second = read("run,fx,fy,fz\n" + "a,1,2,3\nb,1,2,3\n" * 3, sampling_rate=10, trial_column="run")
    for found in (first, second):
        np.testing.assert_allclose(found.time, [0, 0.1, 0.2])


NOT_BARE = {
    "too few names": ("1 2 3 4\n" * 3, {"columns": ["fx,fy,fz"]}, "line 1 has 4 numbers, but 3 columns are named"),
    "three decimal commas": ("1,5 2,5 3,5\n", {"columns": [SIX]}, "line 1 has 3 numbers, but 6 columns are named"),
    "names that are there": (
        "time,fx,fy,fz\n1,2,3,4\n",
        {"columns": ["fx,fy,fz"]},
        "line 1 names the columns, ['time', 'fx', 'fy', 'fz']; say which of them is which channel",
    ),
    "other names": (
        "a,b,c\n1,2,3\n",
        {"columns": ["fx,fy,fz"]},
        "line 1 names the columns, ['a', 'b', 'c']; say instead which of them is which channel, e.g. --columns fz=c",
    ),
    "a damaged row": ("1,x,3\n1,2,3\n", {"columns": ["fx,fy,fz"]}, "line 1: 'x' in column 'fy', expected a number"),
    "a short row": ("1,2\n1,2,3\n", {"columns": ["fx,fy,fz"]}, "line 1 has 2 fields, expected 3"),
    "words": ("a b\n", {"columns": ["fx,fy,fz"]}, "no line of 3 numbers"),
    "words alone": ("a b\nc d\n", {}, "no line of column names such as"),
    "a wrong unit": ("1 2 3\n", {"columns": ["fx:V,fy,fz"]}, "'fx=fx:V': 'V' is no unit of force"),
    "a time": (
        "1 1 2 3\n" * 3,
        {"columns": ["time,fx,fy,fz"]},
        "has a time, in column 'time'; expected no sampling rate",
    ),
    "a time in the text": ("t,fx,fy,fz\n1,1,2,3\n", {}, "has a time, in column 't'; expected no sampling rate"),
    "no such column": ("1 2 3\n", {"columns": ["fx=1", "fy=2", "fz=4"]}, "no column '4'; columns are ['1', '2', '3']"),
}


@pytest.mark.parametrize("name", NOT_BARE)
def test_names_that_do_not_fit_are_refused(read, name):
    text, options, message = NOT_BARE[name]
    with pytest.raises(ValueError, match=re.escape(message)):
        read(text, sampling_rate=100, **options)


def test_a_text_without_a_time_needs_a_rate(read):
    for text, options in (("fx,fy,fz\n1,2,3\n1,2,3\n", {}), ("1 2 3\n" * 3, {"columns": ["fx,fy,fz"]})):
        message = r"no column for time; .*; without a time, say the rate of the rows, e\.g\. --sampling-rate 100$"
        with pytest.raises(ValueError, match=message):
            read(text, **options)
        assert read(text, **options, sampling_rate=100)[0].rate == pytest.approx(100)
    for options, message in (({"sampling_rate": 0}, "a sampling rate of 0, expected"), ({"decimal": ";"}, "sign ';'")):
        with pytest.raises(ValueError, match=message):
            read("fx,fy,fz\n", **options)


# ------------------------------------------------------------ same names twice

SAME = {  # names: the values of a row
    "time,fx,fy,fz,fx,fy,fz": "1,2,3,4,5,6",
    "time,Fx [mN],Fy [mN],Fz [mN],Fx [mN],Fy [mN],Fz [mN]": "1,2,3,4,5,6",
    "time,force x,force y,force z,force x,force y,force z": "1,2,3,4,5,6",
    "time,/a/wrench/force/x,/a/wrench/force/y,fz,/a/wrench/force/x,/a/wrench/force/y,note": "1,2,3,4,5,6",
    "time,Fx,fy,fz,fx ,note,note": "1,2,3,4,5,6",
}


@pytest.mark.parametrize("names", SAME)
def test_the_remedy_for_names_that_occur_twice_works(read, names):
    text = f"{names}\n" + rows(*SAME[names].split(","))
    with pytest.raises(ValueError, match="could all be fx") as refused:
        read(text)
    size = 1e-3 if "mN" in names else 1.0
    [found] = read(text, **options_of(str(refused.value)))
    np.testing.assert_allclose(found.values[0], np.array([1, 2, 3]) * size)
    [found] = read(text, columns=["fx=5", "fy=3", "fz=4:kN"])
    np.testing.assert_allclose(found.values[0], [4 * size, 2 * size, 3000])


def test_the_remedy_for_a_name_of_two_columns_works(read):
    text = "time,fx,fy,fz,fx\n" + rows("1", "2", "3", "4")
    message = r"no column 'fx'; columns are \['time', '2:fx', 'fy', 'fz', '5:fx'\]; say which one, e\.g\. fx=2:fx$"
    with pytest.raises(ValueError, match=message):
        read(text, columns=["fx=fx"])
    assert read(text, columns=["fx=2:fx:mN"])[0].values[0, 0] == 1e-3


def test_two_columns_of_phases_or_trials(read):
    text = "time,fx,fy,fz,{0},{0}\n" + rows("1", "2", "3", "a", "b")
    for word in ("phase", "trial"):
        with pytest.raises(
            ValueError, match=rf"could all be the {word}; say which one, e\.g\. --{word}-column 5:{word}$"
        ):
            read(text.format(word))
        for column, label in ((f"5:{word}", "a"), ("6", "b")):
            [found] = read(text.format(word), **{f"{word}_column": column})
            assert (set(found.phases) if word == "phase" else {found.trial}) == {label}
