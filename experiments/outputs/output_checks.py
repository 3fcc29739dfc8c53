"""Checks of outputs before the work begins: the place can be written, there is room, and no two files collide."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from skill.data.files import TEMPORARY_MARK

INDEX_NAME = "index.json"
"""The file that lists the files of a folder; see `experiments.outputs.output_set`."""

RECORDING_SIZE = 60_000  # bytes of a recording or a run, about
REPORT_SIZE = 3_000_000  # bytes of a page with a scene or figures, at most

CONTENTS = {
    ".npz": ("a skill file", rb"PK\x03\x04.{26}[\w/]+\.npy"),  # a zip archive of arrays
    ".html": ("an HTML page", rb"<!(?i:doctype html)"),
    "trials.json": ("a file of results (JSON)", rb'\[(\]|\n \{\n  "seed": )'),
    "practice.json": ("a file of practice trials (JSON)", rb'\{\n "versions": '),
    "query_states.json": ("a file of query states (JSON)", rb'\[(\]|\n \{\n  "trial": )'),
    ".png": ("a PNG picture", rb"\x89PNG\r\n\x1a\n"),
    ".svg": ("an SVG picture", rb"<\?xml|<svg"),
    ".yaml": ("a scenario of a measured part", rb"# A part that `haptic-skill part` has measured\."),
    ".csv": ("a table of states", rb"trial,time,state,probability\r?\n"),
    ".md": ("a scoreboard in Markdown", rb"# Scoreboard"),
    ".mcap": ("a log (MCAP)", rb"\x89MCAP0\r\n"),
    ".parquet": ("a recording or run (Parquet)", rb"PAR1"),
    ".json": ("another JSON file", rb"\s*[\[{]"),
}
"""How the kinds of file begin, by the suffix that they usually have, and the JSON files of this program by what they
hold. No command replaces a single Parquet file, or another JSON file."""


def check_folder(folder: Path, *, option: str = "--out", size: int = 0, name: str = "") -> None:
    """Checks that a folder exists or can be made, can be written, and has room for ``size`` bytes.

    With ``name`` it checks the name of a file in the folder too.

    Raises:
        OSError: if not. The message names the option, the path and the reason.
    """
    existing = next(path for path in (folder, *folder.absolute().parents) if os.path.lexists(path))
    if not existing.is_dir():
        raise NotADirectoryError(f"{option} {folder}: {existing} is not a folder; choose another place")
    try:
        with tempfile.NamedTemporaryFile(dir=existing, prefix=f".{name or folder.name}{TEMPORARY_MARK}"):
            pass
    except OSError as error:
        raise OSError(f"{option} {folder}: cannot write in {existing} ({error.strerror})") from error
    free = shutil.disk_usage(existing).free
    if free < size:
        needed, there = (f"{number / 1e6:,.0f} MB" for number in (size, free))
        raise OSError(f"{option} {folder}: needs about {needed}, but only {there} are free")


def check_file(path: Path, suffix: str, *, option: str = "--out", size: int = 0) -> None:
    """Checks that a file can be written or replaced, as `check_folder` checks a folder.

    Args:
        path: of the file.
        suffix: kind of content that the command will write, a key of ``CONTENTS``. A file that is there must be of this
            kind too, or empty. The path may have another suffix.
        option: that gave the path, for messages.
        size: of the file, bytes.

    Raises:
        ValueError: if the path belongs to a folder of recordings or runs, or a file of another kind is there.
        OSError: if the file cannot be written. All messages name the option, the path and the reason.
    """
    if path.exists() and not path.is_file():
        what = "a folder" if path.is_dir() else "a device or a pipe"
        raise OSError(f"{option} {path}: is {what}; expected the name of a file")
    check_folder(path.parent, option=option, size=size, name=path.name)
    index = path.parent / INDEX_NAME
    if path == index or (index.is_file() and f'"{path.name}"' in index.read_text(errors="replace")):
        raise ValueError(f"{option} {path}: belongs to what {index} lists; choose another {option}")
    if not path.exists():
        return
    try:
        with path.open("rb") as stream:
            start = stream.read(512)
    except OSError as error:
        raise OSError(f"{option} {path}: cannot be read, so it is not replaced ({error.strerror})") from error
    name, pattern = CONTENTS[suffix]
    if start and not re.match(pattern, start, re.DOTALL):
        found = next((other for other, begin in CONTENTS.values() if re.match(begin, start, re.DOTALL)), "another file")
        raise ValueError(f"{option} {path}: is {found}, and is not replaced by {name}; choose another {option}")


def require_distinct(files: Mapping[str, Path]) -> None:
    """Checks that the files of a command, by the names of their options, are different ones.

    Raises:
        ValueError: if two are the same. The message names both.
    """
    seen: dict[Path, str] = {}
    for name, path in files.items():
        other = seen.setdefault(path.resolve(), name)
        if other != name:
            raise ValueError(f"{other} and {name} are the same file, {path}; choose another name for one of them")


@contextmanager
def named_errors(path: Path, kept: str) -> Iterator[None]:
    """Turns an OSError while a file is written into one line that names the file and says what is kept."""
    try:
        yield
    except OSError as error:
        raise OSError(f"{path}: not written ({error.strerror or error}); {kept}") from error
