"""How fast a sweep performs trials with one process and with two, and what it costs beside the trials.

    python -m benchmarks.sweep_scaling [--trials 40] [--repeats 3] [--jobs 2] [--skill FILE] [--json FILE]

The same trials of one skill are performed by one process and by --jobs, in turn, --repeats times, each time into a new
folder. Columns: number of processes; trials per minute of wall-clock time, processes started and code read included;
the ratio to one process; the CPU time of a trial in its worker; and the overhead, the part of the processes' wall-clock
time in which no trial was performed, over the time of the trials. The first columns are medians over the repeats.
The number of trials should be large: starting the processes takes some seconds and counts.

Then the CPU time of the client for a trial is measured, with ROWS trials that nobody performs: to make and pickle the
task with its policy, and to write the row.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import cloudpickle
import numpy as np
import pyarrow.dataset as ds

from benchmarks.command_line import argument_parser, run
from experiments.sweeps.assignments import assignments
from experiments.sweeps.policy_store import PolicyStore
from experiments.sweeps.result_blocks import TRIALS, Block
from experiments.sweeps.specification import read_specification
from experiments.sweeps.trial_rows import Row
from experiments.sweeps.trial_stream import TrialStream, TrialTask
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, say, write_json
from scripts.sweep_session import sweep

FIRST_TRIAL = 85000
ROWS = 5000


class ReadyRows:
    """An executor that pickles each task and returns a row that is there already.

    Args:
        row: of another trial.
    """

    def __init__(self, row: Row) -> None:
        self._row = row
        self.bytes = 0  # of the last task

    def run(self, tasks: Iterable[TrialTask]) -> Iterator[tuple[Block, int, Row]]:
        """Yields a row for each task."""
        for task in tasks:
            self.bytes = len(cloudpickle.dumps(task))
            yield task.block, task.number, {**self._row, "trial": task.number}


def client_cost(skill: Path, row: Row, folder: Path) -> dict[str, Any]:
    """The CPU time of the client for a trial, ms, and the size of a task, bytes."""
    path = folder / "client.yaml"  # JSON is YAML
    policy = {"skill": str(skill), "carried_over": True}  # whatever it was made for: nothing is simulated
    write_json(path, {"policies": {"skill": policy}, "trials": {"number": ROWS}})
    wanted = assignments(read_specification(path), folder, "client")
    todo = [(assignment, block, len(block.numbers)) for assignment in wanted for block in assignment.blocks]
    executor: Any = ReadyRows(row)
    begun = time.process_time()
    TrialStream(todo, PolicyStore(folder), executor, lambda note: None).run()
    return {"client_ms": 1e3 * (time.process_time() - begun) / ROWS, "task_bytes": executor.bytes}


def timed(skill: Path, trials: int, jobs: int, folder: Path) -> tuple[dict[str, Any], Row]:
    """The figures of one sweep, and a row of it."""
    specification = folder / "scaling.yaml"
    keys = {"policies": {"skill": {"skill": str(skill)}}, "trials": {"first": FIRST_TRIAL, "number": trials}}
    write_json(specification, keys)
    begun = time.perf_counter()
    sweep(path=specification, out=folder / "results", backend="local", address=None, jobs=jobs)
    wall = time.perf_counter() - begun
    rows = ds.dataset(folder / "results" / TRIALS, format="parquet").to_table()
    cpu = float(np.sum(rows["cpu_s"].to_numpy()))
    found = {"jobs": jobs, "trials": rows.num_rows, "wall_s": wall, "trial_cpu_s": cpu / rows.num_rows, "cpu_s": cpu}
    return found, rows.slice(0, 1).to_pylist()[0]


def summary(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each number of processes."""
    rows = []
    for jobs in sorted({one["jobs"] for one in runs}):
        own = [one for one in runs if one["jobs"] == jobs]
        rows.append(
            {
                "jobs": jobs,
                "trials": own[0]["trials"],
                "trials_per_min": float(np.median([60.0 * one["trials"] / one["wall_s"] for one in own])),
                "trial_cpu_s": float(np.median([one["trial_cpu_s"] for one in own])),
                "overhead": float(np.median([jobs * one["wall_s"] / one["cpu_s"] - 1.0 for one in own])),
            }
        )
    for row in rows:
        row["ratio"] = row["trials_per_min"] / rows[0]["trials_per_min"]
    return rows


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--skill", type=Path, default=Path("out/skill.npz"), metavar="FILE", help="of the policy")
    parser.add_argument("--trials", type=int, default=40, help="trials of each sweep (default: 40)")
    parser.add_argument("--repeats", type=int, default=3, help="sweeps with each number of processes (default: 3)")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes compared with one (default: 2)")
    arguments = parser.parse_args()
    if min(arguments.trials, arguments.repeats) < 1 or arguments.jobs < 2:
        raise ValueError("expected --trials and --repeats of at least 1 and --jobs of at least 2")
    runs = []
    for _ in range(arguments.repeats):
        for jobs in (1, arguments.jobs):
            with tempfile.TemporaryDirectory() as folder:
                figures, row = timed(arguments.skill, arguments.trials, jobs, Path(folder))
                runs.append(figures)
    rows = summary(runs)
    with tempfile.TemporaryDirectory() as folder:
        client = client_cost(arguments.skill, row, Path(folder))
    table = plain_table("throughput of a sweep")
    for title in ("processes", "trials", "per minute", "ratio", "CPU s a trial", "overhead"):
        table.add_column(title, justify="right")
    for row in rows:
        table.add_row(
            *(str(row["jobs"]), str(row["trials"]), f"{row['trials_per_min']:.1f}", f"{row['ratio']:.2f}"),
            *(f"{row['trial_cpu_s']:.2f}", f"{100 * row['overhead']:.1f} %"),
        )
    console.print(table)
    say(f"the client: {client['client_ms']:.2f} ms a trial; a task has {1e-6 * client['task_bytes']:.2f} MB")
    if arguments.json is not None:
        write_json(arguments.json, {"rows": rows, "runs": runs, **client})


if __name__ == "__main__":
    run(main)
