"""A folder that a command fills with the files of one request: continued, protected, or replaced as a whole.

Its index, `index.json`, holds the request and the names of the files. A set that replaces another is made in the hidden
folder `NEW` within it. When all its items are there, the hidden folder is renamed to `READY`: from then on the new set
counts, and its files move into place. Whoever opens the folder next finishes an interrupted move. So a process that is
killed at any moment leaves the whole old set or the whole new one.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from experiments.outputs.folder_lock import LOCK_NAME, locked_folder, remove_unfinished
from experiments.outputs.output_checks import INDEX_NAME, RECORDING_SIZE, check_folder, named_errors
from experiments.trial.trial_result import TrialResult
from skill.data.demonstration import read_demonstration
from skill.data.files import one_line, read_bounded, write_atomically
from skill.data.rig_run import read_rig_run

INDEX_VERSION = 1
MAX_INDEX_SIZE = 50_000_000  # bytes; a hundred thousand trials need 6 MB

NEW, READY = ".haptic-skill-new", ".haptic-skill-ready"
"""Hidden folders within a folder, of a set that will replace another."""


def read_result(path: Path) -> TrialResult:
    """Reads and validates a run, and returns its result.

    Raises:
        ValueError: if the file or the result in it is not valid. The message names the file.
    """
    row = read_rig_run(path).result
    try:
        return TrialResult.from_record(row)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


@dataclass(frozen=True)
class SetKind:
    """A kind of folder.

    Attributes:
        name: in the index and in messages: what the folder holds.
        names: pattern of the names that its files may have.
        read: reads and validates an item, one of the ``.parquet`` files that the work produces; raises ValueError.
    """

    name: str
    names: str
    read: Callable[[Path], Any]


DEMONSTRATIONS = SetKind(
    "demonstrations", r"\d{3,}_(good|bad|correction)_(?!live\.)\w+\.parquet|demonstrations\.png", read_demonstration
)
LIVE = SetKind("live recordings", r"(?!)", read_demonstration)  # lists none: all are read, and none is replaced
RUNS = SetKind("runs", r"run_\d{4,}\.parquet|results\.json|report\.html|replay_\d{4,}\.html", read_result)
PRACTICE = SetKind(
    "practice trials",
    r"round_\d{4,}_(trial|check)_\d{4,}\.parquet|held_out_(before|after)_\d{4,}\.parquet|best\.npz",
    read_rig_run,
)

KINDS = {kind.name: kind for kind in (DEMONSTRATIONS, LIVE, RUNS, PRACTICE)}


@dataclass(frozen=True)
class SetIndex:
    """The content of an index.

    Attributes:
        kind: of the folder.
        request: what the files were made for; two sets with the same request are the same.
        files: names of the files that belong to the set as long as it exists.
        reports: names of the files that are made from them at the end, and can be made again. The first is made last.
    """

    kind: SetKind
    request: Mapping[str, Any]
    files: tuple[str, ...] = ()
    reports: tuple[str, ...] = ()

    @property
    def items(self) -> list[str]:
        """The names of the items."""
        return [name for name in self.files if name.endswith(".parquet")]

    @property
    def names(self) -> set[str]:
        """The names of all files."""
        return {*self.files, *self.reports}

    def finished(self, folder: Path) -> list[str]:
        """Names of the items that are in a folder. Files are written whole, so these are finished."""
        return [name for name in self.items if (folder / name).is_file()]

    def is_complete(self, folder: Path) -> bool:
        """Whether all items and the last report are in a folder."""
        return all((folder / name).is_file() for name in (*self.items, *self.reports[:1]))

    def write(self, folder: Path) -> None:
        """Writes the index into a folder."""
        content = {"index_version": INDEX_VERSION, **asdict(self), "kind": self.kind.name}
        write_atomically(folder / INDEX_NAME, (json.dumps(content, indent=1) + "\n").encode())

    def difference(self, request: Mapping[str, Any]) -> str:
        """Names what another request has different."""
        parts = []
        for key in request:
            old, new = self.request.get(key), request[key]
            if old != new:
                is_short = isinstance(old, int | float | str) and "\n" not in str(old) and len(str(old)) < 40
                parts.append(f"{key} {old}, here {new}" if is_short else f"another {key}")
        return f"of another request ({'; '.join(parts)})"


def read_index(folder: Path) -> SetIndex | None:
    """Reads the index of a folder; None if there is none.

    Raises:
        ValueError: if it is not an index of this program. The message names the file.
        OSError: if it cannot be read.
    """
    path = folder / INDEX_NAME
    try:
        content = json.loads(read_bounded(path, MAX_INDEX_SIZE))
        kind = KINDS[content["kind"]]
        found = SetIndex(kind, dict(content["request"]), tuple(content["files"]), tuple(content["reports"]))
        wrong = [name for name in found.names if not re.fullmatch(kind.names, name)]
        if content["index_version"] != INDEX_VERSION or wrong:
            raise ValueError(f"version {content['index_version']}, files {wrong[:3]}")
        return found
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(
            f"{path}: not an index of this program ({type(error).__name__}: {one_line(error)}); move it away"
        ) from error


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
        with named_errors(self._place / name, f"{self.kept()}; make room and give the same command again"):
            if not self._is_written:
                self._index.write(self._place)
                self._is_written = True
            write(self._place / name)

    def path(self, name: str) -> Path:
        """Where a file of the set is now."""
        return self._place / name

    def kept(self) -> str:
        """Says how many items are on disk."""
        done = self._index.finished(self._place)
        return f"{len(done)} of {len(self._index.items)} {self._index.kind.name} in {self._place} are complete and kept"

    def complete(self) -> None:
        """Ends the work on the items: a set that replaces another takes its place."""
        if self._place != self.folder:
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
        ValueError: see `check_set`.
        OSError: if another process holds the folder, or it cannot be written.
    """
    with locked_folder(folder):
        finish_replacement(folder)
        old, place = check_set(folder, index, overwrite=overwrite), folder
        if old is not None and old.finished(folder):
            is_same = old.request == index.request
            if not is_same or (overwrite and old.is_complete(folder)):
                place = folder / NEW
        if place != folder and read_index(place) != index:
            remove_set(place)  # of an interrupted --overwrite with another request
        for known in {folder, place}:
            remove_unfinished(known, [*index.names, *(old.names if old is not None else ()), INDEX_NAME])
        yield OutputSet(folder, place, index)


