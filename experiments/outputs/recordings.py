"""Which files of a folder are its recordings: those that the index lists, or all."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from experiments.outputs.folder_lock import locked_folder
from experiments.outputs.output_set import READY, finish_replacement
from experiments.outputs.set_index import DEMONSTRATIONS, LIVE, read_index


@dataclass(frozen=True)
class Recordings:
    """The recordings in a folder.

    Attributes:
        paths: of the recordings, in the order of their names.
        note: what is not read or missing, for the person who trains; empty if there is nothing to say.
    """

    paths: list[Path]
    note: str = ""


def find_recordings(folder: Path) -> Recordings:
    """Returns the recordings of a folder: those that its index lists, or every ``*.parquet`` if there is no index.

    Raises:
        ValueError: if there is none, the index is not valid, or the folder holds something else.
        OSError: if an interrupted replacement of the set cannot be finished.
    """
    if os.path.lexists(folder / READY):
        with locked_folder(folder):
            finish_replacement(folder)
    index = read_index(folder)
    found = sorted(folder.glob("*.parquet"))
    note = ""
    if index is not None and index.kind not in (DEMONSTRATIONS, LIVE):
        raise ValueError(f"{folder}: holds {index.kind.name}; expected demonstrations")
    if index is not None and index.kind is DEMONSTRATIONS:
        listed = set(index.items)
        others = [path.name for path in found if path.name not in listed]
        found = [path for path in found if path.name in listed]
        notes = []
        if others:
            notes.append(f"{len(others)} files are not in its index and are not read: {', '.join(others[:3])}")
        if len(found) < len(listed):
            notes.append(f"{len(found)} of {len(listed)} demonstrations are there; record again to complete the set")
        note = f"{folder}: {'; '.join(notes)}" if notes else ""
    if not found:
        raise ValueError(f"{folder}: no demonstrations (*.parquet) found; record some first")
    return Recordings(found, note)
