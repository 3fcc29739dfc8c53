"""Copies the results of a sweep for the documentation.

    python -m docs._tools.published_results out/sweeps/peers docs/scoreboard

The copy is a folder of results that `haptic-skill scoreboard` reads, with one small file for each policy, set of trials
and engine. It leaves out the skills, the demonstrations and the column ``scenario``, which follows from the
specification, the set of trials and the number of the trial.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.sweep.trial_files import PUBLISHED, SWEEPS, TRIALS


def publish(results: Path, out: Path) -> None:
    """Copies ``results``, a folder that `haptic-skill sweep` wrote, to ``out``, which must be new."""
    shutil.copytree(results / SWEEPS, out / SWEEPS)
    for folder in {path.parent for path in (results / TRIALS).rglob("*.parquet")}:
        copy = out / folder.relative_to(results)
        copy.mkdir(parents=True)
        rows = pa.concat_tables(pq.ParquetFile(path).read() for path in folder.glob("*.parquet"))
        kept = rows.drop_columns(["scenario"]).sort_by("trial").replace_schema_metadata(None)
        pq.write_table(kept, copy / PUBLISHED, compression="zstd", compression_level=19, write_statistics=False)


if __name__ == "__main__":
    publish(*map(Path, sys.argv[1:]))
