"""The trials of a comparison on the rig, whose results are stored.

Every policy performs the same trials, from ``FIRST_TRIAL`` on; their random stream is not that of the demonstrations.
Parameters are tuned on other trials, from ``FIRST_TUNING`` on. Each policy has one JSON file, which is rewritten after
each trial, so that an interrupted run can continue.
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from models.scenario import Scenario
from skill.data.demonstration import Demonstration
from skill.policy import RigPolicy
from systems.reports.terminal import write_json
from systems.runs.trial import Arm, run_trial, trial_scenario
from systems.runs.worker_pool import run_in_processes
from systems.sweeps.policies import query_time

FIRST_TRIAL, FIRST_TUNING = 78000, 80000

Advance = Callable[[str], None]
"""Advances the progress bar by one and shows a note."""

Row = dict[str, Any]
"""The result of a trial (`TrialResult.record`) with its CPU time."""


@dataclass(frozen=True)
class Setting:
    """The conditions that all policies of a comparison share.

    Attributes:
        scenario: unresolved, with its ranges.
        sets: of demonstrations, each in the order of its file names. A policy that learns is trained on each of them,
            and trial n is performed by the one of set n modulo their number: the sets share the trials.
        folder: of the stored results.
        trials: number of trials of each policy.
        jobs: number of processes.
        candidates: number of parameter sets in each tuning.
        arm: which trials of the scenario are performed, for tuning too.
    """

    scenario: Scenario
    sets: list[list[Demonstration]]
    folder: Path
    trials: int
    jobs: int
    candidates: int = 24
    arm: Arm = Arm.DEFAULT

    def set_of(self, number: int) -> int:
        """The number of the set whose skill performs a trial."""
        return number % len(self.sets)

    @property
    def numbers(self) -> list[int]:
        """The numbers of the trials."""
        if not 1 <= self.trials <= FIRST_TUNING - FIRST_TRIAL:
            limit = FIRST_TUNING - FIRST_TRIAL
            raise ValueError(f"{self.trials} trials; expected 1 to {limit}: later ones are for tuning")
        return list(range(FIRST_TRIAL, FIRST_TRIAL + self.trials))


class Record:
    """The results of one policy, in a JSON file that is rewritten atomically after each trial.

    Args:
        path: of the file; read if it exists.
        name: of the policy.

    Attributes:
        content: what the file holds.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        self.content: dict[str, Any] = {"name": name, "trials": {}, "tuning": {}}
        self.content |= {"train_s": {}, "query_ms": {}, "states": {}, "error": None}
        if path.exists():
            self.content = json.loads(path.read_text())

    @property
    def trials(self) -> dict[str, Row]:
        """Results of the trials by their number."""
        rows: dict[str, Row] = self.content["trials"]
        return rows

    @property
    def tuning(self) -> dict[str, Row]:
        """Results of the tuning by ``candidate:number``."""
        rows: dict[str, Row] = self.content["tuning"]
        return rows

    def add_trial(self, row: Row) -> None:
        """Adds the result of a trial and writes the file."""
        self.trials[str(row["seed"])] = row
        self.save()

    def add_tuning(self, key: str, row: Row) -> None:
        """Adds the result of a tuning trial and writes the file."""
        self.tuning[key] = {k: row[k] for k in ("inserted", "reason", "time_s", "peak_load_n", "cpu_s")}
        self.save()

    def save(self) -> None:
        """Writes the file atomically."""
        write_json(self._path, self.content)


Train = Callable[[Setting, Record, Advance, int], RigPolicy]
"""Trains a policy on the set of this number; stores tuning trials in the record and calls `Advance` after each."""


@dataclass(frozen=True)
class Entry:
    """One policy of a comparison.

    Attributes:
        name: in the table.
        train: trains the policy.
        learns: whether it learns from demonstrations; if not, there is one policy for all sets.
        tuning: number of trials that the training performs.
    """

    name: str
    train: Train
    learns: bool = True
    tuning: int = 0

    @property
    def file(self) -> str:
        """The file name of its record; it contains the number of tuning trials."""
        name = re.sub(r"[^a-z0-9]+", "_", self.name.lower()).strip("_")
        return f"{name}_{self.tuning}.json" if self.tuning else f"{name}.json"


def attempt(scenario: Scenario, arm: Arm, policy: RigPolicy, number: int) -> Row:
    """Performs a trial and returns its result; an exception is a failed trial."""
    start = time.process_time()
    try:
        with threadpool_limits(1):
            row = run_trial(trial_scenario(scenario, number=number, arm=arm), policy, seed=number)[0].record()
    except Exception as error:  # the other policies of the comparison go on
        row = {"seed": number, "inserted": False, "reason": f"failed: {type(error).__name__}: {error}"[:200]}
        row |= {"time_s": None, "peak_load_n": None}
    row.pop("states", None)  # a search visits hundreds of phases
    return row | {"cpu_s": round(time.process_time() - start, 2)}


def attempts(setting: Setting, policy: RigPolicy, numbers: list[int]) -> Iterator[Row]:
    """Performs the trials and yields their results in order, as they end."""
    tasks = (partial(attempt, setting.scenario, setting.arm, policy, number) for number in numbers)
    yield from run_in_processes(tasks, jobs=setting.jobs)


def perform(entry: Entry, setting: Setting, advance: Advance) -> Record:
    """Trains the policies of an entry and performs the trials that are not stored yet."""
    record = Record(setting.folder / entry.file, entry.name)
    missing = [n for n in setting.numbers if str(n) not in record.trials]
    for _ in range(setting.trials - len(missing) + (0 if missing else entry.tuning)):
        advance(f"{entry.name}: stored already")
    record.content["error"] = None
    for number, demonstrations in enumerate(setting.sets if entry.learns else setting.sets[:1]):
        numbers = [n for n in missing if not entry.learns or setting.set_of(n) == number]
        if not numbers:
            continue
        try:
            start = time.process_time()
            with threadpool_limits(1):
                policy = entry.train(setting, record, advance, number)
                trained = time.process_time() - start
                record.content["query_ms"][str(number)] = query_time(policy, demonstrations)
        except Exception as error:  # the other policies of the comparison go on
            failure = f"set {number} not trained: {type(error).__name__}: {error}"[:300]
            record.content["error"] = "; ".join(filter(None, (record.content["error"], failure)))
            record.save()
            for _ in numbers:
                advance(f"{entry.name}: {failure}")
            continue
        # The time of tuning trials, perhaps of an earlier run, is stored with them.
        record.content["train_s"][str(number)] = sum(r["cpu_s"] for r in record.tuning.values()) or trained
        record.content["states"][str(number)] = policy.n_states
        for row in attempts(setting, policy, numbers):
            record.add_trial(row)
            advance(f"{entry.name}, trial {row['seed']}: {row['reason']}")
    return record
