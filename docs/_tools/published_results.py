"""Copies the results of a sweep for the documentation, and makes from such a copy results that the sweep goes on with.

    python docs/_tools/published_results.py out/sweeps/peers docs/scoreboard
    python docs/_tools/published_results.py --restore docs/ladder out/sweeps/clearance

The copy is a folder of results that `haptic-skill scoreboard` reads, with one small file for each policy, arm and
engine. It leaves out the skills, the demonstrations and the column ``scenario``, which follows from the specification,
the arm and the number of the trial. A sweep knows only rows of its own code: restore them in a checkout of the commit
that made them.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from models.scenario import dump_scenario
from systems.runs.trial import trial_scenario
from systems.scoreboard.result_store import PUBLISHED
from systems.sessions.sweep_session import SWEEPS
from systems.sweeps.assignments import assignments
from systems.sweeps.design.specification import read_specification
from systems.sweeps.result_blocks import hold
from systems.sweeps.trial_rows import row_key


def publish(results: Path, out: Path) -> None:
    """Copies ``results`` to ``out``, which is replaced at once when the copy is complete.

    Raises:
        ValueError: if ``results`` has no trials or no specification.
    """
    groups: dict[Path, list[pa.Table]] = {}
    for path in sorted((results / "trials").rglob("*.parquet")):
        table = pq.ParquetFile(path).read().drop_columns(["scenario"])
        groups.setdefault(path.parent.relative_to(results), []).append(table)
    if not groups or not (results / SWEEPS).is_dir():
        raise ValueError(f"{results}: no trials or no sweeps in it; expected a folder that haptic-skill sweep wrote")
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as beside:
        copy = Path(beside) / out.name
        for folder, tables in groups.items():
            (copy / folder).mkdir(parents=True)
            kept = pa.concat_tables(tables).sort_by("trial").replace_schema_metadata(None)
            pq.write_table(
                kept, copy / folder / PUBLISHED, compression="zstd", compression_level=19, write_statistics=False
            )
        shutil.copytree(results / SWEEPS, copy / SWEEPS)
        if out.exists():
            out.rename(Path(beside) / "before")
        copy.rename(out)


def restore(published: Path, results: Path) -> tuple[int, int]:
    """Writes the rows of a published copy into ``results``, as far as its sweeps with the present code ask for them.

    Returns the numbers of rows written and of rows in the copy.
    """
    rows = {
        row["key"]: row
        for path in (published / "trials").rglob("*.parquet")
        for row in pq.ParquetFile(path).read().to_pylist()
    }
    written = 0
    for path in sorted((published / "sweeps").glob("*.yaml")):
        for assignment in assignments(read_specification(path), results, str(path)):
            source = assignment.source
            for block in assignment.blocks:
                keys = {number: row_key(block.source, number) for number in block.missing()}
                known = {number: rows[key] for number, key in keys.items() if key in rows}
                if known and (held := hold(block)) is not None:
                    for number, row in known.items():
                        scenario = trial_scenario(source.scenario, number=number, arm=source.arm)
                        held.add({**row, "scenario": dump_scenario(scenario)})
                    written += held.write()
                    held.release()
    return written, len(rows)


if __name__ == "__main__":
    sys.path.append(str(Path.cwd()))  # import paths of a specification may name modules in the checkout
    if sys.argv[1] == "--restore":
        print("{} of {} published rows restored".format(*restore(Path(sys.argv[2]), Path(sys.argv[3]))))
    else:
        publish(Path(sys.argv[1]), Path(sys.argv[2]))
