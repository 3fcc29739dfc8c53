"""Reads recordings from data sets of LeRobot, versions 2.1 and 3.0: one recording an episode.

The format: `meta/info.json` describes the features and says how many episodes and frames there are; the Parquet files
below `data` hold the frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from skill.arrays import Array
from skill.data.files import MAX_LENGTH, no_access, one_line, parse_object, read_bounded
from skill.recordings.column_table import ColumnChoice, Selection, check_length, select_columns, table_recordings
from skill.recordings.columns import FORCES, MOMENTS, PHASE_COLUMNS, channel_of, label_column, listed
from skill.recordings.parquet_file import open_parquet, plain_column, read_columns
from skill.recordings.recording import MAX_SAMPLES, Recording

FEATURES = ("observation.wrench", "observation.environment_state", "observation.state")
"""Features in which the channels are looked for, in this order."""

VERSIONS = ("v2.1", "v3.0")
MAX_FILES = 10_000
MAX_WIDTH = 1000
"""Largest number of numbers of a feature in one frame."""

_EPISODE, _FRAME = "episode_index", "frame_index"


def read_lerobot_folder(
    path: Path, *, feature: str | None = None, columns: Iterable[str] = (), phase_column: str | None = None
) -> list[Recording]:
    """Reads the episodes of a data set.

    The channels are the ``names`` of the feature. An ``observation.wrench`` of six numbers without names is
    fx fy fz mx my mz; the numbers of another feature without names are called "0", "1" and so on. The time is
    ``frame_index / fps``, because time stamps in 32 bits are too coarse for long episodes. The options are those of
    `skill.recordings.reading.read_recordings`; without a feature, it is the first of ``FEATURES`` with forces. The
    numbers of episodes and frames must be those that the data set declares.
    """
    path = Path(path)
    info = _info(path / "meta" / "info.json")
    features, fps = info["features"], float(info["fps"])
    choices = list(columns)
    feature, names = _feature(path, features, feature, choices)
    phase = label_column([n for n in features if n not in FEATURES], phase_column, PHASE_COLUMNS, str(path))
    selection = select_columns(["time", *names], str(path), ColumnChoice([*choices, "time=time:s"]))
    parts = sorted((path / "data").glob("chunk-*/*.parquet"))
    if not 0 < len(parts) <= MAX_FILES:
        raise ValueError(f"{path}: {len(parts)} files data/chunk-*/*.parquet, expected 1 to {MAX_FILES}")
    tables: list[pd.DataFrame] = []
    for part in parts:
        tables.append(_part(part, feature, names, phase, fps))
        check_length(sum(map(len, tables)), str(path))
    table = pd.concat(tables, ignore_index=True)
    _check_totals(path, info, table[_EPISODE])
    return table_recordings(
        table,
        Selection(selection.columns, _EPISODE, phase),
        str(path),
        path.resolve().name,
        row_name="frame {} of the data set".format,
    )


def _info(path: Path) -> dict[str, Any]:
    """What a data set says of itself; its version, features and frames per second are checked."""
    try:
        info = parse_object(read_bounded(path, MAX_LENGTH))
    except (FileNotFoundError, PermissionError) as error:
        raise ValueError(f"{path}: {no_access(error)}; expected a data set of LeRobot") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: damaged ({one_line(error)})") from error
    version, fps, features = info.get("codebase_version"), info.get("fps"), info.get("features")
    if version not in VERSIONS:
        raise ValueError(f"{path}: version {version!r:.40} of the format, expected {' or '.join(VERSIONS)}")
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps < 1e6:
        raise ValueError(f"{path}: fps is {fps!r:.40}, expected a positive number")
    if not isinstance(features, dict) or not all(isinstance(f, dict) for f in features.values()):
        raise ValueError(f"{path}: 'features' is no object of objects")
    return info


def _check_totals(path: Path, info: dict[str, Any], episodes: pd.Series) -> None:
    """Refuses a data set that has not the episodes and frames that it declares; ``episodes`` has that of each frame."""
    found = set(episodes.dropna().astype(int))
    for what, count in (("episodes", len(found)), ("frames", len(episodes))):
        declared = info.get(f"total_{what}", count)
        if declared != count:
            first = range(min(declared, MAX_SAMPLES)) if type(declared) is int else range(0)
            missing = [str(k) for k in first if k not in found] if what == "episodes" else []
            raise ValueError(
                f"{path}: {count} {what} in the data, but meta/info.json declares {declared!r:.40}"
                + (f"; missing: {listed(missing)}" if missing else "")
            )


def _feature(
    path: Path, features: dict[str, dict[str, Any]], wanted: str | None, choices: Sequence[str]
) -> tuple[str, list[str]]:
    """The feature to read, by default the first usual one with forces or a column of the user, and its names."""
    if wanted is not None and wanted not in features:
        raise ValueError(f"{path}: no feature '{wanted}'; features are {listed(list(features))}")
    said = {part for text in choices for part in (text.partition("=")[2], text.partition("=")[2].rpartition(":")[0])}
    for name in FEATURES if wanted is None else (wanted,):
        names = _names(path, name, features[name]) if name in features else []
        if wanted or any(channel_of(column) in FORCES or column in said for column in names):
            return name, names
    raise ValueError(f"{path}: no feature with forces; features are {listed(list(features))}; say which one")


def _names(path: Path, name: str, feature: dict[str, Any]) -> list[str]:
    """The names of the numbers of a feature."""
    shape, names = feature.get("shape"), feature.get("names")
    if not (isinstance(shape, list) and len(shape) == 1 and type(shape[0]) is int and 0 < shape[0] <= MAX_WIDTH):
        raise ValueError(f"{path}: feature '{name}' has shape {shape!r:.40}, expected one dimension")
    if isinstance(names, dict) and len(names) == 1:  # such as {"axes": [...]}
        [names] = names.values()
    if names is None:
        wrench = name == "observation.wrench" and shape[0] == 6
        return [*FORCES, *MOMENTS] if wrench else [str(k) for k in range(shape[0])]
    if not isinstance(names, list) or len(names) != shape[0] or not all(isinstance(n, str) for n in names):
        raise ValueError(f"{path}: feature '{name}' has names {names!r:.60}, expected {shape[0]} texts")
    if "time" in names:
        raise ValueError(f"{path}: feature '{name}' has a number called 'time', which is taken")
    return list(names)


def _part(path: Path, feature: str, names: list[str], phase: str | None, fps: float) -> pd.DataFrame:
    """The frames of one Parquet file as a table of the time, the numbers of the feature, episode and phase."""
    labels = [_EPISODE] if phase in (None, _EPISODE) else [_EPISODE, phase]
    rows = read_columns(open_parquet(path), list(dict.fromkeys([feature, _FRAME, *labels])), path)

    def column(name: str) -> pd.Series:
        return plain_column(rows[name], f"{path}: column '{name}'", number=name in (_FRAME, _EPISODE))

    table = pd.DataFrame(_numbers(rows[feature], len(names), feature, path), columns=names)
    table.insert(0, "time", column(_FRAME).to_numpy(dtype=float) / fps)
    return table.assign(**{label: column(label).to_numpy() for label in labels})


def _numbers(column: pa.ChunkedArray, width: int, name: str, path: Path) -> Array:
    """A column of lists of numbers as an array of shape (n, width)."""
    kind = column.type
    lists = pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind) or pa.types.is_large_list(kind)
    value = kind.value_type if lists else kind
    if not (pa.types.is_floating(value) or pa.types.is_integer(value)) or (not lists and width > 1):
        raise ValueError(f"{path}: column '{name}' has type {kind}, expected lists of {width} numbers")
    flat = column.combine_chunks()
    if lists:
        lengths = set(flat.value_lengths().to_pylist()) if len(flat) else set()
        if lengths - {width}:
            raise ValueError(
                f"{path}: column '{name}' has lists of {sorted(map(str, lengths))} numbers, expected {width}"
            )
        flat = flat.flatten()
    return np.asarray(flat.to_numpy(zero_copy_only=False), dtype=float).reshape(-1, width)
