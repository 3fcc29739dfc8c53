"""What a column named as one of trials may say of the rows, in tables of every kind."""

import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.recordings.reading import read_recordings

WRITERS = {
    ".csv": lambda table, path: table.to_csv(path, index=False),
    ".parquet": lambda table, path: table.to_parquet(path, index=False),
    ".npz": lambda table, path: np.savez(
        path, **{n: c.to_numpy(dtype="U" if c.dtype.kind not in "biuf" else None) for n, c in table.items()}
    ),
}
ROWS = np.arange(60)
NO_TRIALS = {
    "machine on": ((ROWS > 20) & (ROWS < 40), "is a flag with the values False and True"),
    "on from the middle": (ROWS > 20, "is a flag with the values False and True"),
    "always on": (ROWS >= 0, "is a flag with the values True"),
    "text flag": (np.where(ROWS > 20, "Yes", "No"), "is a flag with the values No and Yes"),
    "0 and 1": ((ROWS // 10 % 2), "changes 5 times between 2 values"),
    "modes": (np.array(["auto", "stop", "auto"])[ROWS // 20], "changes 2 times between 2 values"),
    "sorted by frame": (ROWS % 3, "changes 59 times between 3 values"),
    "counter": (ROWS, "has another value in each row"),
}


@pytest.fixture(params=WRITERS)
def write(request, tmp_path):
    def write_file(column, values):
        table = pd.DataFrame({"time_s": ROWS / 100, "fx": ROWS, "fy": 1.0, "fz": 2.0, column: values})
        path = tmp_path / f"a{request.param}"
        WRITERS[request.param](table, path)
        return path

    return write_file


@pytest.mark.parametrize("column", ["run", "Trial", "episode"])
@pytest.mark.parametrize("name", NO_TRIALS)
def test_a_column_that_divides_no_rows_is_refused_and_the_remedies_work(write, column, name):
    values, found = NO_TRIALS[name]
    path = write(column, values)
    message = f"{path}: column '{column}' {found}, expected rows of one trial after those of another"
    with pytest.raises(ValueError, match=f"^{re.escape(message)}") as error:
        read_recordings(path)
    assert re.findall(r"--trial-column (\S+)\)", str(error.value)) == [column, "''"]
    assert "\n" not in str(error.value)
    [whole] = read_recordings(path, trial_column="")
    np.testing.assert_array_equal(whole.values[:, 0], ROWS)
    if name != "counter":
        assert len(read_recordings(path, trial_column=column)) == len(np.unique(values))


@pytest.mark.parametrize(
    "values", [ROWS // 20, 3 - ROWS // 20, np.array(["b", "a"])[ROWS // 30], ROWS // 60 + 7, ROWS // 20 * 0.5]
)
def test_a_column_of_trials_divides_the_rows(write, values):
    found = read_recordings(write("run", values))
    assert [r.values[0, 0] for r in found] == [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1)]


@pytest.mark.parametrize("twice", ["fz", "trial"])
def test_a_column_that_is_read_is_there_once(tmp_path, twice):
    columns = {"time_s": ROWS / 100, "fx": ROWS, "fy": ROWS, "fz": ROWS, "trial": ROWS // 20}
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table([*columns.values(), ROWS // 20], names=[*columns, twice]), path)
    with pytest.raises(ValueError, match=rf"^{re.escape(str(path))}: columns \['{twice}'\] occur more than once"):
        read_recordings(path, columns=["fz=fz"], trial_column="trial")
