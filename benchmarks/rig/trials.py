"""What the comparisons on the rig share: demonstrations, trials that are stored as they end, and the table.

Every policy performs the same trials, from ``FIRST_TRIAL`` on, of the stream that no demonstration draws from; what
is tuned by hand is tuned on trials from ``FIRST_TUNING`` on. One JSON file a policy is rewritten after each trial, in
a folder named after what decides the result (scenario, demonstrations, versions), so that an interrupted run goes on
where it was; after a change of the code, remove the folder.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from scipy.stats import binomtest
from threadpoolctl import threadpool_limits

from models.scenario import Scenario, dump_scenario
from skill.data.demonstration import Demonstration, read_demonstrations, write_demonstration
from skill.features.wrench_features import MEASURED
from systems.control.policy import RigPolicy
from systems.reports.terminal import console, progress, write_json
from systems.runs.demonstration_set import demonstrate_all, requests
from systems.runs.provenance import versions
from systems.runs.trial import run_trial, trial_scenario

FIRST_TRIAL, FIRST_TUNING = 7000, 9000
GOOD, BAD = 24, 6  # of the demonstrations that are recorded where none are given
QUERIES = 300

Advance = Callable[[str], None]


@dataclass(frozen=True)
class Setting:
    """What all policies of a comparison share.

    Attributes:
        scenario: with ranges.
        demonstrations: in the order of their names, good ones first if they were recorded here.
        folder: of the results, named after what decides them.
        trials: of each policy.
        jobs: processes.
        candidates: of each tuning.
    """

    scenario: Scenario
    demonstrations: list[Demonstration]
    folder: Path
    trials: int
    jobs: int
    candidates: int = 24

    @property
    def numbers(self) -> list[int]:
        """Of the trials."""
        if not 1 <= self.trials <= FIRST_TUNING - FIRST_TRIAL:
            raise ValueError(f"{self.trials} trials; expected 1 to {FIRST_TUNING - FIRST_TRIAL}, short of the tuning's")
        return list(range(FIRST_TRIAL, FIRST_TRIAL + self.trials))


class Record:
    """The results of one policy, in a file that is rewritten, whole, after each of them."""

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        empty = {"name": name, "trials": {}, "tuning": {}, "train_s": {}, "query_ms": {}, "states": {}, "error": None}
        self.content: dict[str, Any] = json.loads(path.read_text()) if path.exists() else empty

    @property
    def trials(self) -> dict[str, dict[str, Any]]:
        """Rows by their number."""
        return self.content["trials"]

    @property
    def tuning(self) -> dict[str, dict[str, Any]]:
        """Rows by candidate and number."""
        return self.content["tuning"]

    def add_trial(self, row: dict[str, Any]) -> None:
        """And write."""
        self.trials[str(row["seed"])] = row
        self.save()

    def add_tuning(self, key: str, row: dict[str, Any]) -> None:
        """And write."""
        self.tuning[key] = {k: row[k] for k in ("inserted", "reason", "time_s", "peak_lateral_n", "cpu_s")}
        self.save()

    def save(self) -> None:
        """Whole or not at all."""
        write_json(self._path, self.content)


Train = Callable[[Setting, Record, Advance, int], RigPolicy]


@dataclass(frozen=True)
class Arm:
    """One policy of a comparison.

    Attributes:
        name: in the table.
        train: makes the policy of a draw; may say through the record and `Advance` what it tries.
        draws: how many are made, of different demonstrations; trial n is performed by draw n modulo this.
        tuning: how many trials the training makes.
    """

    name: str
    train: Train
    draws: int = 1
    tuning: int = 0

    @property
    def file(self) -> str:
        """A name for its record; another tuning is another policy."""
        name = re.sub(r"[^a-z0-9]+", "_", self.name.lower()).strip("_")
        return f"{name}_{self.tuning}.json" if self.tuning else f"{name}.json"


def command_line(description: str | None) -> argparse.ArgumentParser:
    """The options of every comparison on the rig."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--demonstrations", type=Path, help="folder of recorded ones; recorded anew without it")
    parser.add_argument("--trials", type=int, default=20, help="of each policy")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--only", action="append", metavar="NAME", help="part of a policy's name; may be repeated")
    parser.add_argument("--scenario", default="nominal", help="name or YAML file")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/rig"), help="where results are kept")
    parser.add_argument("--json", type=Path, help="also write the table and all trials to this file")
    return parser


