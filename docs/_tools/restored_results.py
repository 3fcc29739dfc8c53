"""Makes of published results a folder with which their sweep goes on.

    python docs/_tools/restored_results.py NEWER/docs/ladder out/sweeps/clearance

A sweep knows only rows of its own code: run this in a checkout of a commit with that code, with the Python of its
environment; NEWER is the checkout that has the copy.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import pyarrow.parquet as pq

from experiments.sweeps.assignments import assignments
from experiments.sweeps.result_blocks import hold
from experiments.sweeps.specification import read_specification
from experiments.sweeps.trial_files import SWEEPS, TRIALS
from experiments.sweeps.trial_rows import row_key
from experiments.trial.trial_set import trial_scenario
from models.scenario import dump_scenario


def restore(published: Path, results: Path) -> tuple[int, int]:
    """Writes the rows of a published copy into ``results``, as far as its sweeps with the present code ask for them.

    Returns the numbers of rows written and of rows in the copy.
    """
    rows = {
        row["key"]: row
        for path in (published / TRIALS).rglob("*.parquet")
        for row in pq.ParquetFile(path).read().to_pylist()
    }
    written = 0
    for path in sorted((published / SWEEPS).glob("*.yaml")):
        for assignment in assignments(read_specification(path), results, str(path)):
            source = assignment.source
            for block in assignment.blocks:
                keys = {number: row_key(block.source, number) for number in block.missing()}
                known = {number: rows[key] for number, key in keys.items() if key in rows}
                if known and (held := hold(block)) is not None:
                    for number, row in known.items():
                        scenario = trial_scenario(source.scenario, number=number, trial_set=source.trial_set)
                        held.add({**row, "scenario": dump_scenario(scenario)})
                    written += held.write()
                    held.release()
    return written, len(rows)


def main() -> None:
    """Restores the results that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("published", type=Path, metavar="PUBLISHED", help="folder of the copy")
    parser.add_argument("results", type=Path, metavar="RESULTS", help="folder of the sweep")
    arguments = parser.parse_args()
    sys.path.append(str(Path.cwd()))  # import paths of a specification may name modules in the checkout
    written, published = restore(arguments.published, arguments.results)
    print(f"{written} of {published} published rows restored")


if __name__ == "__main__":
    main()
