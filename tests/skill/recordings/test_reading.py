"""Every kind of file and folder goes to its reader; options without effect are refused."""

import re

import numpy as np
import pandas as pd
import pytest

from skill.recordings.reading import TABLES, read_recordings
from tests.skill.recordings.wrench_messages import cdr, write_db3, write_mcap

TABLE = pd.DataFrame(
    {"t": np.arange(6) % 3 / 100, "a": np.arange(6.0), "fy": 1.0, "fz": 2.0, "part": [1, 1, 1, 2, 2, 2], "what": "x"}
)
WRITERS = {
    ".csv": lambda path: TABLE.to_csv(path, index=False),
    ".tsv": lambda path: TABLE.to_csv(path, index=False, sep="\t"),
    ".TXT": lambda path: TABLE.to_csv(path, index=False, sep=";", decimal=","),
    ".parquet": TABLE.to_parquet,
    ".pq": TABLE.to_parquet,
    ".npz": lambda path: np.savez(
        path, **{name: TABLE[name].to_numpy(dtype=None if name != "what" else "U") for name in TABLE}
    ),
}


@pytest.mark.parametrize("suffix", WRITERS)
def test_tables(tmp_path, suffix):
    path = tmp_path / f"snap{suffix}"
    WRITERS[suffix](path)
    found = read_recordings(str(path), columns=iter(["fx=a:mN"]), trial_column="part", phase_column="what")
    assert [r.name for r in found] == [f"snap{suffix}, trial 1", f"snap{suffix}, trial 2"]
    np.testing.assert_array_equal(found[1].values, [[0.003, 1, 2], [0.004, 1, 2], [0.005, 1, 2]])
    assert set(found[0].phases) == {"x"}
    assert {s.lower() for s in WRITERS} == set(TABLES) - {".dat", ".asc", ".log", ".lvm"}


def test_a_defect_names_the_folder_too(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time,fx,fy,fz,trial\n0,1,1,1,a\n0.01,1,1,1,a\n0.01,2,2,2,b\n0,2,2,2,b\n")
    with pytest.raises(ValueError, match=re.escape(f"{path}, trial b: time 0 s jumps back")):
        read_recordings(path)
    with pytest.raises(ValueError, match=re.escape(f"{path}: ")):  # once
        read_recordings(path, columns=["fx=b"])


@pytest.mark.parametrize(("suffix", "write_file"), {".mcap": write_mcap, ".db3": write_db3}.items())
def test_bags(tmp_path, suffix, write_file):
    write_file(
        tmp_path / f"a{suffix}", [("/ft", k, cdr(k)) for k in range(3)] + [("/tool", k, cdr(k)) for k in range(4)]
    )
    for path in (tmp_path / f"a{suffix}", tmp_path):
        assert len(read_recordings(path, topic="/tool", columns=iter([]))[0].time) == 4


def test_columns_are_a_list(tmp_path):
    with pytest.raises(ValueError, match=r"a\.csv: columns 'fx=a', expected a list of texts"):
        read_recordings(tmp_path / "a.csv", columns="fx=a")


ALLOWED = {  # file or folder: what it is, and the options that it takes
    **dict.fromkeys(
        ("a.csv", "a.TXT"), ("a text", {"columns", "trial_column", "phase_column", "sampling_rate", "decimal"})
    ),
    **dict.fromkeys(("a.parquet", "a.npz"), ("a table", {"columns", "trial_column", "phase_column"})),
    **dict.fromkeys(("a.mcap", "a.db3", "a.bag"), ("a bag", {"columns", "topic"})),
    "set": ("a data set of LeRobot", {"columns", "phase_column", "feature"}),
}
OPTIONS = {
    **dict.fromkeys(("trial_column", "phase_column", "topic", "feature"), "a"),
    **{"columns": ["fx=a"], "sampling_rate": 1.0, "decimal": "."},
}


@pytest.mark.parametrize("name", ALLOWED)
def test_options_without_effect_are_refused(tmp_path, name):
    kind, allowed = ALLOWED[name]
    (tmp_path / "set" / "meta").mkdir(parents=True)
    (tmp_path / "set" / "meta" / "info.json").touch()
    for option, value in OPTIONS.items():
        with pytest.raises(ValueError, match=name) as refused:  # if it is allowed, for want of the file
            read_recordings(tmp_path / name, **{option: value})
        message = f"{tmp_path / name}: ['{option}'] cannot be chosen for {kind}; expected only {sorted(allowed)}"
        assert (str(refused.value) == message) == (option not in allowed)


def test_other_files_are_refused(tmp_path):
    folder = "a folder without meta/info.json (LeRobot) or .mcap .db3 .bag (bags)"
    for remedy in ("", "; unpack its files with 'zstd -d' first"):
        with pytest.raises(ValueError, match=re.escape(folder + remedy) + "$"):
            read_recordings(tmp_path)
        (tmp_path / "bag_0.db3.zstd").touch()
    expected = "expected .csv .tsv .txt .dat .asc .log .lvm .parquet .pq .npz .mcap .db3 .bag or a folder"
    for suffix, remedy in ((".npy", ""), (".zstd", "; unpack it with 'zstd -d' first")):
        with pytest.raises(
            ValueError, match=re.escape(f"a.mcap{suffix}: ends in '{suffix}', {expected}{remedy}") + "$"
        ):
            read_recordings(f"a.mcap{suffix}")
    for suffix in (*TABLES, ".mcap", ".db3", ".bag"):
        with pytest.raises(ValueError, match=rf"a\{suffix}: no such file$"):
            read_recordings(tmp_path / f"a{suffix}")
