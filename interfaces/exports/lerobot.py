"""Writes data sets of LeRobot, version 3.0, with PyArrow alone, and makes the recordings in them again.

The format: `meta/info.json` describes the features; `data/chunk-000/file-000.parquet` and so on hold their frames, one
file an episode; `meta/episodes` has a row an episode, `meta/tasks.parquet` the tasks, and `meta/stats.json` the
statistics. `meta/haptic_skill.json` and the columns ``haptic_skill/...`` of the episodes are this project's: they say
what is needed to make the recordings again. For that only the feature ``recording``, in 64 bits, and the headers of the
episodes are read: what another program changes in the other features does not come back.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from interfaces.exports.episodes import DEMONSTRATIONS, RUNS, Episode, Feature
from skill.arrays import Array
from skill.data.demonstration import COLUMNS, FORMAT_VERSION, read_demonstration
from skill.data.files import MAX_LENGTH, one_line, parse_object, read_bounded
from skill.data.rig_run import RUN_COLUMNS, RUN_VERSION, read_rig_run
from skill.data.tables import write_table
from skill.recordings.parquet_file import open_parquet, read_columns

ABOUT = "meta/haptic_skill.json"
HEADER, NAME, OUTCOME = "haptic_skill/header", "haptic_skill/name", "haptic_skill/outcome"
"""Columns of the episodes: the header of a recording as JSON, the name of its file, and its outcome."""

ABOUT_VERSION = 1
VERSION = "v3.0"
TASK = "insert the peg into the hole"
DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
CHUNK_FILES, FILE_MEGABYTES, VIDEO_MEGABYTES = 1000, 100, 200

FRAME_FEATURES = {
    "timestamp": Feature("float32"),
    **{name: Feature("int64") for name in ("frame_index", "episode_index", "index", "task_index")},
}
"""The features that every data set has."""

HEADERS = {"episode_index": pa.int64(), NAME: None, HEADER: None}
"""The columns of the episodes that are read, and their types; other programs have several for texts."""


class RecordingFile(NamedTuple):
    """How the file of a recording is made: its kind, version and columns, and the function that reads it."""

    kind: str
    version: int
    columns: tuple[str, ...]
    read: Callable[[Path], object]


RECORDINGS = {
    DEMONSTRATIONS: RecordingFile("demonstration", FORMAT_VERSION, COLUMNS, read_demonstration),
    RUNS: RecordingFile("rig_run", RUN_VERSION, RUN_COLUMNS, read_rig_run),
}
"""The files of the recordings, by the kind of the data set."""

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Statistics = Mapping[str, Array]
"""min, max, mean, std and quantiles of a feature, (d,) each, and the count of frames, (1,)."""


class LeRobotWriter:
    """Writes the episodes of a data set one by one.

    Args:
        folder: an empty folder.
        fps: frames per second.
        features: of the frames, by their keys, without ``FRAME_FEATURES``.
        robot: type of the robot.
    """

    def __init__(self, folder: Path, *, fps: int, features: Mapping[str, Feature], robot: str) -> None:
        self._folder, self._fps, self._robot = folder, fps, robot
        self._features = {**features, **FRAME_FEATURES}
        self._schema = pa.schema([(key, _arrow_type(feature)) for key, feature in self._features.items()])
        self._rows: list[dict[str, Any]] = []
        self._statistics: dict[str, list[Statistics]] = {key: [] for key in self._features}
        self._frames = 0

    def add(self, episode: Episode) -> None:
        """Writes the frames of an episode.

        Raises:
            OSError: if they cannot be written.
        """
        number, length = len(self._rows), len(episode)
        frames = np.arange(length)
        columns = {
            **episode.columns,
            "timestamp": (frames / self._fps).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(length, number),
            "index": self._frames + frames,
            "task_index": np.zeros(length, dtype=np.int64),
        }
        table = pa.Table.from_arrays([_arrow_array(columns[f.name], f.type) for f in self._schema], schema=self._schema)
        chunk, file = divmod(number, CHUNK_FILES)
        self._write_table(DATA_PATH.format(chunk_index=chunk, file_index=file), table)
        row = {
            "episode_index": number,
            "tasks": [TASK],
            "length": length,
            "data/chunk_index": chunk,
            "data/file_index": file,
            "dataset_from_index": self._frames,
            "dataset_to_index": self._frames + length,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
            NAME: episode.name,
            OUTCOME: episode.outcome,
            HEADER: json.dumps(dict(episode.header)),
        }
        for key in self._features:
            found = feature_statistics(columns[key])
            self._statistics[key].append(found)
            row |= {f"stats/{key}/{name}": values.tolist() for name, values in found.items()}
        self._rows.append(row)
        self._frames += length

    def finish(self, about: Mapping[str, Any]) -> None:
        """Writes the descriptions; ``about`` is added to `ABOUT`.

        Raises:
            OSError: if they cannot be written.
        """
        self._write_table("meta/episodes/chunk-000/file-000.parquet", pa.Table.from_pylist(self._rows))
        tasks = pd.DataFrame({"task_index": [0]}, index=pd.Index([TASK], name="task"))
        tasks.to_parquet(self._folder / "meta" / "tasks.parquet")
        joined = {key: joined_statistics(parts) for key, parts in self._statistics.items()}
        statistics = {key: {name: v.tolist() for name, v in found.items()} for key, found in joined.items()}
        self._write_json("meta/stats.json", statistics)
        self._write_json("meta/info.json", self._info())
        described = {
            key: {"units": list(f.units), "meaning": f.frame, "labels": [str(label) for label in f.labels]}
            for key, f in self._features.items()
            if f.frame
        }
        files = sorted(path.relative_to(self._folder).as_posix() for path in self._folder.rglob("*") if path.is_file())
        content = {"format_version": ABOUT_VERSION, **about, "features": described, "files": [*files, ABOUT]}
        self._write_json(ABOUT, content)

    def _write_table(self, name: str, table: pa.Table) -> None:
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, path, row_group_size=max(1, len(table)), write_page_checksum=True)

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": self._robot,
            "total_episodes": len(self._rows),
            "total_frames": self._frames,
            "total_tasks": 1,
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": FILE_MEGABYTES,
            "video_files_size_in_mb": VIDEO_MEGABYTES,
            "fps": self._fps,
            "splits": {"train": f"0:{len(self._rows)}"},
            "data_path": DATA_PATH,
            "video_path": None,
            "features": {
                key: {"dtype": f.dtype, "shape": [f.width], "names": list(f.names) or None}
                for key, f in self._features.items()
            },
        }

    def _write_json(self, name: str, content: Mapping[str, Any]) -> None:
        (self._folder / name).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


@dataclass(frozen=True)
class StoredRecording:
    """A recording in a data set.

    Attributes:
        name: of its file.
        samples: its columns, (n, d), as they were recorded.
        header: its other content.
        where: the episode, for messages.
    """

    name: str
    samples: pd.DataFrame
    header: dict[str, Any]
    where: str


def dataset_files(folder: Path) -> set[str] | None:
    """Returns the files of which a data set consists, relative to its folder; None if this project did not write it."""
    try:
        files = parse_object(read_bounded(folder / ABOUT, MAX_LENGTH))["files"]
    except (OSError, ValueError, KeyError):
        return None
    return {str(name) for name in files} if isinstance(files, list) else None


def read_dataset(folder: Path) -> tuple[str, list[StoredRecording]]:
    """Returns the kind of a data set, and its recordings by the number of the episode.

    Raises:
        ValueError: if a file is missing or damaged, or the data set lacks what `haptic-skill export lerobot` adds. The
            message names the file and what is missing.
    """
    info = _object(folder / "meta" / "info.json", "a data set of LeRobot")
    if info.get("codebase_version") != VERSION:
        raise ValueError(f"{folder}: version {info.get('codebase_version')!r:.40} of the format, expected {VERSION}")
    about = _object(
        folder / ABOUT,
        "a data set that 'haptic-skill export lerobot' wrote"
        " (to discover contact states in another one: haptic-skill states FOLDER)",
    )
    kind = about.get("kind")
    if about.get("format_version") != ABOUT_VERSION or kind not in RECORDINGS:
        raise ValueError(f"{folder / ABOUT}: version {about.get('format_version')!r:.20}, kind {kind!r:.40}; expected"
                         f" version {ABOUT_VERSION} and {' or '.join(RECORDINGS)}")  # fmt: skip
    columns = RECORDINGS[kind].columns
    try:
        names = info["features"]["recording"]["names"]
    except (KeyError, TypeError):
        names = None
    if names != list(columns):
        raise ValueError(f"{folder}: the feature 'recording' has the columns {names!r:.60}, expected {list(columns)}")
    headers = pd.concat([t.to_pandas() for t in _tables(folder, "meta/episodes", HEADERS)]).sort_values("episode_index")
    return kind, list(_recordings(folder, kind, headers))


def write_recording(stored: StoredRecording, kind: str, path: Path) -> None:
    """Writes a recording as the file that it was, and reads it back.

    Raises:
        ValueError: if it is no valid recording. The message names the episode.
        OSError: if it cannot be written.
    """
    file = RECORDINGS[kind]
    try:
        write_table(stored.samples, file.columns, path, kind=file.kind, version=file.version, header=stored.header)
        file.read(path)
    except ValueError as error:
        raise ValueError(f"{stored.where}: {str(error).replace(f'{path}: ', '')}") from error


def _recordings(folder: Path, kind: str, headers: pd.DataFrame) -> Iterator[StoredRecording]:
    columns = RECORDINGS[kind].columns
    numbered = {"episode_index": pa.int64(), "frame_index": pa.int64()}
    tables = _tables(folder, "data", {**numbered, "recording": pa.list_(pa.float64(), len(columns))})
    numbers, frames = (np.concatenate([table[name].to_numpy() for table in tables]) for name in numbered)
    values = np.concatenate([table["recording"].combine_chunks().flatten().to_numpy() for table in tables])
    found = headers["episode_index"].tolist()
    if found != list(range(len(found))) or set(numbers.tolist()) != set(found):
        raise ValueError(f"{folder}: the episodes of meta and data differ; expected the numbers 0 to {len(found) - 1}")
    seen: set[str] = set()
    for number, name, text in zip(found, headers[NAME], headers[HEADER], strict=True):
        where = f"{folder}: episode {number}"
        rows = np.flatnonzero(numbers == number)
        if frames[rows].tolist() != list(range(len(rows))):
            expected = f"expected frame_index 0 to {len(rows) - 1} in this order"
            raise ValueError(f"{where}: frames are missing, occur twice or are out of order; {expected}")
        try:
            header = parse_object(str(text))
            if kind == DEMONSTRATIONS:
                header |= header.pop("metadata")
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{where}: damaged {HEADER} ({one_line(error)})") from error
        if not _is_file_name(name) or name in seen:
            raise ValueError(f"{where}: {NAME} is {name!r:.60}, expected the name of a file *.parquet, each once")
        seen.add(name)
        samples = pd.DataFrame(values.reshape(-1, len(columns))[rows], columns=list(columns))
        yield StoredRecording(name, samples, header, where)


def _is_file_name(name: object) -> bool:
    """Whether this is a printable name of a Parquet file, without a folder."""
    return isinstance(name, str) and name.isprintable() and Path(name).suffix == ".parquet" and Path(name).name == name


def _tables(folder: Path, part: str, types: Mapping[str, pa.DataType | None]) -> list[pa.Table]:
    """Some columns of the files of a part of a data set, with a value in each row; None stands for any type."""
    paths = sorted((folder / part).glob("chunk-*/*.parquet"))
    if not paths:
        raise ValueError(f"{folder}: no files {part}/chunk-*/*.parquet")
    tables = [read_columns(open_parquet(path), list(types), path) for path in paths]
    for path, table in zip(paths, tables, strict=True):
        for name, kind in types.items():
            column = table[name]
            if column.null_count or kind not in (None, column.type):
                found = f"'{name}' has type {column.type} and is empty in {column.null_count} rows"
                raise ValueError(f"{path}: {found}, expected {kind or 'a text'} in each row")
    return tables


def _object(path: Path, expected: str) -> dict[str, Any]:
    try:
        return parse_object(read_bounded(path, MAX_LENGTH))
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; expected {expected}") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: damaged ({one_line(error)})") from error


def feature_statistics(values: NDArray[Any]) -> Statistics:
    """Returns the statistics of a feature over the frames of an episode, (n,) or (n, d)."""
    rows = values.reshape(len(values), -1).astype(float)
    quantiles = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": np.array([len(rows)]),
        **dict(zip(QUANTILES, quantiles, strict=True)),
    }


def joined_statistics(parts: Sequence[Statistics]) -> Statistics:
    """Returns the statistics of a feature over all episodes.

    All are exact, except the quantiles: they are means of those of the episodes, weighted by the frames, as LeRobot
    computes them.
    """
    joined = {name: np.stack([part[name] for part in parts]) for name in parts[0]}
    count = joined["count"]
    total = count.sum(axis=0)

    def mean(values: Array) -> Array:
        return np.asarray((values * count).sum(axis=0) / total)

    middle = mean(joined["mean"])
    return {
        "min": joined["min"].min(axis=0),
        "max": joined["max"].max(axis=0),
        "mean": middle,
        "std": np.sqrt(mean(joined["std"] ** 2 + (joined["mean"] - middle) ** 2)),
        "count": total,
        **{name: mean(joined[name]) for name in QUANTILES},
    }


def _arrow_type(feature: Feature) -> pa.DataType:
    number = {"float32": pa.float32(), "float64": pa.float64(), "int64": pa.int64(), "bool": pa.bool_()}[feature.dtype]
    return pa.list_(number, feature.width) if feature.names else number


def _arrow_array(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    if not pa.types.is_fixed_size_list(kind):
        return pa.array(values, kind)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1), kind.value_type), kind.list_size)
