"""The command line, the demonstrations and the table of a comparison on the rig.

Results are stored in a folder whose name is a digest of what determines them: scenario, demonstrations and versions.
The digest does not depend on the code of this project: remove the folder after a change.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.command_line import argument_parser
from benchmarks.recording import record_demonstrations
from benchmarks.rig.trials import FIRST_TRIAL, Entry, Record, Setting, perform
from models.scenario import Scenario, dump_scenario
from skill.data.demonstration import read_demonstrations, write_demonstration
from systems.reports.terminal import progress, write_json
from systems.runs.demonstration_set import requests
from systems.runs.provenance import versions
from systems.runs.trial import Arm
from systems.runs.trial_result import PHYSICS
from systems.scoreboard.paired_statistics import mcnemar, over_sets, wilson

PRODUCT = "CA states, contexts + LWR"
"""The name of the entry with which the others are compared."""

STATELESS, CONTEXTLESS, CONTEXTS_ALONE = "LWR without states", "CA states + LWR", "contexts + LWR"
"""The entries without contacts and contexts, without contexts, and without contacts."""

FIRST_SET = 746  # seed of the first set that is recorded if none is given
GOOD, BAD = 24, 6  # numbers of demonstrations in each


def command_line(description: str | None) -> argparse.ArgumentParser:
    """The options of every comparison on the rig."""
    out = Path("out/benchmarks/rig")
    parser = argument_parser(description)
    parser.add_argument("--demonstrations", type=Path, metavar="FOLDER", nargs="+", help="recorded sets")
    parser.add_argument("--sets", type=int, default=4, help="sets to record without --demonstrations (default: 4)")
    parser.add_argument("--trials", type=int, default=20, help="trials of each policy (default: 20)")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes (default: 1)")
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="only policies with this part of a name; repeat"
    )
    parser.add_argument(
        "--arm", type=Arm, choices=list(Arm), default=Arm.DEFAULT, help="which trials (default: default)"
    )
    parser.add_argument("--scenario", default="nominal", help="name or YAML file of a scenario (default: nominal)")
    parser.add_argument("--out", type=Path, default=out, metavar="FOLDER", help=f"stored results (default: {out})")
    return parser


def selected(entries: Sequence[Entry], only: Sequence[str] | None) -> list[Entry]:
    """The entries whose name contains one of the given parts; all if ``only`` is None.

    Raises:
        ValueError: if there is no such entry.
    """
    chosen = [entry for entry in entries if only is None or any(part.lower() in entry.name.lower() for part in only)]
    if not chosen:
        raise ValueError(f"--only {only} matches none of the policies {[entry.name for entry in entries]}")
    return chosen


def prepared(
    scenario: Scenario,
    given: Sequence[Path] | None,
    out: Path,
    *,
    sets: int,
    arm: Arm = Arm.DEFAULT,
    **numbers: int,
) -> Setting:
    """The setting of a comparison.

    Args:
        scenario: unresolved.
        given: folders of demonstrations; None to record them.
        out: folder below which results and recorded demonstrations are stored.
        sets: number of sets to record if none is given.
        arm: which trials are performed.
        **numbers: ``trials``, ``jobs`` and ``candidates`` of the setting.

    Raises:
        ValueError: if ``sets`` is less than 1, or a folder holds no valid demonstrations.
    """
    if sets < 1:
        raise ValueError(f"--sets {sets}; expected at least 1")
    folders = recorded(scenario, out, sets=sets, jobs=numbers["jobs"]) if given is None else list(given)
    digest = hashlib.sha256((dump_scenario(scenario) + json.dumps(versions())).encode())
    for folder in folders:
        paths = sorted(folder.glob("*.parquet"))
        digest.update(f"{len(paths)} demonstrations".encode())
        for path in paths:
            digest.update(path.read_bytes())
    results = out / f"{digest.hexdigest()[:12]}{'' if arm is Arm.DEFAULT else f'_{arm}'}"
    print(f"sets of demonstrations: {', '.join(str(folder) for folder in folders)}; results in {results}")
    return Setting(scenario, [read_demonstrations(folder) for folder in folders], results, **numbers, arm=arm)


def recording_folders(scenario: Scenario, out: Path, sets: int) -> list[Path]:
    """The folders in which `recorded` stores sets of demonstrations of this scenario."""
    digest = hashlib.sha256(dump_scenario(scenario).encode()).hexdigest()[:12]
    return [out / f"demonstrations_{digest}_{seed}" for seed in range(FIRST_SET, FIRST_SET + sets)]


def recorded(scenario: Scenario, out: Path, *, sets: int, jobs: int) -> list[Path]:
    """Records the demonstrations of this scenario that are not stored yet, and returns the folders of the sets."""
    folders = recording_folders(scenario, out, sets)
    for seed, folder in enumerate(folders, start=FIRST_SET):
        names = {request: folder / f"{request.number:03d}_{request.habit}.parquet" for request in requests(GOOD, BAD)}
        missing = [request for request, path in names.items() if not path.exists()]
        if missing:
            for request, demonstration in record_demonstrations(scenario, missing, seed=seed, jobs=jobs):
                write_demonstration(demonstration, names[request])
    return folders


def shares_of_sets(rows: Sequence[dict[str, Any]], setting: Setting) -> list[float]:
    """The share of insertions of each set of demonstrations whose trials were performed."""
    inserted: dict[int, list[bool]] = {}
    for row in rows:
        inserted.setdefault(setting.set_of(row["seed"]), []).append(row["inserted"])
    return [float(np.mean(found)) for found in inserted.values()]


def summary(entry: Entry, record: Record, setting: Setting) -> dict[str, Any]:
    """One row of the table. The median time is that of the insertions; the forces are those of all trials."""
    rows = [record.trials[str(n)] for n in setting.numbers if str(n) in record.trials]
    inserted = [r for r in rows if r["inserted"]]
    load, contact = ([r[key] for r in rows if r.get(key) is not None] for key in ("peak_load_n", "peak_contact_n"))
    shares = shares_of_sets(rows, setting) if entry.learns and len(setting.sets) > 1 else []
    ends = Counter(r["reason"].split(":")[0] for r in rows if not r["inserted"])

    def mean(name: str) -> float | None:
        values = list(record.content[name].values())
        return float(np.mean(values)) if values else None

    return {
        "name": entry.name,
        "trials": len(rows),
        "inserted": len(inserted),
        "interval": list(wilson(len(inserted), len(rows))) if rows else None,
        "interval_over_sets": list(over_sets(shares)[1:]) if shares else None,
        "worst_set": min(shares) if shares else None,
        "median_time_s": float(np.median([r["time_s"] for r in inserted])) if inserted else None,
        "median_load_n": float(np.median(load)) if load else None,
        "p95_load_n": float(np.percentile(load, 95)) if load else None,
        "max_load_n": float(np.max(load)) if load else None,
        "median_contact_n": float(np.median(contact)) if contact else None,
        "not_trusted": sum(r.get("physics") == PHYSICS[False] for r in rows),
        "train_s": mean("train_s"),
        "query_ms": mean("query_ms"),
        "states": mean("states"),
        "tuning_trials": len(record.tuning),
        "tuned": record.content.get("tuned"),
        "ends": dict(ends),
        "error": record.content["error"],
        "cpu_s_per_trial": float(np.mean([r["cpu_s"] for r in rows])) if rows else None,
    }


def compare(title: str, entries: Sequence[Entry], setting: Setting, json_file: Path | None) -> list[dict[str, Any]]:
    """Performs all entries, prints the table, and writes the table and all trials to ``json_file``."""
    total = sum(setting.trials + entry.tuning for entry in entries)
    summaries, trials = [], {}
    with progress(title, total) as advance:
        for entry in entries:
            record = perform(entry, setting, advance)
            summaries.append(summary(entry, record, setting))
            trials[entry.name] = [record.trials[str(n)] for n in setting.numbers if str(n) in record.trials]
    for row in summaries:
        compared = PRODUCT in trials and row["name"] != PRODUCT and row["trials"]
        row["p"] = mcnemar(trials[row["name"]], trials[PRODUCT]) if compared else None
    print(report(title, summaries))
    if json_file is not None:
        head = {
            "demonstrations": [len(shown) for shown in setting.sets],
            "first_trial": FIRST_TRIAL,
            "versions": versions(),
        }
        head["arm"] = setting.arm.value
        scenario = dump_scenario(setting.scenario)
        write_json(json_file, {**head, "scenario": scenario, "summary": summaries, "trials": trials})
    return summaries


def report(title: str, summaries: Sequence[dict[str, Any]]) -> str:
    """The table, one row per policy."""
    head = (
        f"{title:30} inserted   95 %      sets  worst       p  time s   load N: median   95th    max  contact N"
        "  untrusted   states  train s  query ms  otherwise"
    )
    lines = [head]
    for r in summaries:
        low, high = r["interval"] or (0.0, 1.0)
        over, worst = _range(r["interval_over_sets"]), _percent(r["worst_set"])
        found = [r["error"], *(f"{count} {reason}" for reason, count in r["ends"].items())]
        ends = ", ".join(text for text in found if text)
        lines.append(
            f"{r['name']:30} {r['inserted']:4}/{r['trials']:<3} {100 * low:3.0f}-{100 * high:<3.0f} {over} {worst:>6}"
            f" {_text(r['p'], '.2g'):>7} {_text(r['median_time_s'], '.2f'):>7} {_text(r['median_load_n'], '.1f'):>16}"
            f" {_text(r['p95_load_n'], '.1f'):>6} {_text(r['max_load_n'], '.1f'):>6}"
            f" {_text(r['median_contact_n'], '.1f'):>10} {r['not_trusted']:>10}"
            f" {_text(r['states'], '.3g'):>8} {_text(r['train_s'], '.1f'):>8} {_text(r['query_ms'], '.2f'):>9}"
            f"  {ends}"
        )
    lines.append(
        "time: median of the insertions; load: largest load in each trial, failures included; contact: median of the"
        " largest normal force of a single contact; untrusted: trials whose physics is not trusted;"
    )
    lines.append("train: time on one core, including the trials for tuning")
    return "\n".join(lines)


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f}"


def _range(interval: Sequence[float] | None) -> str:
    return f"{'-':>9}" if interval is None else f"{100 * interval[0]:5.0f}-{100 * interval[1]:<3.0f}"


def _text(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
