"""The folder of a live session: it holds live recordings and nothing else, and no command deletes them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.outputs.folder_lock import locked_folder
from experiments.outputs.output_checks import RECORDING_SIZE, check_folder, named_errors
from experiments.outputs.output_set import finish_replacement
from experiments.outputs.own_folder import remove_unfinished
from experiments.outputs.set_index import INDEX_NAME, LIVE, SetIndex, read_index


@contextmanager
def open_live_folder(folder: Path) -> Iterator[None]:
    """Holds a folder for a live session, after removing the unfinished files of one that was killed.

    The index says that the recordings are live; it does not list them, because all are kept.

    Raises:
        ValueError: if the folder holds another kind of set.
        OSError: if another process holds the folder, or it cannot be written.
    """
    check_folder(folder, size=RECORDING_SIZE)
    with locked_folder(folder):
        finish_replacement(folder)
        index = read_index(folder)
        if index is not None and index.kind is not LIVE:
            raise ValueError(f"{folder}: holds {index.kind.name}; choose another --out for live recordings")
        names = {path.name.rpartition(".")[0].removeprefix(".") for path in folder.glob(".*_live.parquet.*")}
        removed = remove_unfinished(folder, names)
        if removed:
            warnings.warn(
                f"{folder}: removed {len(removed)} unfinished file(s) of a killed session; finished ones are complete",
                stacklevel=3,
            )
        _mark(folder)
        try:
            yield
        finally:
            _mark(folder)


def _mark(folder: Path) -> None:
    """Writes the index of a folder that holds recordings."""
    if read_index(folder) is None and any(folder.glob("*.parquet")):
        with named_errors(folder / INDEX_NAME, "the recordings are complete"):
            SetIndex(LIVE, {}).write(folder)
