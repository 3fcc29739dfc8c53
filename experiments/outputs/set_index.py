"""The index of a folder that a command fills: `index.json`, with the request and the names of the files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from experiments.trial.trial_result import TrialResult
from skill.data.demonstration import read_demonstration
from skill.data.files import one_line, read_bounded, write_atomically
from skill.data.rig_run import read_rig_run

INDEX_NAME = "index.json"
INDEX_VERSION = 1
MAX_INDEX_SIZE = 50_000_000  # bytes; a hundred thousand trials need 6 MB


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
        return self.finished(folder) == self.items and all((folder / name).is_file() for name in self.reports[:1])

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
        OSError: if it cannot be read. The message names the file.
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
    except OSError as error:
        raise OSError(f"{path}: the index of the folder cannot be read ({error.strerror or error})") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(
            f"{path}: not an index of this program ({type(error).__name__}: {one_line(error)}); move it away"
        ) from error
