"""Imitation policies of LeRobot and the skill of this project: the same demonstrations, the same trials.

    python -m benchmarks.rig.arena [--demonstrations FOLDER] [--policy act] [--policy diffusion] [--minutes 10]
                                   [--trials 50] [--arm default] [--arm stress] [--json FILE]

All learn from the good demonstrations; the skill discovers its states in the bad ones too.
`benchmarks.rig.lerobot_policy` says what the policies of LeRobot see and do. Both arms (`Arm`) perform trials from
`FIRST_TRIAL` on, which were used for no choice. Columns: insertions with Wilson's 95 % interval; medians of the time of
an insertion, s, and of the largest load of a trial, N; the 90th percentile of that load, N; trials that ended in a jam;
CPU time of training, s; mean and 99th percentile of that of a decision, ms, of which there is one every 20 ms.
Training and decisions use one thread.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks.command_line import Demonstrations, JsonFile, finish, run
from benchmarks.rig.lerobot_policy import train, write_training_set
from experiments.outputs.output_set import find_recordings
from experiments.scoreboard.paired_statistics import wilson
from experiments.trial import Arm, run_trial, trial_scenario
from experiments.trial_result import TrialResult
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, say, write_json
from models.scenario import load_scenario
from skill.data.demonstration import Demonstration, read_demonstration
from skill.data.outcome import Outcome
from skill.features.training_samples import observed_series
from skill.manipulation_skill import ManipulationSkill
from skill.policy import RigPolicy
from skill.states.context_mixture import ContextMixture
from skill.states.estimate import estimates

FIRST_TRIAL = 90000
QUERIES = 600
"""Decisions over which their time is measured."""

SKILL = "CA+LWR"
Peer = Literal["act", "diffusion"]


def trained_skill(demonstrations: Sequence[Demonstration], seed: int) -> tuple[ManipulationSkill, dict[str, Any]]:
    """Learns a skill as `haptic-skill train` does, and returns what it cost."""
    begun, cpu = time.perf_counter(), time.process_time()
    with threadpool_limits(1):
        skill = ManipulationSkill(contexts=ContextMixture(random_state=seed), random_state=seed).fit(demonstrations)
    cost = {"train_s": time.perf_counter() - begun, "train_cpu_s": time.process_time() - cpu}
    return skill, {**cost, "frames": len(skill.sources_)}


def query_times(policy: RigPolicy, demonstrations: Sequence[Demonstration]) -> dict[str, float]:
    """Returns mean and 99th percentile of the CPU time of a decision, ms: features, state, context and action.

    A policy that predicts several actions at once is fast until it has performed them; hence not the median.
    """
    series = np.vstack([observed_series(demonstration.samples) for demonstration in demonstrations])[:QUERIES]
    found, times = estimates(policy.estimator(), series), []
    for row in series:
        begun = time.thread_time()
        policy.act(row[:7], next(found))
        times.append(1e3 * (time.thread_time() - begun))
    return {"query_ms": float(np.mean(times)), "query_p99_ms": float(np.percentile(times, 99))}


def perform(policy: RigPolicy, arm: Arm, numbers: Sequence[int], title: str) -> list[TrialResult]:
    """Performs trials one after the other; a policy that remembers a trial has a method ``begin`` that forgets it."""
    results = []
    scenario = load_scenario()
    begin: Callable[[], None] = getattr(policy, "begin", lambda: None)
    with progress(f"{title}, {arm}", len(numbers)) as advance, threadpool_limits(1):
        for number in numbers:
            begin()
            result, _ = run_trial(trial_scenario(scenario, number=number, arm=arm), policy, seed=number)
            results.append(result)
            advance(result.reason)
    return results


def summary(policy: str, arm: str, results: Sequence[TrialResult], cost: dict[str, Any]) -> dict[str, Any]:
    """Returns a row of the table."""
    inserted = [result for result in results if result.inserted]
    loads = np.array([result.peak_load for result in results], dtype=float)
    return {
        **{"policy": policy, "arm": arm, "trials": len(results), "inserted": len(inserted)},
        "time_s": float(np.median([result.time for result in inserted])) if inserted else None,
        "load_n": float(np.median(loads)),
        "load_p90_n": float(np.percentile(loads, 90)),
        "jammed": sum(result.outcome is Outcome.JAMMED for result in results),
        "reasons": [result.reason for result in results],
        **cost,
    }


def show(rows: Sequence[dict[str, Any]]) -> None:
    """Prints the table."""
    table = plain_table("imitation policies on the rig")
    for name in ("policy", "arm"):
        table.add_column(name)
    for name in ("inserted", "95 %", "time", "load", "p90", "jams", "training", "query", "p99"):
        table.add_column(name, justify="right")
    for row in rows:
        low, high = wilson(row["inserted"], row["trials"])
        table.add_row(
            *(row["policy"], row["arm"], f"{row['inserted']}/{row['trials']}", f"{100 * low:.0f}-{100 * high:.0f} %"),
            *("-" if row["time_s"] is None else f"{row['time_s']:.2f}", f"{row['load_n']:.1f}"),
            *(f"{row['load_p90_n']:.1f}", str(row["jammed"]), f"{row['train_cpu_s']:.0f}"),
            *(f"{row['query_ms']:.2f}", f"{row['query_p99_ms']:.2f}"),
        )
    console.print(table)


def main(
    demonstrations: Demonstrations = [Path("out/demonstrations")],  # noqa: B006
    policy: Annotated[list[Peer], typer.Option(help="Policy of LeRobot; repeatable.")] = ["act", "diffusion"],  # noqa: B006
    minutes: Annotated[float, typer.Option(min=0.0, help="CPU time of training each policy of LeRobot.")] = 10.0,
    trials: Annotated[int, typer.Option(min=1, help="Trials of each arm.")] = 50,
    arm: Annotated[list[Arm], typer.Option(help="Arm of the trials; repeatable.")] = list(Arm),  # noqa: B006
    copies: Annotated[int, typer.Option(min=1, help="Turned copies of each demonstration.")] = 8,
    seed: Annotated[int, typer.Option(help="Seed of the training.")] = 0,
    json: JsonFile = None,
) -> None:
    shown = [read_demonstration(path) for folder in demonstrations for path in find_recordings(folder)[0]]
    good = [demonstration for demonstration in shown if demonstration.good]
    numbers = range(FIRST_TRIAL, FIRST_TRIAL + trials)
    trained: dict[str, tuple[RigPolicy, dict[str, Any]]] = {SKILL: trained_skill(shown, seed)}
    for name in policy:
        say(f"training {name}")
        with tempfile.TemporaryDirectory() as folder:
            write_training_set(good, Path(folder), copies=copies, seed=seed)
            trained[name] = train(name, Path(folder), seconds=60.0 * minutes, seed=seed)
    results: dict[str, Any] = {"demonstrations": len(good), "rows": []}
    with threadpool_limits(1):
        costs = {name: cost | query_times(law, good) for name, (law, cost) in trained.items()}
    for part in arm:
        for title, (law, _) in trained.items():
            results["rows"].append(summary(title, part.value, perform(law, part, numbers, title), costs[title]))
            if json is not None:
                write_json(json, results)
    show(results["rows"])
    finish(results, json)


if __name__ == "__main__":
    run(main)
