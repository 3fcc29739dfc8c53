import numpy as np
import pandas as pd
import pytest

from experiments.outputs.output_checks import check_file
from scripts.states import is_state_table, state_table_path, write_state_table
from tests.state_recordings import FORCES, MOMENTS, labelled

WRENCHES = np.hstack([FORCES, MOMENTS])


def test_a_table_lies_beside_its_file_or_folder_or_in_the_folder_for_tables(tmp_path, monkeypatch):
    (tmp_path / "bag.v1").mkdir()
    assert state_table_path(tmp_path / "runs.v1.csv", None) == tmp_path / "runs.v1.states.csv"
    assert state_table_path(tmp_path / "bag.v1", None) == tmp_path / "bag.v1.states.csv"
    assert state_table_path(tmp_path / "runs.npz", tmp_path / "x") == tmp_path / "x" / "runs.states.csv"
    monkeypatch.chdir(tmp_path / "bag.v1")
    assert state_table_path(tmp_path.__class__("."), None).resolve() == (tmp_path / "bag.v1.states.csv").resolve()


def test_the_table_has_the_state_of_each_sample(tmp_path):
    path = tmp_path / "a.states.csv"
    stamps = 1.7e9 + 0.02 * np.arange(2)  # the time of the file, since 1970
    first = labelled([0, 1], WRENCHES, time=stamps, trial='3, "b"', probability=0.98766)
    write_state_table(path, [first, labelled([2, 2], WRENCHES)])
    assert path.read_text() == (
        "trial,time,state,probability\n"
        '"3, ""b""",1700000000.0,0,0.9877\n"3, ""b""",1700000000.02,1,0.9877\n'
        ",0.0,2,1.0\n,0.1,2,1.0\n"
    )
    assert pd.read_csv(path)["state"].tolist() == [0, 1, 2, 2]


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.states.csv", "trial,time,state,probability\n1,0,0,1\n", True),
        ("a.states.csv", "trial,time,state,probability\r\n1,0,0,1\r\n", True),
        ("a.csv", "trial,time,state,probability\n1,0,0,1\n", False),
        ("a.states.csv", "trial,time,state,probability,fx\n", False),
        ("a.states.csv", "time,fx,fy,fz\n", False),
        ("a.states.csv", "", False),
    ],
)
def test_tables_are_recognised_by_name_and_first_line(tmp_path, name, text, expected):
    path = tmp_path / name
    path.write_bytes(text.encode())
    assert is_state_table(path) is expected
    if expected:
        check_file(path, ".csv")  # may be replaced
    assert not is_state_table(tmp_path)
    assert not is_state_table(tmp_path / "missing.states.csv")
