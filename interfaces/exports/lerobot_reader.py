"""Makes recordings and runs again from a data set of LeRobot that this project wrote.

Only the feature ``recording``, in 64 bits, and the headers of the episodes are read: what another program changes in
the other features does not come back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from interfaces.exports import demonstration_episodes, run_episodes
from interfaces.exports.lerobot_writer import ABOUT, ABOUT_VERSION, HEADER, NAME, VERSION
from skill.arrays import Array
from skill.data.demonstration import Demonstration, read_demonstration, write_demonstration
from skill.data.files import MAX_LENGTH, one_line, parse_object, read_bounded
from skill.data.outcome import parse_outcome
from skill.data.rig_run import RigRun, read_rig_run, write_rig_run
from skill.recordings.parquet_file import read_columns

KINDS = (demonstration_episodes.KIND, run_episodes.KIND)
KEYS = {demonstration_episodes.KIND: ("good", "outcome", "metadata"), run_episodes.KIND: ("result", "metadata")}
"""What the header of an episode holds, by the kind of the data set."""


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


@dataclass(frozen=True)
class StoredSet:
    """The recordings of a data set.

    Attributes:
        kind: one of ``KINDS``.
        recordings: by the number of the episode.
    """

    kind: str
    recordings: list[StoredRecording]


def dataset_files(folder: Path) -> set[str] | None:
    """Returns the files of which a data set consists, relative to its folder; None if this project did not write it."""
    try:
        files = parse_object(read_bounded(folder / ABOUT, MAX_LENGTH))["files"]
    except (OSError, ValueError, KeyError):
        return None
    return {str(name) for name in files} if isinstance(files, list) else None


def read_dataset(folder: Path) -> StoredSet:
    """Reads the recordings of a data set.

    Raises:
        ValueError: if a file is missing or damaged, or the data set lacks what `haptic-skill export lerobot` adds. The
            message names the file and what is missing.
    """
    info = _object(folder / "meta" / "info.json", "; expected a data set of LeRobot")
    features = info.get("features")
    features = features if isinstance(features, dict) else {}
    if info.get("codebase_version") != VERSION:
        raise ValueError(f"{folder}: version {info.get('codebase_version')!r:.40} of the format, expected {VERSION}")
    about = _object(folder / ABOUT, "") if (folder / ABOUT).exists() else None
    episodes = sorted((folder / "meta" / "episodes").glob("chunk-*/*.parquet"))
    tables = [_episodes(path) for path in episodes]
    missing = [
        *([] if about is not None else [f"the file {ABOUT}"]),
        *([] if "recording" in features else ["the feature 'recording'"]),
        *([] if tables and all(table is not None for table in tables) else [f"{NAME} and {HEADER} of the episodes"]),
    ]
    if about is None or missing:
        raise ValueError(
            f"{folder}: lacks {', '.join(missing)}; expected a data set that 'haptic-skill export lerobot' wrote"
            " (to discover contact states in another one: haptic-skill states FOLDER)"
        )
    kind, names = about.get("kind"), features["recording"].get("names")
    if about.get("format_version") != ABOUT_VERSION or kind not in KINDS:
        raise ValueError(f"{folder / ABOUT}: version {about.get('format_version')!r:.20}, kind {kind!r:.40}; expected"
                         f" version {ABOUT_VERSION} and {' or '.join(KINDS)}")  # fmt: skip
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{folder}: the feature 'recording' has no names of columns")
    headers = pd.concat([table for table in tables if table is not None]).sort_values("episode_index")
    return StoredSet(kind, list(_recordings(folder, kind, names, headers)))


def write_recording(stored: StoredRecording, kind: str, path: Path) -> None:
    """Writes a recording as the file that it was, and reads it back.

    Raises:
        ValueError: if it is no valid recording. The message names the episode.
        OSError: if it cannot be written.
    """
    header, metadata = stored.header, stored.header["metadata"]
    try:
        if kind == run_episodes.KIND:
            write_rig_run(RigRun(stored.samples, header["result"], metadata), path)
            read_rig_run(path)
        else:
            outcome, detail = parse_outcome(str(header["outcome"]))
            write_demonstration(Demonstration(stored.samples, header["good"], outcome, metadata, detail), path)
            read_demonstration(path)
    except ValueError as error:
        raise ValueError(f"{stored.where}: {str(error).replace(f'{path}: ', '')}") from error


def _recordings(folder: Path, kind: str, names: list[str], headers: pd.DataFrame) -> Iterator[StoredRecording]:
    numbers, frames, values = _frames(folder, len(names))
    found = headers["episode_index"].tolist()
    if found != list(range(len(found))) or set(numbers.tolist()) != set(found):
        raise ValueError(f"{folder}: the episodes of meta and data differ; expected the numbers 0 to {len(found) - 1}")
    seen: set[str] = set()
    for number, name, text in zip(found, headers[NAME], headers[HEADER], strict=True):
        where = f"{folder}: episode {number}"
        rows = np.flatnonzero(numbers == number)
        rows = rows[np.argsort(frames[rows], kind="stable")]
        if frames[rows].tolist() != list(range(len(rows))):
            raise ValueError(f"{where}: frames are missing or occur twice; expected frame_index 0 to {len(rows) - 1}")
        try:
            header = parse_object(str(text))
        except ValueError as error:
            raise ValueError(f"{where}: damaged {HEADER} ({one_line(error)})") from error
        lacking = [key for key in KEYS[kind] if key not in header]
        if lacking or not isinstance(header["metadata"], dict):
            raise ValueError(f"{where}: {HEADER} lacks {lacking or 'metadata'}; expected that of {kind}")
        if not (isinstance(name, str) and name.endswith(".parquet") and Path(name).name == name and name not in seen):
            raise ValueError(f"{where}: {NAME} is {name!r:.60}, expected the name of a file *.parquet, each once")
        seen.add(name)
        yield StoredRecording(name, pd.DataFrame(values[rows], columns=names), header, where)


def _frames(folder: Path, width: int) -> tuple[Array, Array, Array]:
    """Episode (N,), frame (N,) and columns (N, width) of all frames."""
    parts = sorted((folder / "data").glob("chunk-*/*.parquet"))
    if not parts:
        raise ValueError(f"{folder}: no files data/chunk-*/*.parquet")
    tables = [read_columns(p, lambda _: ["episode_index", "frame_index", "recording"], width=width) for p in parts]
    for path, table in zip(parts, tables, strict=True):
        kind = table.schema.field("recording").type
        if not pa.types.is_fixed_size_list(kind) or kind != pa.list_(pa.float64(), width):
            raise ValueError(f"{path}: 'recording' has type {kind}, expected {width} numbers of 64 bits")
    numbers, frames = (
        np.concatenate([table[name].to_numpy() for table in tables]) for name in ("episode_index", "frame_index")
    )
    values = np.concatenate([table["recording"].combine_chunks().flatten().to_numpy() for table in tables])
    return numbers, frames, values.reshape(-1, width)


def _episodes(path: Path) -> pd.DataFrame | None:
    """Numbers, names and headers of episodes; None if they have no names or headers."""
    lacks: list[str] = []

    def choose(schema: pa.Schema) -> list[str]:
        lacks.extend(name for name in (NAME, HEADER) if name not in schema.names)
        return ["episode_index", *(name for name in (NAME, HEADER) if name in schema.names)]

    table: pd.DataFrame = read_columns(path, choose).to_pandas()
    return None if lacks else table.astype({NAME: object, HEADER: object})


def _object(path: Path, expected: str) -> dict[str, Any]:
    try:
        return parse_object(read_bounded(path, MAX_LENGTH))
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file{expected}") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: damaged ({one_line(error)})") from error
