"""How good the skill is with anybody's demonstrations: fresh sets, each recorded, trained, recovered and tried.

    python -m benchmarks.rig.demonstration_sets [--sets 10] [--trials 100] [--only NAME] [--arm NAME] [--jobs 2]
                                                [--json FILE]

For each seed, from --first on, the benchmark records the default demonstrations (`haptic-skill record`) and makes
skills from them, each with its defaults: without contexts, with contexts, and with the recoveries that the latter asks
for (`haptic-skill recover`). With --only it makes others as well: a skill that plans (`train --policy plan`), and each
without contact states. All perform the same trials, from --first-trial on, in both arms (`Arm`) or that of --arm.
Everything is kept in the folder of --out, and an interrupted run goes on there.

All sets perform the same trials, and all trials are performed by the same sets. The p-values of the difference between
two skills therefore come from two tests (`sign_flip_test`): one takes the trials as the units, the other the sets. They
are given for the insertions, and for the time, in which a failure counts as the whole time of a trial.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np

from benchmarks.command_line import argument_parser, run
from models.scenario import load_scenario
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import read_demonstrations
from skill.manipulation_skill import ManipulationSkill
from skill.states.context_mixture import MAX_CONTEXTS, ContextMixture
from systems.reports.result_tables import plain_table
from systems.reports.terminal import console, write_json
from systems.runs.trial import Arm
from systems.runs.trial_result import TrialResult
from systems.scoreboard.paired_statistics import over_sets, sign_flip_test
from systems.sessions.record_session import record
from systems.sessions.recovery_session import RecoveryPlan, recover
from systems.sessions.rig_session import run as run_on_rig
from systems.sessions.train_session import train

FIRST_SET, FIRST_TRIAL = 756, 83000
"""Sets and trials that were used for no choice."""

SCENARIO = "nominal"
TIME_LIMIT = load_scenario(SCENARIO).trial.time_limit
ALONE, BEFORE, AFTER = "without contexts", "with contexts", "with contexts and recoveries"
BARE, PLANNED, PLANNED_BARE = "without contact states", "planned", "planned without contact states"
SKILLS = (ALONE, BEFORE, AFTER)
TITLES = {
    **{ALONE: "alone", BEFORE: "context", AFTER: "recov."},
    **{BARE: "1 state", PLANNED: "plan", PLANNED_BARE: "plan,\n1 state"},
}
"""All skills, and their titles in a table."""

PAIRS = ((ALONE, BEFORE), (BEFORE, AFTER), (BEFORE, PLANNED), (BARE, BEFORE), (PLANNED_BARE, PLANNED))
FILES = {
    **{ALONE: "alone.npz", BEFORE: "skill.npz", AFTER: "recovered.npz"},
    **{BARE: "bare.npz", PLANNED: "planned.npz", PLANNED_BARE: "planned_bare.npz"},
}
DEMONSTRATIONS = "demonstrations"


def skill_of(name: str, seed: int, folder: Path, *, jobs: int) -> Path:
    """Makes a skill from the demonstrations in a folder, unless it is there; returns its file."""
    shown, file = folder / DEMONSTRATIONS, folder / FILES[name]
    if file.exists():
        return file
    policy = "plan" if name in (PLANNED, PLANNED_BARE) else "imitate"
    if name == AFTER:
        part = folder / "recovering.npz"
        recover_in(folder, skill_of(BEFORE, seed, folder, jobs=jobs), part, most=10, seed=seed, jobs=jobs)
        part.rename(file)  # complete
    elif name in (BARE, PLANNED_BARE):
        states, contexts = CompetitiveAgglomeration(m_init=1), ContextMixture(random_state=seed)
        skill = ManipulationSkill(states=states, contexts=contexts, policy=policy, random_state=seed)
        skill.fit(read_demonstrations(shown)).save(file)
    else:
        number = 1 if name == ALONE else MAX_CONTEXTS
        train(demonstrations=[shown], out=file, seed=seed, max_contexts=number, policy=policy)
    return file


def recover_in(folder: Path, skill: Path, out: Path, *, most: int, seed: int, jobs: int) -> None:
    """Lets a skill recover as `haptic-skill recover` does, from the demonstrations in a folder."""
    recover(
        skill=skill,
        demonstrations=folder / DEMONSTRATIONS,
        recoveries=folder / "recoveries",
        out=out,
        plan=RecoveryPlan(rounds=2, trials=24, most=most, seed=seed),
        scenario=SCENARIO,
        jobs=jobs,
        overwrite=False,
    )


def recoveries(folder: Path) -> int:
    """Number of recoveries of a set."""
    return len(list((folder / "recoveries").glob("*/*.parquet")))


def tried(folder: Path, skill: Path, arm: Arm, first: int, trials: int, *, jobs: int) -> list[TrialResult]:
    """Performs the trials of a skill in an arm."""
    return run_on_rig(
        skill=skill,
        trials=trials,
        seed=first,
        tilt_deg=None,
        friction=None,
        arm=arm,
        scenario=SCENARIO,
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
        "first_trial": min(result.seed for result in results),
        "times_s": [r.time if r.inserted else TIME_LIMIT for r in sorted(results, key=lambda result: result.seed)],
        "back_offs": sum(result.back_offs for result in results),
        "trusted": sum(bool(result.trusted) for result in results),
        "median_time_s": float(np.median([result.time for result in results])),
        "median_peak_load_n": float(np.median(true)),
        "measured_max_n": float(measured.max()),
    }


def names(rows: Sequence[dict[str, Any]]) -> list[str]:
    """The skills that have rows."""
    return [name for name in TITLES if any(row["skill"] == name for row in rows)]


def arms(rows: Sequence[dict[str, Any]]) -> list[Arm]:
    """The arms that have rows."""
    return [arm for arm in Arm if any(row["arm"] == arm.value for row in rows)]


def insertions(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Insertions in several sets: their number, and the shares over the sets with the 95 % interval of `over_sets`."""
    shares = [row["inserted"] / row["trials"] for row in rows]
    mean, lower, upper = over_sets(shares)
    return {
        **{"inserted": sum(row["inserted"] for row in rows), "trials": sum(row["trials"] for row in rows)},
        **{"mean": mean, "lower": lower, "upper": upper, "worst": min(shares), "best": max(shares)},
    }


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each skill and arm, over the sets."""
    found = []
    for name in names(rows):
        for arm in arms(rows):
            chosen = [row for row in rows if row["skill"] == name and row["arm"] == arm.value]
            found.append(
                {
                    **{"skill": name, "arm": arm.value, "sets": len(chosen)},
                    **insertions(chosen),
                    "median_time_s": float(np.median([row["median_time_s"] for row in chosen])),
                    "measured_max_n": max(row["measured_max_n"] for row in chosen),
                    "back_offs": sum(row["back_offs"] for row in chosen),
                    "trusted": sum(row["trusted"] for row in chosen),
                }
            )
    return found


def comparison(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The differences of two skills in each arm, over the same demonstrations and trials."""
    found = []
    pairs = [pair for pair in PAIRS if set(pair) <= set(names(rows))]
    for (one, other), arm in itertools.product(pairs, arms(rows)):
        of = {(row["set"], row["skill"]): row for row in rows if row["arm"] == arm.value}
        sets = sorted({number for number, _ in of})
        trials = range(of[sets[0], one]["trials"])
        first = of[sets[0], one]["first_trial"]
        gain = np.array(
            [
                [
                    int(first + n in of[number, one]["failed"]) - int(first + n in of[number, other]["failed"])
                    for n in trials
                ]
                for number in sets
            ]
        )
        saved = np.array([np.subtract(of[number, one]["times_s"], of[number, other]["times_s"]) for number in sets])
        found.append(
            {
                **{"skill": other, "against": one, "arm": arm.value},
                **{"better": int((gain > 0).sum()), "worse": int((gain < 0).sum())},
                **{"p_trials": sign_flip_test(gain.sum(axis=0)), "p_sets": sign_flip_test(gain.sum(axis=1))},
                "saved_s": float(saved.mean()),
                **{
                    "p_time_trials": sign_flip_test(saved.sum(axis=0)),
                    "p_time_sets": sign_flip_test(saved.sum(axis=1)),
                },
            }
        )
    return found


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Prints one line for each set, and the summary over the sets."""
    trials = max(row["trials"] for row in rows)
    table = plain_table(f"inserted of {trials} trials, by set of demonstrations")
    shown = names(rows)
    columns = [(name, arm) for name in shown for arm in arms(rows)]
    stacked = (f"{TITLES[name]}\n{arm.value}" for name, arm in columns)
    for title in ("set", "recov-\neries", *stacked, "time\n(s)", "load\n(N)"):
        table.add_column(title, justify="right", vertical="bottom", no_wrap=True)
    for seed in sorted({row["set"] for row in rows}):
        of = {(row["skill"], row["arm"]): row for row in rows if row["set"] == seed}
        last = of[shown[-1], arms(rows)[0].value]
        counts = [str(of[name, arm.value]["inserted"]) for name, arm in columns]
        largest = max(row["measured_max_n"] for row in of.values())
        table.add_row(str(seed), str(last["recoveries"]), *counts, f"{last['median_time_s']:.2f}", f"{largest:.1f}")
    console.print(table)
    for row in summary(rows):
        console.print(
            f"{row['skill']}, {row['arm']}: {row['inserted']} of {row['trials']}; mean over {row['sets']} sets"
            f" {100 * row['mean']:.1f} % ({100 * row['lower']:.1f} to {100 * row['upper']:.1f} %), worst set"
            f" {100 * row['worst']:.1f} %; median {row['median_time_s']:.2f} s; largest measured load"
            f" {row['measured_max_n']:.1f} N; {row['back_offs']} back-offs; physics trusted in {row['trusted']}"
        )
    for pair in comparison(rows):
        console.print(
            f"{pair['skill']} against {pair['against']}, {pair['arm']}: {pair['better']} trials better,"
            f" {pair['worse']} worse; p = {pair['p_trials']:.2g} over trials, {pair['p_sets']:.2g} over sets;"
            f" {pair['saved_s']:.2f} s faster; p = {pair['p_time_trials']:.2g}, {pair['p_time_sets']:.2g}"
        )


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--first", type=int, default=FIRST_SET, help=f"seed of the first set (default: {FIRST_SET})")
    parser.add_argument("--sets", type=int, default=10, help="number of sets (default: 10)")
    parser.add_argument(
        "--first-trial", type=int, default=FIRST_TRIAL, help=f"number of the first trial (default: {FIRST_TRIAL})"
    )
    parser.add_argument("--only", action="append", choices=TITLES, help="only skills of this name; repeat")
    parser.add_argument("--arm", type=Arm, choices=list(Arm), help="only this arm (default: both)")
    parser.add_argument("--trials", type=int, default=100, help="trials of each skill and arm (default: 100)")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/sets"), metavar="FOLDER", help="kept results")
    arguments = parser.parse_args()
    counts = arguments.sets, arguments.trials, arguments.jobs
    if min(arguments.first, arguments.first_trial) < 0 or min(counts) < 1:
        raise ValueError("expected --first and --first-trial of at least 0; --sets, --trials and --jobs of at least 1")
    rows = []
    for seed in range(arguments.first, arguments.first + arguments.sets):
        folder, jobs = arguments.out / str(seed), arguments.jobs
        shown = folder / DEMONSTRATIONS
        record(out=shown, good=24, bad=6, seed=seed, scenario=SCENARIO, jobs=jobs, overwrite=False)
        for name in arguments.only or SKILLS:
            skill = skill_of(name, seed, folder, jobs=jobs)
            for arm in Arm if arguments.arm is None else [arguments.arm]:
                results = tried(folder, skill, arm, arguments.first_trial, arguments.trials, jobs=jobs)
                rows.append(row_of(seed, name, arm, recoveries(folder), results))
        if arguments.json is not None:
            write_json(arguments.json, {"sets": rows, "summary": summary(rows), "pairs": comparison(rows)})
    show(rows)


if __name__ == "__main__":
    run(main)
