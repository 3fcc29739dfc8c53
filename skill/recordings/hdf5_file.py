"""Reads recordings from HDF5 files of REASSEMBLE, assemblies of the NIST task board: one recording for each action.

By documentation, tested on synthetic files only. The schema is that of the README and of ``REASSEMBLE/io.py`` in
https://github.com/TUWIEN-ASL/REASSEMBLE (data: https://doi.org/10.48436/0ewrv-8cb44):

- ``robot_state/measured_force``, ``measured_torque``: shape (n, 3), in the frame of the sensor;
- ``timestamps/measured_force``: shape (n,) or (n, 1), s;
- ``segments_info/K/start``, ``end``, ``text``: begin and end, s, of the action K, and what it is;
- ``segments_info/K/low_level/J/start``, ``end``, ``text``: the same of its skills, such as "Approach".

The units of the wrench are not documented; those of the ROS messages that were recorded are N and N m. The wrench
without gravity, ``compensated_base_force``, is not read: its moments are about the base of the arm.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skill.arrays import Array
from skill.data.files import one_line
from skill.recordings.column_table import ColumnChoice, select_columns, table_recordings
from skill.recordings.columns import FORCES, MOMENTS
from skill.recordings.recording import MAX_SAMPLES, Recording


def read_hdf5_file(path: Path) -> list[Recording]:
    """Reads the actions of a file; their phases are the skills, or the action itself where there is none."""
    try:
        with h5py.File(path, "r") as file:
            table = _table(file)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, ValueError, TypeError, KeyError, RuntimeError, MemoryError) as error:
        raise ValueError(f"{path}: not a complete HDF5 file of REASSEMBLE ({one_line(error)})") from error
    selection = select_columns(list(map(str, table)), str(path), ColumnChoice(["time=time:s"]))
    return table_recordings(table, selection, str(path), path.name, row_name=lambda row: f"sample {table.index[row]}")


def _table(file: h5py.File) -> pd.DataFrame:
    """The samples of all actions: time, wrench, trial and phase."""
    wrench = [_numbers(file, f"robot_state/measured_{name}", 3) for name in ("force", "torque")]
    time = _numbers(file, "timestamps/measured_force", 1)[:, 0]
    lengths = [len(time), *map(len, wrench)]
    if len(set(lengths)) > 1:
        raise ValueError(f"{lengths} times, forces and torques, expected as many of each")
    table = pd.DataFrame(np.hstack(wrench), columns=[*FORCES, *MOMENTS])
    table.insert(0, "time", time)
    trial, phase = np.full(len(time), -1), np.full(len(time), "", dtype=object)
    for number, action in _segments(file, "segments_info"):
        inside = _inside(action, time)
        trial[inside], phase[inside] = number, action["text"].asstr()[()]
        for _, skill in _segments(action, "low_level"):
            phase[inside & _inside(skill, time)] = skill["text"].asstr()[()]
    return table.assign(trial=trial, phase=phase)[trial >= 0]


def _numbers(file: h5py.File, name: str, width: int) -> Array:
    """An array of numbers, shape (n, width)."""
    data = file.get(name)
    if not isinstance(data, h5py.Dataset):
        raise ValueError(f"no array '{name}'")
    if data.dtype.kind not in "fiu" or data.ndim == 0 or data.shape not in {(len(data),), (len(data), width)}:
        raise ValueError(f"'{name}' has type {data.dtype} and shape {data.shape}, expected numbers (n, {width})")
    if len(data) > MAX_SAMPLES:
        raise ValueError(f"'{name}' has {len(data)} samples, expected at most {MAX_SAMPLES}")
    return np.asarray(data[()], dtype=float).reshape(-1, width)


def _segments(group: h5py.Group, name: str) -> Iterator[tuple[int, h5py.Group]]:
    """The numbered parts of a group; none if it is missing."""
    return ((int(number), part) for number, part in group.get(name, {}).items())


def _inside(segment: h5py.Group, time: Array) -> NDArray[np.bool_]:
    """Which samples are within a segment, shape (n,)."""
    return (float(segment["start"][()]) <= time) & (time < float(segment["end"][()]))
