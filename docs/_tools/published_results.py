"""Copies the results of a sweep for the documentation.

    python docs/_tools/published_results.py out/sweeps/peers docs/scoreboard

The copy is a folder of results that `haptic-skill scoreboard` reads, with one small file for each policy, set of
trials and engine. It leaves out the skills, the demonstrations and the column ``scenario``, which follows from the
specification, the set and the number of the trial. `docs/_tools/restored_results.py` makes of it results that a sweep
goes on with.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Annotated

import pyarrow as pa
import pyarrow.parquet as pq
import typer

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.command_line import run
from experiments.outputs.new_folder import new_folder
from experiments.sweeps.trial_files import PUBLISHED, SWEEPS, TRIALS


def publish(
    results: Annotated[Path, typer.Argument(help="Folder that `haptic-skill sweep` wrote.")],
    out: Annotated[Path, typer.Argument(help="Folder of the copy.")],
) -> None:
    """Copies ``results`` to ``out``; a copy that is there is replaced when the new one is complete.

    Raises:
        ValueError: if ``results`` has no trials or no specification, or ``out`` holds anything but such a copy.
    """
    groups: dict[Path, list[pa.Table]] = {}
    for path in sorted((results / TRIALS).rglob("*.parquet")):
        table = pq.ParquetFile(path).read().drop_columns(["scenario"])
        groups.setdefault(path.parent.relative_to(results), []).append(table)
    if not groups or not (results / SWEEPS).is_dir():
        raise ValueError(f"{results}: no trials or no sweeps in it; expected a folder that haptic-skill sweep wrote")
    with new_folder(out, files_of=published_files) as copy:
        for folder, tables in groups.items():
            (copy / folder).mkdir(parents=True)
            kept = pa.concat_tables(tables).sort_by("trial").replace_schema_metadata(None)
            pq.write_table(
                kept, copy / folder / PUBLISHED, compression="zstd", compression_level=19, write_statistics=False
            )
        shutil.copytree(results / SWEEPS, copy / SWEEPS)


def published_files(folder: Path) -> set[str]:
    """Returns the paths of the files of a published copy, relative to its folder."""
    paths = [*(folder / TRIALS).rglob(PUBLISHED), *(folder / SWEEPS).glob("*.yaml"), *folder.glob("scoreboard.html")]
    return {path.relative_to(folder).as_posix() for path in paths}


if __name__ == "__main__":
    run(publish)
