"""Hidden folders of a set that is being made: recognised by their index, removed only if nothing else is there."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from experiments.outputs.folder_lock import LOCK_NAME
from experiments.outputs.set_index import INDEX_NAME, SetIndex, SetKind, read_index
from skill.data.tables import TEMPORARY_MARK


def remove_unfinished(folder: Path, names: Iterable[str]) -> list[Path]:
    """Removes the temporary files that a killed process left beside files with these names; returns their paths."""
    known = {*names, INDEX_NAME}
    removed = []
    for path in sorted(folder.glob(".*")):
        match = re.fullmatch(rf"\.(.+){re.escape(TEMPORARY_MARK)}[a-z0-9_]{{8}}", path.name)
        if match and match[1] in known and path.is_file():
            path.unlink()
            removed.append(path)
    return removed


def check_own_folder(folder: Path, kind: SetKind) -> SetIndex | None:
    """Checks that a folder, if there is one, is empty or holds a set of a kind, and nothing else; returns its index.

    Temporary files that a killed process left in it are removed.

    Raises:
        ValueError: if it holds another file, or is not a folder. The message names it.
    """
    if not os.path.lexists(folder):
        return None
    if folder.is_symlink() or not folder.is_dir():
        raise ValueError(f"{folder}: a name that this program needs for a folder; move it away")
    index = read_index(folder)
    if index is not None and index.kind is not kind:
        raise ValueError(f"{folder}: holds {index.kind.name}, not {kind.name}; move it away")
    names = set() if index is None else index.names
    remove_unfinished(folder, names)
    others = sorted({path.name for path in folder.iterdir()} - names - {INDEX_NAME, LOCK_NAME})
    if others:
        raise ValueError(
            f"{folder}: holds {others[0]}, which this program did not write there; move the folder or the file away"
        )
    return index


def remove_own_folder(folder: Path, kind: SetKind) -> None:
    """Removes a folder that passes `check_own_folder`; the index last, so that what an interruption leaves passes too.

    Raises:
        ValueError: see `check_own_folder`.
    """
    index = check_own_folder(folder, kind)
    if not folder.is_dir():
        return
    for name in [*(() if index is None else sorted(index.names)), LOCK_NAME, INDEX_NAME]:
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()
