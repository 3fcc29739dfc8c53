"""Performs trials of a sweep again, with the present code, and compares their records.

    python -m benchmarks.rig.repeats RESULTS [--trials 20] [--seed 0] [--json FILE]

The rows of a sweep belong to the code that performed them. This shows whether later code gives the same results: random
trials of the skills in RESULTS/skills, in the engine that the row names. Two rows are the same if every figure of
`experiments.sweeps.trial_rows.result_columns` is equal as stored.

Keys of the file: ``code``, digest of the code of the rows; ``present_code``; ``trials``; ``same``, how many records are
the same; ``differences``, the others: trial, policy, arm, and the columns that differ.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import pyarrow.dataset as pads
import typer

from benchmarks.command_line import JsonFile, finish, run
from experiments.sweeps.trial_files import PARTITIONING
from experiments.sweeps.trial_rows import result_columns, trial_code
from experiments.trial import run_rig
from interfaces.terminal import console, progress
from models.scenario import parse_scenario
from skill.manipulation_skill import ManipulationSkill
from skill.policy import CarriedOver
from systems.rig import MakeRig


def stored_rows(results: Path) -> pd.DataFrame:
    """Returns the rows of the newest code that were performed by a skill whose file is among the results.

    Raises:
        ValueError: if there is none.
    """
    if not (results / "trials").is_dir():
        raise ValueError(f"{results}: no folder 'trials' in it; expected a folder that `haptic-skill sweep` wrote")
    table: pd.DataFrame = pads.dataset(results / "trials", partitioning=PARTITIONING).to_table().to_pandas()
    if len(table):
        table = table[table["code"] == table.sort_values("began")["code"].iloc[-1]]
    kept = {path.stem for path in (results / "skills").glob("*.npz")}
    rows: pd.DataFrame = table[table["skill"].isin(kept)] if len(table) else table
    if not len(rows):
        raise ValueError(f"{results}: no trial of a skill in {results / 'skills'}; expected the results of a sweep")
    return rows.sort_values("key")


def differing(row: pd.Series, results: Path) -> list[str]:
    """Returns the names of the columns in which a trial, performed again, differs from its row."""
    scenario = parse_scenario(row["scenario"], f"the scenario of trial {row['trial']}")
    skill = CarriedOver(ManipulationSkill.load(results / "skills" / f"{row['skill']}.npz"))
    result = run_rig(MakeRig(scenario, skill), scenario, seed=int(row["trial"])).result
    return [name for name, value in result_columns(result).items() if not _same(row[name], value)]


def _same(stored: Any, found: Any) -> bool:
    return bool(stored == found or (pd.isna(stored) and pd.isna(found)))


def main(
    results: Annotated[Path, typer.Argument(help="Folder that `haptic-skill sweep` wrote.")],
    trials: Annotated[int, typer.Option(min=1, help="How many trials to perform again.")] = 20,
    seed: Annotated[int, typer.Option(help="Draws them.")] = 0,
    json: JsonFile = None,
) -> None:
    rows = stored_rows(results)
    chosen = rows.sample(min(trials, len(rows)), random_state=seed)
    found = []
    with progress("repeats", len(chosen)) as advance:
        for _, row in chosen.iterrows():
            columns = differing(row, results)
            found.append({"trial": int(row["trial"]), "policy": row["policy"], "arm": row["arm"], "columns": columns})
            advance(row["policy"])
    different = [record for record in found if record["columns"]]
    console.print(f"{len(found) - len(different)} of {len(found)} records are the same", highlight=False)
    for record in different:
        console.print(f"trial {record['trial']} of {record['policy']}, {record['arm']}: {', '.join(record['columns'])}")
    summary = {"code": str(rows["code"].iloc[0]), "present_code": trial_code(), "trials": len(found)}
    finish({**summary, "same": len(found) - len(different), "differences": different}, json)


if __name__ == "__main__":
    run(main)
