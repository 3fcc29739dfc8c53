"""A folder that a command fills with the files of one request: continued, protected, or replaced as a whole.

A set that replaces another is made in the hidden folder `NEW` beside it. When all its items are there, the hidden
folder is renamed to `READY`: from then on the new set counts, and its files move into place. Whoever opens the folder
next finishes an interrupted move. So a process that is killed at any moment leaves the whole old set or the whole new
one.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from experiments.outputs.folder_lock import locked_folder
from experiments.outputs.output_checks import named_errors
from experiments.outputs.own_folder import check_own_folder, remove_own_folder, remove_unfinished
from experiments.outputs.set_index import DEMONSTRATIONS, INDEX_NAME, SetIndex, find_set, read_index
from skill.data.demonstration import read_demonstration

NEW, READY = ".new", ".ready"


class OutputSet:
    """A set whose folder this process holds; `open_set` makes it.

    Args:
        folder: of the set.
        place: where its files are written: ``folder``, or the hidden folder of a set that will replace another.
        index: of the set.

    Attributes:
        folder: of the set.
        finished: the items that were there already, read, by their names.
        damaged: names of items that were there and could not be read; they have to be made again.
    """

    def __init__(self, folder: Path, place: Path, index: SetIndex) -> None:
        self.folder = folder
        self._place, self._index = place, index
        self._is_written = read_index(place) == index
        self.finished: dict[str, Any] = {}
        self.damaged: list[str] = []
        for name in index.finished(place) if self._is_written else []:
            try:
                self.finished[name] = index.kind.read(place / name)
            except ValueError:
                self.damaged.append(name)

    def write(self, name: str, write: Callable[[Path], object]) -> None:
        """Writes one file of the set; ``write`` gets its path.

        Raises:
            OSError: if it cannot be written. The message names the file and what is kept.
        """
        path = self._place / name
        kept = f"{self.kept()}; make room and give the same command again"
        if not self._is_written:
            with named_errors(self._place / INDEX_NAME, kept):
                self._index.write(self._place)
            self._is_written = True
        with named_errors(path, kept):
            write(path)

    def path(self, name: str) -> Path:
        """Where a file of the set is now."""
        return self._place / name

    def kept(self) -> str:
        """Says how many items are on disk."""
        done = self._index.finished(self._place)
        return f"{len(done)} of {len(self._index.items)} {self._index.kind.name} in {self._place} are complete and kept"

    def complete(self) -> None:
        """Ends the work on the items: a set that replaces another takes its place."""
        if self._place == self.folder:
            return
        remove_unfinished(self._place, self._index.names)
        self._place.rename(self.folder / READY)
        finish_replacement(self.folder)
        self._place = self.folder


@contextmanager
def open_set(folder: Path, index: SetIndex, *, overwrite: bool) -> Iterator[OutputSet]:
    """Holds a folder, and finds or begins the set of a request in it. Writes nothing before the first item.

    Args:
        folder: to fill.
        index: of the set; one with an equal request is continued.
        overwrite: whether a set of another request is replaced. A complete set of the same request is made anew only
            with ``overwrite``; without it there is nothing left to do.

    Raises:
        ValueError: if the folder holds what may not be replaced: live recordings, another kind of set, files that this
            program did not write under the same names or in the hidden folders, or without ``overwrite`` a set of
            another request.
        OSError: if another process holds the folder, or it cannot be written.
    """
    with locked_folder(folder):
        finish_replacement(folder)
        old = check_set(folder, index, overwrite=overwrite)
        replaces = old is not None and _is_replaced(old, index, folder, overwrite=overwrite)
        place = folder / NEW if replaces else folder
        if replaces and check_own_folder(place, index.kind) != index:
            remove_own_folder(place, index.kind)  # of an interrupted --overwrite with another request
        for known in (old, index):
            remove_unfinished(folder, known.names if known is not None else ())
        remove_unfinished(place, index.names)
        yield OutputSet(folder, place, index)


def check_set(folder: Path, index: SetIndex, *, overwrite: bool) -> SetIndex | None:
    """Checks that a set may be made in a folder, and returns the set that is there; changes nothing.

    Raises:
        ValueError: see `open_set`.
    """
    old = find_set(folder, index.kind)
    if old is not None and old.kind is not index.kind:
        raise ValueError(f"{folder}: holds {old.kind.name}, not {index.kind.name}; choose another --out")
    if index.kind is DEMONSTRATIONS:
        _refuse_live(folder)
    _refuse_foreign(folder, old, index, overwrite=overwrite)
    if old is not None and old.request != index.request and old.finished(folder) and not overwrite:
        raise ValueError(
            f"{folder}: holds {len(old.finished(folder))} {old.kind.name} {old.difference(index.request or {})};"
            " choose another --out, or add --overwrite to replace them"
        )
    return old


def is_begun(folder: Path, index: SetIndex) -> bool:
    """Whether a folder holds the set of a request, finished or not, and no replacement of it has begun."""
    old = find_set(folder, index.kind)
    return old is not None and old.request == index.request and not (folder / NEW).exists()


def finish_replacement(folder: Path) -> None:
    """Finishes the replacement of a set that was interrupted, if there is one. The caller holds the folder.

    Raises:
        ValueError: if the hidden folder ``READY`` holds anything else than a set of the kind in the folder.
    """
    ready = folder / READY
    if not os.path.lexists(ready):
        return
    found = read_index(folder) or read_index(ready)
    kind = DEMONSTRATIONS if found is None else found.kind
    new = check_own_folder(ready, kind)
    if new is not None:  # it moves last
        old = find_set(folder, new.kind)
        if old is not None:
            # What describes the items goes first and comes last, so that it never stands beside other items.
            for name in sorted(old.names - set(old.items)) + sorted(set(old.items) - set(new.items)):
                (folder / name).unlink(missing_ok=True)
        for name in (*new.items, *(name for name in new.files if name not in new.items)):
            if (ready / name).exists():
                (ready / name).replace(folder / name)
        (ready / INDEX_NAME).replace(folder / INDEX_NAME)
    remove_own_folder(ready, kind)


def _refuse_live(folder: Path) -> None:
    """Refuses a folder that holds live recordings, whatever their names and the index say."""
    for path in sorted(folder.glob("*.parquet")):
        if _is_live(path):
            raise ValueError(f"{path}: a live recording, which no command replaces; choose another --out")


def _is_live(path: Path) -> bool:
    if path.stem.endswith("_live"):
        return True
    try:
        return bool(read_demonstration(path).metadata.get("habit") == "live")
    except ValueError:
        return False


def _is_replaced(old: SetIndex, index: SetIndex, folder: Path, *, overwrite: bool) -> bool:
    """Whether a set that may be made, beside the old one in a folder, replaces it: else the old one is continued."""
    if old.request == index.request:
        return overwrite and old.is_complete(folder)
    return bool(old.finished(folder))


def _refuse_foreign(folder: Path, old: SetIndex | None, index: SetIndex, *, overwrite: bool) -> None:
    """Refuses to replace files that this program did not write, and to mix recordings unasked.

    Raises:
        ValueError: if there is such a file; the message names it.
    """
    known = set() if old is None else old.names
    for name in sorted(index.names - known):
        if (folder / name).exists():
            raise ValueError(f"{folder / name}: not a file of this set; move it away, or choose another --out")
    others = [path.name for path in sorted(folder.glob("*.parquet")) if path.name not in known]
    if others and old is None and not overwrite:
        raise ValueError(
            f"{folder}: holds {len(others)} other recordings, such as {others[0]}; choose another --out,"
            " or add --overwrite to record beside them"
        )
