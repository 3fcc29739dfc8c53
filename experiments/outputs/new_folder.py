"""A folder with folders in it that a command makes as a whole: it is there completely, or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.outputs.folder_lock import locked_file

STAGED = ".haptic-skill-new"
"""What is added to the hidden name of a folder that is made."""

FilesOf = Callable[[Path], set[str] | None]
"""Returns the relative paths of the files of which a folder of a kind consists; None if it is not of this kind."""


@contextmanager
def new_folder(out: Path, *, files_of: FilesOf = lambda folder: None) -> Iterator[Path]:
    """Yields an empty hidden folder beside ``out``, which is renamed to ``out`` at the end.

    A process that is killed leaves ``out`` as it was, or in the moment of its replacement without files; what else it
    leaves is removed by the next call.

    Args:
        out: folder to make; an empty one may be there.
        files_of: tells the folders that may be replaced; by default none.

    Raises:
        ValueError: if ``out`` is there and may not be replaced. The message names what is in it.
        OSError: if another process writes it, or it cannot be written. The folder ``out`` is then unchanged.
    """
    out = out.parent.resolve() / out.name
    staged = out.with_name(f".{out.name}{STAGED}")
    with locked_file(out):
        check_new_folder(out, files_of=files_of)
        shutil.rmtree(staged, ignore_errors=True)
        staged.mkdir()
        try:
            yield staged
            os.sync()  # the files are on the disk before the name is
            if out.exists():
                shutil.rmtree(out)
            staged.rename(out)
        finally:
            shutil.rmtree(staged, ignore_errors=True)


def check_new_folder(out: Path, *, files_of: FilesOf = lambda folder: None) -> None:
    """Checks that a folder is not there, empty, or may be replaced; see `new_folder`.

    Raises:
        ValueError: if not. The message names what is in it.
    """
    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise ValueError(f"{out}: is there and no folder; choose another OUT")
    found = {path.relative_to(out).as_posix() for path in out.rglob("*") if not path.is_dir()}
    foreign = sorted(found - (files_of(out) or set()))
    if foreign:
        raise ValueError(f"{out}: holds {foreign[0]}, which is not replaced; choose another OUT")