def prepared(scenario: Scenario, given: Path | None, out: Path, **numbers: int) -> Setting:
    """The setting of a comparison, whose results are below ``out``."""
    folder = given if given is not None else recorded(scenario, out, jobs=numbers["jobs"])
    shown = read_demonstrations(folder)
    digest = hashlib.sha256((dump_scenario(scenario) + json.dumps(versions())).encode())
    for path in sorted(folder.glob("*.parquet")):
        digest.update(path.read_bytes())
    results = out / digest.hexdigest()[:12]
    console.print(f"{len(shown)} demonstrations of {folder}; results in {results}", soft_wrap=True, highlight=False)
    return Setting(scenario, shown, results, **numbers)


def recording_folder(scenario: Scenario, out: Path) -> Path:
    """Where `recorded` keeps the demonstrations of this scenario."""
    return out / f"demonstrations_{hashlib.sha256(dump_scenario(scenario).encode()).hexdigest()[:12]}"


def recorded(scenario: Scenario, out: Path, *, jobs: int) -> Path:
    """A folder of demonstrations in this scenario: those that are not there yet are recorded."""
    folder = recording_folder(scenario, out)
    names = {request: folder / f"{request.number:03d}_{request.habit}.parquet" for request in requests(GOOD, BAD)}
    wanted = [request for request, path in names.items() if not path.exists()]
    if wanted:
        with progress(f"demonstrations, {scenario.fixture} fixture", len(wanted)) as advance:
            for request, demonstration in demonstrate_all(scenario, wanted, seed=0, jobs=jobs):
                write_demonstration(demonstration, names[request])
                advance(f"{request.habit}: {demonstration.reason}")
    return folder


def attempt(scenario: Scenario, policy: RigPolicy, number: int) -> dict[str, Any]:
    """One trial as a row; an exception is a row too."""
    start = time.process_time()
    try:
        with threadpool_limits(1):
            row = run_trial(trial_scenario(scenario, number=number), policy, seed=number)[0].record()
    except Exception as error:  # a comparison goes on whatever one policy does
        row = {"seed": number, "inserted": False, "reason": f"failed: {type(error).__name__}: {error}"[:200]}
        row |= {"time_s": None, "peak_lateral_n": None}
    row.pop("states", None)  # a search has hundreds
    return row | {"cpu_s": round(time.process_time() - start, 2)}


def attempts(setting: Setting, policy: RigPolicy, numbers: list[int]) -> Iterator[dict[str, Any]]:
    """Yields the rows in their order, as the trials end."""
    if numbers:
        work = (delayed(attempt)(setting.scenario, policy, number) for number in numbers)
        yield from Parallel(n_jobs=setting.jobs, return_as="generator")(work)


def query_time(policy: RigPolicy, demonstrations: Sequence[Demonstration]) -> float:
    """Median time of one decision, features, state and action, over measurements of the demonstrations, ms."""
    rows = np.vstack([d.samples[list(MEASURED)].to_numpy() for d in demonstrations])
    rows = rows[np.linspace(0, len(rows) - 1, QUERIES).astype(int)]
    follower = policy.state_filter()
    belief = follower.initial_log_belief()
    spent = []
    for row in rows:
        start = time.perf_counter()
        estimate = follower.step(belief, policy.measured_features(row))
        policy.act(row, estimate.probabilities)
        spent.append(time.perf_counter() - start)
        belief = estimate.log_belief
    return 1e3 * float(np.median(spent))


def perform(arm: Arm, setting: Setting, advance: Advance) -> Record:
    """Trains the arm's policies and performs the trials that are not stored yet."""
    record = Record(setting.folder / arm.file, arm.name)
    missing = [n for n in setting.numbers if str(n) not in record.trials]
    for _ in range(setting.trials - len(missing) + (0 if missing else arm.tuning)):
        advance(f"{arm.name}: stored already")
    record.content["error"] = None
    for draw in range(arm.draws):
        numbers = [n for n in missing if n % arm.draws == draw]
        if not numbers:
            continue
        try:
            start = time.process_time()
            with threadpool_limits(1):
                policy = arm.train(setting, record, advance, draw)
                trained = time.process_time() - start
                record.content["query_ms"][str(draw)] = query_time(policy, setting.demonstrations)
        except Exception as error:  # a comparison goes on whatever one policy does
            record.content["error"] = f"draw {draw} not trained: {type(error).__name__}: {error}"[:300]
            record.save()
            for _ in numbers:
                advance(f"{arm.name}: {record.content['error']}")
            continue
        # Time spent on trials, perhaps in an earlier run, is kept with them.
        record.content["train_s"][str(draw)] = sum(r["cpu_s"] for r in record.tuning.values()) or trained
        record.content["states"][str(draw)] = policy.n_states
        for row in attempts(setting, policy, numbers):
            record.add_trial(row)
            advance(f"{arm.name}, trial {row['seed']}: {row['reason']}")
    return record


