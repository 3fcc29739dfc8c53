"""Reads recordings from a file or folder of any kind that is known."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from skill.recordings.column_table import ColumnChoice
from skill.recordings.csv_file import read_csv_file
from skill.recordings.npz_file import read_npz_file
from skill.recordings.recording import Recording
from skill.recordings.text_numbers import DECIMALS

TEXTS = (".csv", ".tsv", ".txt", ".dat", ".asc", ".log", ".lvm")
TABLES = (*TEXTS, ".parquet", ".pq", ".npz")
BAGS = (".mcap", ".db3", ".bag")
"""Endings of the names of texts, of all tables, and of bags of ROS."""


def read_recordings(
    path: Path | str,
    *,
    columns: Iterable[str] = (),
    trial_column: str | None = None,
    phase_column: str | None = None,
    topic: str | None = None,
    feature: str | None = None,
    sampling_rate: float | None = None,
    decimal: str | None = None,
) -> list[Recording]:
    """Reads all recordings of a file or folder.

    A table (CSV, Parquet, NPZ) is one recording, or one for each trial if it has a column of trials. A bag of
    ROS 1 or ROS 2, a file or a folder of its parts, is one recording. A data set of LeRobot is one recording for each
    episode.

    Args:
        path: file (``.csv .tsv .txt .parquet .pq .npz .mcap .db3 .bag``), or folder of a LeRobot data set or a bag.
        columns: list of texts "channel=column" or "channel=column:unit", such as "fx=ati_force_x:N". Columns with usual
            names need none. See `skill.recordings.columns`. In a text, a column may be said by its number, from 1, and
            a text without names gets all of them in one, such as "time,fx,fy,fz". For messages, "time=log_time" takes
            the time of logging.
        trial_column: column that says to which trial a row of a table belongs; None for one with a usual name, ""
            for none.
        phase_column: column of a table or a data set with the phase of each row; None for one with a usual name,
            "" for none.
        topic: topic of a bag; None for its only one of the type WrenchStamped.
        feature: feature of a data set of LeRobot; None for the usual one.
        sampling_rate: rate of the rows of a text without a time, Hz.
        decimal: "." or ",", the decimal sign of a text; None where its numbers leave no doubt.

    Returns:
        The recordings, at least one, in SI units.

    Raises:
        ValueError: if the file is missing, of an unknown kind, damaged or too large, if an option does not fit its
            kind, or if its content is no valid recording. The message names the file.
    """
    path = Path(path)
    if isinstance(columns, str):
        raise ValueError(f"{path}: columns '{columns}', expected a list of texts such as fx=force_1:N")
    columns = list(columns)
    options: dict[str, Any] = {"columns": columns, "trial_column": trial_column, "phase_column": phase_column}
    options |= {"topic": topic, "feature": feature, "sampling_rate": sampling_rate, "decimal": decimal}
    if sampling_rate is not None and not (math.isfinite(sampling_rate) and sampling_rate > 0):
        raise ValueError(f"{path}: a sampling rate of {sampling_rate}, expected a positive number of Hz")
    if decimal not in (None, *DECIMALS):
        raise ValueError(f"{path}: the decimal sign '{decimal}', expected '.' or ','")
    try:
        return _read(path, options)
    except ValueError as error:
        if str(path) in str(error):
            raise
        # A recording knows the name of its file, not the folder.
        raise ValueError(f"{path}{str(error).removeprefix(path.name)}") from error


def _read(path: Path, options: Mapping[str, Any]) -> list[Recording]:
    """Reads the recordings with the options of `read_recordings`."""
    suffix = path.suffix.lower()
    if path.is_dir() and (path / "meta" / "info.json").is_file():
        from skill.recordings.lerobot_folder import read_lerobot_folder  # needs an extra

        allowed = {"columns", "phase_column", "feature"}
        return read_lerobot_folder(path, **_chosen(path, options, allowed, "a data set of LeRobot"))
    if path.is_dir() and not any(file.name == "metadata.yaml" or file.suffix in BAGS for file in path.iterdir()):
        remedy = "; unpack its files with 'zstd -d' first" if any(path.glob("*.zstd")) else ""
        raise ValueError(f"{path}: a folder without meta/info.json (LeRobot) or {' '.join(BAGS)} (bags){remedy}")
    if path.is_dir() or suffix in BAGS:
        from skill.recordings.bag import read_bag  # needs an extra

        return read_bag(path, **_chosen(path, options, {"topic", "columns"}, "a bag"))
    if suffix in TABLES:
        text = suffix in TEXTS
        allowed = {"columns", "trial_column", "phase_column", *(("sampling_rate", "decimal") if text else ())}
        choice = ColumnChoice(**_chosen(path, options, allowed, "a text" if text else "a table"))
        if suffix in (".parquet", ".pq"):
            from skill.recordings.parquet_file import read_parquet_file  # needs an extra

            return read_parquet_file(path, choice)
        return (read_npz_file if suffix == ".npz" else read_csv_file)(path, choice)
    remedy = "; unpack it with 'zstd -d' first" if suffix in (".zst", ".zstd") else ""
    raise ValueError(f"{path}: ends in '{suffix}', expected {' '.join((*TABLES, *BAGS))} or a folder{remedy}")


def _chosen(path: Path, options: Mapping[str, Any], allowed: set[str], kind: str) -> dict[str, Any]:
    """Returns the options of a kind of file; refuses one that would have no effect."""
    idle = sorted(name for name, value in options.items() if value and name not in allowed)
    if idle:
        raise ValueError(f"{path}: {idle} cannot be chosen for {kind}; expected only {sorted(allowed)}")
    return {name: options[name] for name in sorted(allowed)}
