"""Trials a minute of the compiled loop, beside the diagram that it reproduces, on the same trials.

    python -m benchmarks.throughput [--trials N] [--compared N] [--against CHECKOUT] [--json FILE]

The shipped skill performs usual and harder trials in the exact engine: ``--trials`` of them by the compiled loop, on
one process and on two, and the first ``--compared`` by the diagram too. Compilation and imports do not count; the
result of each trial does.

*trials a minute and core*: by CPU time. *times the diagram*: by CPU time, of the trials that both performed.
*Python*: CPU time of the diagram, less that of the loop, a simulated second. *equal*: trials with the same outcome, and
with the same samples bit for bit. *two cores*: trials a minute of two processes over those of one, by the clock.
*ratio to commit*: trials a minute over those of another checkout, such as one of an older commit, which has its own
``.venv``; both run this benchmark in turn, and the median counts.
"""

from __future__ import annotations

import json as json_file
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from benchmarks.command_line import JsonFile, finish, run
from experiments.trial.diagram_trial import run_rig
from experiments.trial.ended_trial import EndedTrial
from experiments.trial.loop_trial import rolled_out
from experiments.trial.trial_set import TrialSet, trial_scenario
from experiments.worker_pool import run_in_processes
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console
from models.scenario import Scenario
from scripts.command_line import SHIPPED
from skill.manipulation_skill import ManipulationSkill
from systems.rig import MakeRig

FIRST = 95000
"""Number of the first trial."""

ROUNDS = 3
"""How often two checkouts are compared."""


def scenario_of(number: int) -> Scenario:
    """Returns the resolved scenario of a trial, in turn a usual and a harder one."""
    scenario = Scenario()
    scenario.contact.engine = "exact"
    return trial_scenario(scenario, number=number, trial_set=list(TrialSet)[number % 2])


def loop(skill: ManipulationSkill, numbers: list[int]) -> Iterator[tuple[EndedTrial, float]]:
    """Performs trials by the compiled loop; yields them with their CPU times, s."""
    rolled_out(scenario_of(FIRST), skill, number=FIRST)  # compiles
    for number in numbers:
        begun = time.process_time()
        ended = rolled_out(scenario_of(number), skill, number=number)
        assert ended is not None
        _ = ended.result
        yield ended, time.process_time() - begun


def diagram(skill: ManipulationSkill, number: int) -> tuple[EndedTrial, float]:
    """Performs a trial by the diagram; returns it with its CPU time without the building, s."""
    scenario = scenario_of(number)
    rig = MakeRig(scenario, skill)
    begun = time.process_time()
    ended = run_rig(rig, scenario, seed=number)
    _ = ended.result
    return ended, time.process_time() - begun


def _batch(skill: ManipulationSkill, numbers: list[int]) -> float:
    """Performs trials in a process of its own and returns how many it performs a minute, by the clock."""
    list(loop(skill, numbers[:1]))
    begun = time.monotonic()
    for _ in loop(skill, numbers):
        pass
    return 60.0 * (1 + len(numbers)) / (time.monotonic() - begun)


def clock_rate(skill: ManipulationSkill, numbers: list[int], *, jobs: int) -> float:
    """Returns trials a minute by the clock, from some processes at the same time, each of which performs all."""
    tasks = [partial(_batch, skill, numbers)] * jobs
    return sum(run_in_processes(tasks, jobs=2))  # 1 would be this process


def rate_of(checkout: Path, trials: int) -> float:
    """Returns trials a minute and core of a checkout, by its own benchmark."""
    python = str(checkout.resolve() / ".venv/bin/python")
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder, "found.json")
        options = f"-m benchmarks.throughput --compared 2 --trials {trials} --json".split()
        subprocess.run([python, *options, str(found)], cwd=checkout, check=True, stdout=subprocess.DEVNULL)
        return float(json_file.loads(found.read_text())["trials_per_minute_core"])


def main(
    trials: Annotated[int, typer.Option(min=4, help="Number of trials of the compiled loop.")] = 1000,
    compared: Annotated[int, typer.Option(min=2, help="Number of trials of the diagram.")] = 100,
    against: Annotated[Path | None, typer.Option(metavar="CHECKOUT", help="Another checkout to compare with.")] = None,
    json: JsonFile = None,
) -> None:
    skill = ManipulationSkill.load(SHIPPED)
    numbers = [FIRST + k for k in range(trials)]
    fast: list[tuple[EndedTrial, float]] = []
    cpu, inserted = 0.0, 0
    for ended, spent in loop(skill, numbers):
        cpu, inserted = cpu + spent, inserted + ended.result.inserted
        if len(fast) < compared:
            fast.append((ended, spent))
    slow = [diagram(skill, number) for number in numbers[:compared]]
    pairs = list(zip(fast, slow, strict=False))
    rate = 60.0 * trials / cpu
    looped, beside = (sum(pair[k][1] for pair in pairs) for k in range(2))
    simulated = sum(ended.time for (ended, _), _ in pairs)
    outcomes = sum(a.result.outcome is b.result.outcome for (a, _), (b, _) in pairs) / len(pairs)
    bits = sum(a.samples.equals(b.samples) for (a, _), (b, _) in pairs) / len(pairs)
    by_clock = [clock_rate(skill, numbers[: max(4, trials // 4)], jobs=jobs) for jobs in (1, 2)]
    found = {
        "trials_per_minute_core": rate,
        "ratio_to_diagram": beside / looped,
        "python_s_per_simulated_s": (beside - looped) / simulated,
        "outcomes_equal": outcomes,
        "samples_equal": bits,
        "inserted": inserted / trials,
        "two_core_ratio": by_clock[1] / by_clock[0],
    }
    if against is not None:
        own = Path(__file__).parent.parent
        found["ratio_to_commit"] = statistics.median(
            rate_of(own, compared) / rate_of(against, compared) for _ in range(ROUNDS)
        )
    table = plain_table(f"{trials:,} trials by the compiled loop, {len(pairs):,} of them by the diagram")
    for title in ("", "value"):
        table.add_column(title, justify="right" if title else "left")
    for name, value in found.items():
        table.add_row(name.replace("_", " "), f"{value:.3f}")
    console.print(table)
    finish(found, json)


if __name__ == "__main__":
    run(main)
