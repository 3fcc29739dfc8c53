"""Writes data sets of LeRobot, version 3.0, with PyArrow alone.

The format: `meta/info.json` describes the features; `data/chunk-000/file-000.parquet` and so on hold their frames, one
row group an episode; `meta/episodes` has a row an episode, `meta/tasks.parquet` the tasks, and `meta/stats.json` the
statistics. `meta/haptic_skill.json` and the columns ``haptic_skill/...`` of the episodes are this project's: they say
what is needed to make the recordings again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from interfaces.exports.episodes import Episode, Feature
from interfaces.exports.statistics import Statistics, as_lists, feature_statistics, joined_statistics

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
        self._frames = self._file = self._size = 0
        self._writer: pq.ParquetWriter | None = None

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
        chunk, file = self._write(table)
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
            row |= {f"stats/{key}/{name}": values for name, values in as_lists(found).items()}
        self._rows.append(row)
        self._frames += length

    def finish(self, about: Mapping[str, Any]) -> None:
        """Writes the descriptions; ``about`` is added to `ABOUT`.

        Raises:
            OSError: if they cannot be written.
        """
        if self._writer is not None:
            self._writer.close()
        episodes = self._folder / "meta" / "episodes" / "chunk-000"
        episodes.mkdir(parents=True)
        pq.write_table(pa.Table.from_pylist(self._rows), episodes / "file-000.parquet", write_page_checksum=True)
        tasks = pd.DataFrame({"task_index": [0]}, index=pd.Index([TASK], name="task"))
        tasks.to_parquet(self._folder / "meta" / "tasks.parquet")
        statistics = {key: as_lists(joined_statistics(parts)) for key, parts in self._statistics.items()}
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

    def _write(self, table: pa.Table) -> tuple[int, int]:
        """Appends a row group to the present file, or to the next one if that is full; returns chunk and file."""
        if self._writer is not None and self._size + table.nbytes > FILE_MEGABYTES * 2**20:
            self._writer.close()
            self._writer, self._size, self._file = None, 0, self._file + 1
        chunk, file = divmod(self._file, CHUNK_FILES)
        if self._writer is None:
            path = self._folder / DATA_PATH.format(chunk_index=chunk, file_index=file)
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, self._schema, write_page_checksum=True)
        self._writer.write_table(table, row_group_size=len(table))
        self._size += table.nbytes
        return chunk, file

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


def _arrow_type(feature: Feature) -> pa.DataType:
    number = {"float32": pa.float32(), "float64": pa.float64(), "int64": pa.int64(), "bool": pa.bool_()}[feature.dtype]
    return pa.list_(number, feature.width) if feature.names else number


def _arrow_array(values: NDArray[Any], kind: pa.DataType) -> pa.Array:
    if not pa.types.is_fixed_size_list(kind):
        return pa.array(values, kind)
    return pa.FixedSizeListArray.from_arrays(pa.array(values.reshape(-1), kind.value_type), kind.list_size)
