"""NumPy archives with an array for each column or a wrench of six columns; nothing is unpickled."""

import re

import numpy as np
import pytest

from skill.recordings import npz_file
from skill.recordings.column_table import ColumnChoice
from skill.recordings.npz_file import read_npz_file

TIME = np.tile(np.arange(5) / 50, 2)
WRENCH = np.arange(60.0).reshape(10, 6)
TRIAL = np.repeat([4, 9], 5)


def test_wrench_trials_and_phases_are_read(tmp_path):
    arrays = {"time": TIME, "wrench": WRENCH, "trial": TRIAL, "phase": np.arange(10) // 3, "photo": np.zeros((3, 3))}
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", **arrays)
        first, second = read_npz_file(tmp_path / "a.npz")
        assert [first.name, second.name] == ["a.npz, trial 4", "a.npz, trial 9"]
        assert first.channels == ("fx", "fy", "fz", "mx", "my", "mz")
        np.testing.assert_array_equal(second.values, WRENCH[5:])
        np.testing.assert_array_equal(second.time, TIME[5:])
        assert second.phases.tolist() == [1, 2, 2, 2, 3]


def test_columns_of_their_own_and_of_other_types_are_read(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, t_ms=np.arange(10) * 2, wrench=WRENCH[:, :3].astype("f4"), depth_mm=np.arange(10))
    [found] = read_npz_file(path)
    assert found.channels == ("fx", "fy", "fz", "depth")
    np.testing.assert_allclose(found.values[:, 3], np.arange(10) * 1e-3)
    assert found.rate == pytest.approx(500)
    choice = ColumnChoice(["grip=depth_mm:mm", "time=t_ms:us"], phase_column="depth_mm")
    [found] = read_npz_file(path, choice)
    assert found.channels == ("fx", "fy", "fz", "grip")
    assert found.rate == pytest.approx(5e5)
    assert found.phases.tolist() == list(range(10))


REFUSED = {
    "object": ({"time": np.array([{}], dtype=object), "wrench": WRENCH}, "'time.npy': type object, expected numbers"),
    "shape": ({"time": TIME, "wrench": WRENCH[:, :5]}, "'wrench' has shape (10, 5), expected (n, 6) or (n, 3)"),
    "flat": ({"time": TIME, "wrench": WRENCH[:, 0]}, "'wrench' has shape (10,), expected (n, 6) or (n, 3)"),
    "lengths": ({"time": TIME[:9], "wrench": WRENCH}, "arrays of different lengths {'time': 9, 'fx': 10"),
    "text": ({"time": np.array(["a"] * 10), "wrench": WRENCH}, "column 'time' has type"),
    "complex": ({"time": TIME * 1j, "wrench": WRENCH}, "type complex128, expected numbers"),
    "no wrench": ({"time": TIME}, "no column for fx, fy, fz; columns are ['time']"),
    "NaN": ({"time": TIME, "wrench": np.where(WRENCH == 13, np.nan, WRENCH)}, "'fy' has no value in row 2"),
    "empty": ({"time": TIME[:0], "wrench": WRENCH[:0]}, "no samples; expected at least 2 rows with values"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_arrays_are_refused(tmp_path, name):
    arrays, message = REFUSED[name]
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    with pytest.raises(ValueError, match=re.escape(f"{path}: ") + ".*" + re.escape(message)):
        read_npz_file(path)


def test_limits(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, time=np.arange(10_000) / 50, wrench=np.zeros((10_000, 6)))
    monkeypatch.setattr(npz_file, "MAX_BYTES", 500_000)
    with pytest.raises(ValueError, match="1 MB of arrays, expected at most 0 MB"):
        read_npz_file(path)
    monkeypatch.setattr(npz_file, "MAX_BYTES", 5000)
    with pytest.raises(ValueError, match="0 MB, expected at most 0 MB"):
        read_npz_file(path)