def check_set(folder: Path, index: SetIndex, *, overwrite: bool) -> SetIndex | None:
    """Checks that a set may be made in a folder, and returns the index that is there; changes nothing.

    Raises:
        ValueError: if the folder holds another kind of set, recordings without an index, files that are not in the
            index under the names of new ones, or without ``overwrite`` a set of another request.
    """
    old = read_index(folder)
    if old is not None and old.kind is not index.kind:
        raise ValueError(f"{folder}: holds {old.kind.name}, not {index.kind.name}; choose another --out")
    for name in sorted(index.names - (set() if old is None else old.names)):
        if (folder / name).exists():
            raise ValueError(f"{folder / name}: not a file of this set; move it away, or choose another --out")
    if old is None and (others := sorted(folder.glob("*.parquet"))):
        raise ValueError(f"{others[0]}: a recording of no set, which no command replaces; choose another --out")
    if old is not None and old.request != index.request and old.finished(folder) and not overwrite:
        raise ValueError(
            f"{folder}: holds {len(old.finished(folder))} {old.kind.name} {old.difference(index.request)};"
            " choose another --out, or add --overwrite to replace them"
        )
    return old


def finish_replacement(folder: Path) -> None:
    """Finishes the replacement of a set that was interrupted, if there is one. The caller holds the folder."""
    ready = folder / READY
    if not ready.exists():
        return
    old, new = read_index(folder), read_index(ready)  # the index moves last
    if new is not None:
        items = set(new.items)
        if old is not None:
            # What describes the items goes first and comes last, so that it never stands beside other items.
            for name in sorted(old.names - set(old.items)) + sorted(set(old.items) - items):
                (folder / name).unlink(missing_ok=True)
        for name in sorted(new.names, key=lambda name: (name not in items, name)):
            if (ready / name).exists():
                (ready / name).replace(folder / name)
        (ready / INDEX_NAME).replace(folder / INDEX_NAME)
    remove_set(ready)


def remove_set(folder: Path) -> None:
    """Removes the files of a set, its index last, so that what an interruption leaves goes too, and their folder.

    Raises:
        OSError: if the folder holds another file, which stays.
    """
    index = read_index(folder)
    names = [LOCK_NAME, *(index.names if index is not None else ()), INDEX_NAME]
    remove_unfinished(folder, names)
    for name in names:
        (folder / name).unlink(missing_ok=True)
    if folder.exists():
        folder.rmdir()


@contextmanager
def open_live_folder(folder: Path) -> Iterator[None]:
    """Holds a folder for a live session, which holds live recordings and nothing else, and no command deletes them.

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
        left = {path.name.rpartition(".")[0].removeprefix(".") for path in folder.glob(".*_live.parquet.*")}
        remove_unfinished(folder, [*left, INDEX_NAME])
        _mark_live(folder)
        try:
            yield
        finally:
            _mark_live(folder)


def _mark_live(folder: Path) -> None:
    """Writes the index of a folder that holds live recordings."""
    if read_index(folder) is None and any(folder.glob("*.parquet")):
        with named_errors(folder / INDEX_NAME, "the recordings are complete"):
            SetIndex(LIVE, {}).write(folder)


def find_recordings(folder: Path) -> tuple[list[Path], str]:
    """Finds the recordings of a folder: those that its index lists, or every ``*.parquet`` if it lists none.

    Returns:
        Their paths, in the order of the names; and what is not read or missing, for the person who trains.

    Raises:
        ValueError: if there is none, the index is not valid, or the folder holds something else.
        OSError: if an interrupted replacement of the set cannot be finished.
    """
    if (folder / READY).exists():
        with locked_folder(folder):
            finish_replacement(folder)
    index = read_index(folder)
    found, notes = sorted(folder.glob("*.parquet")), []
    if index is not None and index.kind not in (DEMONSTRATIONS, LIVE):
        raise ValueError(f"{folder}: holds {index.kind.name}; expected demonstrations")
    if index is not None and index.kind is DEMONSTRATIONS:
        others = [path.name for path in found if path.name not in index.items]
        found = [folder / name for name in sorted(index.finished(folder))]
        if others:
            notes.append(f"{len(others)} files are not in its index and are not read: {', '.join(others[:3])}")
        if len(found) < len(index.items):
            missing = f"{len(found)} of {len(index.items)} demonstrations are there"
            notes.append(f"{missing}; record again to complete the set")
    if not found:
        raise ValueError(f"{folder}: no demonstrations (*.parquet) found; record some first")
    return found, f"{folder}: {'; '.join(notes)}" if notes else ""
