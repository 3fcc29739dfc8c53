"""The distribution of the measured load over many trials, against the limit of the force guard.

    python -m benchmarks.rig.load_limit [--skill FILE] [--trials 500] [--jobs 2] [--json FILE]

Both arms (`Arm`) perform the same number of trials, from `FIRST_TRIAL` on, which were used for no choice.
`benchmarks.faults` measures the arm with faults. Loads are the largest of each trial (`TrialResult.peak_measured_load`,
`TrialResult.peak_load`); the guard keeps its limit if the measured load stays below 1.2 times the limit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np

from benchmarks.command_line import argument_parser, run
from experiments.trial import Arm, run_trials
from experiments.trial_result import TrialResult
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, write_json
from models.scenario import load_scenario
from skill.manipulation_skill import ManipulationSkill

FIRST_TRIAL = 70000
TOLERANCE = 1.2  # factor on the limit
PERCENTILES = (50, 90, 99, 99.9)


def summary(arm: str, results: Sequence[TrialResult], limit: float) -> dict[str, Any]:
    """Returns the figures of an arm; loads in N."""
    measured = np.array([result.peak_measured_load for result in results], dtype=float)
    true = np.array([result.peak_load for result in results], dtype=float)
    worst = results[int(measured.argmax())]
    return {
        "arm": arm,
        "trials": len(results),
        "inserted": sum(result.inserted for result in results),
        "trusted": sum(bool(result.trusted) for result in results),
        "limit_n": limit,
        "beyond_limit": int((measured > limit).sum()),
        "beyond_tolerance": int((measured > TOLERANCE * limit).sum()),
        "measured_n": {f"p{p:g}": float(np.percentile(measured, p)) for p in PERCENTILES} | {"max": measured.max()},
        "true_n": {f"p{p:g}": float(np.percentile(true, p)) for p in PERCENTILES} | {"max": true.max()},
        "worst_trial": worst.seed,
        "reasons": _counts(result.outcome.value for result in results),
        "measured_loads_n": measured.tolist(),
    }


def _counts(texts: Iterable[str]) -> dict[str, int]:
    values, counts = np.unique(list(texts), return_counts=True)
    return dict(zip(values.tolist(), counts.tolist(), strict=True))


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Prints the table, one column an arm."""
    table = plain_table("largest load of a trial, N")
    table.add_column("")
    for row in rows:
        table.add_column(row["arm"], justify="right")
    for key in ("trials", "inserted", "trusted"):
        table.add_row(key, *(str(row[key]) for row in rows))
    for name in (*(f"p{p:g}" for p in PERCENTILES), "max"):
        table.add_row(f"measured, {name}", *(f"{row['measured_n'][name]:.1f}" for row in rows))
    table.add_row("true, max", *(f"{row['true_n']['max']:.1f}" for row in rows))
    table.add_row("trials above the limit", *(str(row["beyond_limit"]) for row in rows))
    table.add_row("trials above 1.2 limits", *(str(row["beyond_tolerance"]) for row in rows))
    console.print(table)


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--skill", type=Path, default=Path("out/skill.npz"), metavar="FILE", help="of the policy")
    parser.add_argument("--trials", type=int, default=500, help="trials of each arm (default: 500)")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    arguments = parser.parse_args()
    if not (arguments.trials >= 1 and arguments.jobs >= 1):
        raise ValueError(f"--trials {arguments.trials} --jobs {arguments.jobs}: expected at least 1")
    policy = ManipulationSkill.load(arguments.skill)
    scenario = load_scenario()
    numbers = list(range(FIRST_TRIAL, FIRST_TRIAL + arguments.trials))
    rows = []
    with progress("load limit", len(Arm) * len(numbers)) as advance:
        for arm in Arm:
            results = []
            for result, _ in run_trials(scenario, policy, numbers, jobs=arguments.jobs, arm=arm):
                results.append(result)
                advance(f"{arm}: {result.reason}")
            rows.append(summary(arm.value, results, scenario.controller.guard.force_limit))
    show(rows)
    if arguments.json is not None:
        write_json(arguments.json, {"arms": rows})


if __name__ == "__main__":
    run(main)
