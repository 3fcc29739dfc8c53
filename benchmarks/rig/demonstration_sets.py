"""How good the skill is with anybody's demonstrations: fresh sets, each recorded, trained, recovered and tried.

    python -m benchmarks.rig.demonstration_sets [--first 710] [--sets 10] [--trials 100] [--jobs 2] [--json FILE]

For each seed the benchmark records the default demonstrations (`haptic-skill record`), trains a skill, and lets it
recover (`haptic-skill recover`), each with its defaults. The skills before and after the recoveries perform the same
trials, those from ``FIRST_TRIAL`` on, in both arms (`Arm`). Neither the sets nor the trials were used for any choice.
Everything is kept in the folder of --out, and an interrupted run goes on there.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np
from rich.table import Table

from benchmarks.command_line import argument_parser, run
from systems.reports.terminal import console, write_json
from systems.runs.trial import Arm
from systems.runs.trial_result import TrialResult
from systems.sessions.record_session import record
from systems.sessions.recovery_session import RecoveryPlan, recover
from systems.sessions.rig_session import run as run_on_rig
from systems.sessions.train_session import train

FIRST_SET, FIRST_TRIAL = 710, 71000
RESAMPLES = 10_000
BEFORE, AFTER = "imitation", "with recoveries"


def skills_of(seed: int, folder: Path, *, jobs: int) -> dict[str, Path]:
    """Records, trains and recovers the skills of a set; returns their files."""
    shown = folder / "demonstrations"
    files = {BEFORE: folder / "skill.npz", AFTER: folder / "recovered.npz"}
    record(out=shown, good=24, bad=6, seed=seed, scenario="nominal", jobs=jobs, overwrite=False)
    if not files[BEFORE].exists():
        train(demonstrations=[shown], out=files[BEFORE], seed=seed)
    if not files[AFTER].exists():
        part = folder / "recovering.npz"
        recover(
            skill=files[BEFORE],
            demonstrations=shown,
            recoveries=folder / "recoveries",
            out=part,
            plan=RecoveryPlan(rounds=2, trials=24, most=10, seed=seed),
            scenario="nominal",
            jobs=jobs,
            overwrite=False,
        )
        part.rename(files[AFTER])  # complete
    return files


def recoveries(folder: Path) -> int:
    """Number of recoveries of a set."""
    return len(list((folder / "recoveries").glob("*/*.parquet")))


def tried(folder: Path, skill: Path, arm: Arm, trials: int, *, jobs: int) -> list[TrialResult]:
    """Performs the trials of a skill in an arm."""
    return run_on_rig(
        skill=skill,
        trials=trials,
        seed=FIRST_TRIAL,
        tilt_deg=None,
        friction=None,
        arm=arm,
        scenario="nominal",
        out=folder / f"{skill.stem}_{arm}",
        json=None,
        jobs=jobs,
        overwrite=False,
    )


def row_of(seed: int, name: str, arm: Arm, recovered: int, results: Sequence[TrialResult]) -> dict[str, Any]:
    """The figures of one skill in one arm; times in s, loads in N."""
    measured = np.array([result.peak_measured_load for result in results], dtype=float)
    true = np.array([result.peak_load for result in results], dtype=float)
    return {
        **{"set": seed, "skill": name, "arm": arm.value, "recoveries": recovered, "trials": len(results)},
        "inserted": sum(result.inserted for result in results),
        "failed": [result.seed for result in results if not result.inserted],
        "trusted": sum(bool(result.trusted) for result in results),
        "median_time_s": float(np.median([result.time for result in results])),
        "median_peak_load_n": float(np.median(true)),
        "measured_max_n": float(measured.max()),
    }


def over_sets(shares: Sequence[float], *, seed: int = 0) -> tuple[float, float, float]:
    """Mean of the shares of the sets, with the 95 % interval of a bootstrap over sets."""
    found = np.asarray(shares, dtype=float)
    means = np.random.default_rng(seed).choice(found, (RESAMPLES, len(found))).mean(axis=1)
    lower, upper = np.quantile(means, [0.025, 0.975])
    return float(found.mean()), float(lower), float(upper)


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each skill and arm, over the sets."""
    found = []
    for name in (BEFORE, AFTER):
        for arm in Arm:
            chosen = [row for row in rows if row["skill"] == name and row["arm"] == arm.value]
            shares = [row["inserted"] / row["trials"] for row in chosen]
            mean, lower, upper = over_sets(shares)
            found.append(
                {
                    **{"skill": name, "arm": arm.value, "sets": len(chosen)},
                    **{"inserted": sum(r["inserted"] for r in chosen), "trials": sum(r["trials"] for r in chosen)},
                    **{"mean": mean, "lower": lower, "upper": upper, "worst": min(shares), "best": max(shares)},
                    "median_time_s": float(np.median([row["median_time_s"] for row in chosen])),
                    "measured_max_n": max(row["measured_max_n"] for row in chosen),
                    "trusted": sum(row["trusted"] for row in chosen),
                }
            )
    return found


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Prints one line for each set, and the summary over the sets."""
    table = Table(title="inserted, by set of demonstrations")
    columns = [(name, arm) for name in (BEFORE, AFTER) for arm in Arm]
    for title in ("set", "recoveries", *(f"{name}\n{arm}" for name, arm in columns), "median\n(s)", "largest\n(N)"):
        table.add_column(title, justify="right", no_wrap=True)
    for seed in sorted({row["set"] for row in rows}):
        of = {(row["skill"], row["arm"]): row for row in rows if row["set"] == seed}
        last = of[AFTER, Arm.DEFAULT.value]
        counts = [f"{of[name, arm.value]['inserted']} of {of[name, arm.value]['trials']}" for name, arm in columns]
        largest = max(row["measured_max_n"] for row in of.values())
        table.add_row(str(seed), str(last["recoveries"]), *counts, f"{last['median_time_s']:.2f}", f"{largest:.1f}")
    console.print(table)
    for row in summary(rows):
        console.print(
            f"{row['skill']}, {row['arm']}: {row['inserted']} of {row['trials']}; mean over {row['sets']} sets"
            f" {100 * row['mean']:.1f} % ({100 * row['lower']:.1f} to {100 * row['upper']:.1f} %), worst set"
            f" {100 * row['worst']:.1f} %; median {row['median_time_s']:.2f} s; largest measured load"
            f" {row['measured_max_n']:.1f} N; physics trusted in {row['trusted']}"
        )


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--first", type=int, default=FIRST_SET, help=f"seed of the first set (default: {FIRST_SET})")
    parser.add_argument("--sets", type=int, default=10, help="number of sets (default: 10)")
    parser.add_argument("--trials", type=int, default=100, help="trials of each skill and arm (default: 100)")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/sets"), metavar="FOLDER", help="kept results")
    arguments = parser.parse_args()
    if not (arguments.first >= 0 and arguments.sets >= 1 and arguments.trials >= 1 and arguments.jobs >= 1):
        raise ValueError("expected --first of at least 0, and --sets, --trials and --jobs of at least 1")
    rows = []
    for seed in range(arguments.first, arguments.first + arguments.sets):
        folder = arguments.out / str(seed)
        for name, skill in skills_of(seed, folder, jobs=arguments.jobs).items():
            for arm in Arm:
                results = tried(folder, skill, arm, arguments.trials, jobs=arguments.jobs)
                rows.append(row_of(seed, name, arm, recoveries(folder), results))
        if arguments.json is not None:
            write_json(arguments.json, {"sets": rows, "summary": summary(rows)})
    show(rows)


if __name__ == "__main__":
    run(main)
