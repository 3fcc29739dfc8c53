"""Faults of the hardware, each injected into whole trials: found or not, named or not, how fast, at what load.

    python -m benchmarks.faults [--skill FILE] [--seeds 10] [--jobs 1] [--json FILE]

Every kind of `benchmarks.rig.fault_injection` is injected into trial 21000 + seed. A fault of the installation (sign,
gain, swapped axes) is there from the start; any other begins between 0.1 and 1 s. The thresholds of the monitors follow
from data sheets where these state them, else from trials 20000 to 20020; the trials of this table judge.

fault       what was injected.
found as    the names that the rig gave, most frequent first.
named       trials in which the rig named the fault by one of the names that fit it, of those that the fault began in.
ended well  trials that ended safely: the true load after the onset stayed within 1.2 times the force limit, and in the
            end it is at most ``hold_force`` (the peg was drawn back, is inserted or lies free), or the feed drive is
            at fault and off, so that only the carriage's weight rests on the peg.
notice      median time from the onset to the fault's report.
true        largest true load sqrt(|f|^2 + |m/r|^2) after the onset.

Keys of the JSON file: ``kinds`` (one row each, with its ``trials``), ``named`` and ``safe`` (shares of all trials),
``largest_load_n`` (true).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any
from unittest.mock import patch

import numpy as np
import typer
from pydrake.systems.framework import Context, EventStatus
from rich.table import Table
from threadpoolctl import threadpool_limits

from benchmarks.command_line import JsonFile, SkillFile, finish, run
from benchmarks.rig.fault_injection import KINDS, injected
from experiments.trial import diagram_trial as trial_module
from experiments.trial.diagram_trial import TrialMonitor
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import trial_scenario
from experiments.worker_pool import run_in_processes
from interfaces.terminal import console, progress
from models.scenario import Scenario, load_scenario
from scripts.command_line import Jobs, ScenarioName
from skill.features.measurement import contact_load
from skill.manipulation_skill import ManipulationSkill
from skill.policy import RigPolicy
from systems.steps.faults import FEED_FAULTS

FIRST_TRIAL = 21000
TOLERANCE = 1.2  # factor on the force limit


@dataclass(frozen=True)
class Row:
    """One trial with a fault.

    Attributes:
        kind: name of the kind.
        seed: of the injection.
        began: whether the trial lasted until the fault began.
        fault: name that the rig gave; "" for none.
        reason: how the trial ended.
        named: whether this name fits; for a disturbance that the rig must cope with, whether it named none.
        safe: whether the trial ended safely.
        notice_s: time from the onset to the report, s; None without a report.
        true_load_n: largest true load after the onset, N.
    """

    kind: str
    seed: int
    began: bool
    fault: str
    reason: str
    named: bool
    safe: bool
    notice_s: float | None
    true_load_n: float


def inject(scenario: Scenario, policy: RigPolicy, name: str, seed: int, *, first: int = FIRST_TRIAL) -> Row:
    """Performs trial ``first`` + seed with a fault of the kind ``name``."""
    kind, number = KINDS[name], first + seed
    onset, lever = kind.onset(seed), scenario.geometry.reach
    loads = [0.0]

    class LoadMonitor(TrialMonitor):
        """Also records the true load after the onset."""

        def __call__(self, context: Context) -> EventStatus:
            if context.get_time() >= onset:
                loads.append(contact_load(self._rig.contact_wrench(context), lever))
            return super().__call__(context)

    with (
        injected(kind, onset=onset, seed=seed),
        patch.object(trial_module, "TrialMonitor", LoadMonitor),
        threadpool_limits(1),
    ):
        result, recorded = run_trial(trial_scenario(scenario, number=number), policy, seed=number)
    samples = recorded.samples
    reported = samples["time"][(samples["time"] >= onset) & (samples["fault"] != 0)]
    guard = scenario.controller.guard
    return Row(
        kind=name,
        seed=seed,
        began=len(loads) > 1,
        fault=result.fault.name if result.fault else "",
        reason=result.reason,
        named=result.fault in kind.named if kind.named else not result.fault,
        safe=max(loads) <= TOLERANCE * guard.force_limit
        and (loads[-1] <= guard.hold_force or result.fault in FEED_FAULTS),
        notice_s=float(reported.iloc[0] - onset) if len(reported) else None,
        true_load_n=max(loads),
    )


def summary(rows: Iterable[Row]) -> dict[str, Any]:
    """Returns the contents of the JSON file; a trial that ended before its fault began does not count."""
    began = [row for row in rows if row.began]
    kinds = [_kind_summary(name, [row for row in began if row.kind == name]) for name in KINDS]
    return {
        "kinds": [kind for kind in kinds if kind["n"]],
        "named": float(np.mean([row.named for row in began])) if began else None,
        "safe": float(np.mean([row.safe for row in began])) if began else None,
        "largest_load_n": max((row.true_load_n for row in began), default=None),
    }


def _kind_summary(name: str, rows: list[Row]) -> dict[str, Any]:
    notices = [row.notice_s for row in rows if row.notice_s is not None]
    return {
        "kind": name,
        "n": len(rows),
        "found_as": dict(Counter(row.fault or row.reason.split(":")[0] for row in rows).most_common()),
        "named": sum(row.named for row in rows),
        "safe": sum(row.safe for row in rows),
        "notice_s": float(np.median(notices)) if notices else None,
        "true_load_n": max((row.true_load_n for row in rows), default=0.0),
        "trials": [vars(row) for row in rows],
    }


def show(result: dict[str, Any]) -> None:
    """Prints the table."""
    table = Table(title="faults of the rig", show_lines=False)
    for column in ("fault", "found as", "named", "ended well", "notice", "true"):
        table.add_column(column, justify="left" if column in ("fault", "found as") else "right")
    for kind in result["kinds"]:
        notice = "" if kind["notice_s"] is None else f"{kind['notice_s']:.2f} s"
        found = ", ".join(f"{name.lower().replace('_', ' ')} {n}" for name, n in kind["found_as"].items())
        n = kind["n"]
        table.add_row(
            kind["kind"], found, f"{kind['named']}/{n}", f"{kind['safe']}/{n}", notice, f"{kind['true_load_n']:.0f} N"
        )
    console.print(table)
    console.print(
        f"named {result['named']:.1%}, ended well {result['safe']:.1%}, largest load {result['largest_load_n']:.0f} N"
    )


def main(
    skill: SkillFile = Path("out/skill.npz"),
    scenario: ScenarioName = "nominal",
    seeds: Annotated[int, typer.Option(min=1, help="Trials of each kind.")] = 10,
    jobs: Jobs = 1,
    json: JsonFile = None,
) -> None:
    policy, unresolved = ManipulationSkill.load(skill), load_scenario(scenario)
    tasks = [partial(inject, unresolved, policy, name, seed) for name in KINDS for seed in range(seeds)]
    rows = []
    with progress("faults of the rig", len(tasks)) as advance:
        for row in run_in_processes(tasks, jobs=jobs):
            rows.append(row)
            advance(row.kind)
    result = summary(rows)
    show(result)
    finish(result, json)


if __name__ == "__main__":
    run(main)
