"""Copies the results of a sweep for the documentation: one small file for each policy, arm and engine.

    python docs/_tools/published_results.py out/sweeps/peers docs/scoreboard

The copy is a folder of results that `haptic-skill scoreboard` reads. It leaves out the skills, the demonstrations and
the column ``scenario``, which follows from the specification, the arm and the number of the trial.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq


def publish(results: Path, out: Path) -> None:
    """Copies ``results`` to ``out``, which is replaced."""
    groups: dict[Path, list[pa.Table]] = {}
    for path in sorted((results / "trials").rglob("*.parquet")):
        table = pq.ParquetFile(path).read().drop_columns(["scenario"])
        groups.setdefault(path.parent.relative_to(results), []).append(table)
    if out.exists():
        shutil.rmtree(out)
    for folder, tables in groups.items():
        (out / folder).mkdir(parents=True)
        rows = pa.concat_tables(tables).sort_by("trial")
        kept = rows.replace_schema_metadata(None)
        pq.write_table(
            kept, out / folder / "trials.parquet", compression="zstd", compression_level=19, write_statistics=False
        )
    shutil.copytree(results / "sweeps", out / "sweeps")


if __name__ == "__main__":
    publish(Path(sys.argv[1]), Path(sys.argv[2]))