def wilson(successes: int, n: int) -> tuple[float, float]:
    """95 % interval of a probability, after Wilson, Journal of the American Statistical Association 22, 1927."""
    interval = binomtest(successes, n).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def summary(arm: Arm, record: Record, setting: Setting) -> dict[str, Any]:
    """One row of the table. Times are those of the trials that inserted; forces and reasons those of all."""
    rows = [record.trials[str(n)] for n in setting.numbers if str(n) in record.trials]
    inserted = [r for r in rows if r["inserted"]]
    force = [r["peak_lateral_n"] for r in rows if r["peak_lateral_n"] is not None]
    ends = Counter(r["reason"].split(":")[0] for r in rows if not r["inserted"])

    def mean(name: str) -> float | None:
        values = list(record.content[name].values())
        return float(np.mean(values)) if values else None

    return {
        "name": arm.name,
        "trials": len(rows),
        "inserted": len(inserted),
        "interval": list(wilson(len(inserted), len(rows))) if rows else None,
        "median_time_s": float(np.median([r["time_s"] for r in inserted])) if inserted else None,
        "median_lateral_n": float(np.median(force)) if force else None,
        "p95_lateral_n": float(np.percentile(force, 95)) if force else None,
        "max_lateral_n": float(np.max(force)) if force else None,
        "train_s": mean("train_s"),
        "query_ms": mean("query_ms"),
        "states": mean("states"),
        "tuning_trials": len(record.tuning),
        "tuned": record.content.get("tuned"),
        "ends": dict(ends),
        "error": record.content["error"],
        "cpu_s_per_trial": float(np.mean([r["cpu_s"] for r in rows])) if rows else None,
    }


def compare(title: str, arms: Sequence[Arm], setting: Setting, json_file: Path | None) -> list[dict[str, Any]]:
    """Performs all arms, prints the table and writes it with the rows of all trials."""
    total = sum(setting.trials + arm.tuning for arm in arms)
    summaries, trials = [], {}
    with progress(title, total) as advance:
        for arm in arms:
            record = perform(arm, setting, advance)
            summaries.append(summary(arm, record, setting))
            trials[arm.name] = list(record.trials.values())
    print(report(title, summaries))
    if json_file is not None:
        head = {"demonstrations": len(setting.demonstrations), "first_trial": FIRST_TRIAL, "versions": versions()}
        scenario = dump_scenario(setting.scenario)
        write_json(json_file, {**head, "scenario": scenario, "summary": summaries, "trials": trials})
    return summaries


def report(title: str, summaries: Sequence[dict[str, Any]]) -> str:
    """The table: a row a policy."""
    head = (
        f"{title:30} inserted   95 %   time s   across N: median   95th    max   states  train s  query ms  otherwise"
    )
    lines = [head]
    for r in summaries:
        low, high = r["interval"] or (0.0, 1.0)
        ends = ", ".join(f"{count} {reason}" for reason, count in r["ends"].items())
        lines.append(
            f"{r['name']:30} {r['inserted']:4}/{r['trials']:<3} {100 * low:3.0f}-{100 * high:<3.0f}"
            f" {_shown(r['median_time_s'], '.2f'):>7} {_shown(r['median_lateral_n'], '.1f'):>18}"
            f" {_shown(r['p95_lateral_n'], '.1f'):>6} {_shown(r['max_lateral_n'], '.1f'):>6}"
            f" {_shown(r['states'], '.3g'):>8} {_shown(r['train_s'], '.1f'):>8} {_shown(r['query_ms'], '.2f'):>9}"
            f"  {r['error'] or ends}"
        )
    lines.append("time: median of the insertions; force across the peg: the largest of each trial, failures included;")
    lines.append("to train: seconds of one core, those of the trials included where it was tuned on the rig")
    return "\n".join(lines)


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
