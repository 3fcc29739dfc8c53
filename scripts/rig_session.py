"""Runs trials of a skill on the rig into a folder, and goes on with them after an interruption."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from experiments.outputs.output_checks import (
    RECORDING_SIZE,
    REPORT_SIZE,
    check_file,
    check_folder,
    named_errors,
    require_distinct,
)
from experiments.outputs.output_set import OutputSet, open_set
from experiments.outputs.set_index import RUNS, SetIndex
from experiments.provenance import versions
from experiments.trial import Arm, run_trials, trial_scenario
from experiments.trial_result import TrialResult
from interfaces.reports.batch_page import batch_report, worst_trial
from interfaces.reports.replay_page import write_replay
from interfaces.reports.result_tables import result_table
from interfaces.terminal import console, progress, say, write_json
from models.scenario import Scenario, dump_scenario, load_scenario, validate_scenario
from skill.data.rig_run import read_rig_run, write_rig_run
from skill.data.tables import write_atomically
from skill.manipulation_skill import ManipulationSkill

RESULTS, REPORT = "results.json", "report.html"


def run(
    *,
    skill: Path,
    trials: int,
    seed: int,
    tilt_deg: float | None,
    friction: float | None,
    arm: Arm,
    scenario: str,
    out: Path,
    json: Path | None,
    jobs: int,
    overwrite: bool,
) -> list[TrialResult]:
    """Runs trials ``seed`` to ``seed + trials - 1`` and returns their results.

    Writes each run and all results as they are finished, then a report, into the folder ``out``; a copy of the results
    into the file ``json``, unless it is None. Trials that an interrupted call with the same skill, scenario and numbers
    has finished are kept and not repeated. ``tilt_deg`` and ``friction`` replace values of the scenario unless they are
    None.

    Raises:
        ValueError: if the skill file, the scenario or a value that replaces one of it is not valid, or the folder holds
            what may not be replaced (see `open_set`).
        OSError: if another process writes into the folder, or a file cannot be written. What is finished stays.
    """
    learnt = ManipulationSkill.load(skill)
    chosen = changed_scenario(scenario, tilt_deg=tilt_deg, friction=friction)
    numbers = range(seed, seed + trials)
    trial_scenario(chosen, number=seed, arm=arm)
    index = rig_index(chosen, trials=trials, seed=seed, skill=skill.read_bytes(), arm=arm)
    check_folder(out, size=trials * RECORDING_SIZE + REPORT_SIZE)
    if json is not None:
        require_distinct({"--skill": skill, "--json": json})
        require_distinct({name: out / name for name in index.names - {RESULTS}} | {"--json": json})
        if json.resolve() != (out / RESULTS).resolve():
            check_file(json, ".json", option="--json")
    with open_set(out, index, overwrite=overwrite) as files:
        results = _run_missing(files, chosen, learnt, numbers, arm, jobs)
        files.complete()
        rows = [result.record() for result in results]
        if json is not None and json.resolve() != (out / RESULTS).resolve():
            with named_errors(json, f"the results are in {out / RESULTS}"):
                write_json(json, rows)
        write_report(results, out, skill=str(skill), scenario=chosen, kept=files.kept())
        console.print(result_table(results))
        say(f"report in {out / REPORT}")
    return results


def changed_scenario(scenario: str, *, tilt_deg: float | None, friction: float | None) -> Scenario:
    """Loads a scenario and replaces values of it: the largest starting tilt (degrees) and the friction coefficient.

    Raises:
        ValueError: if the scenario or a value is not valid.
    """
    chosen = load_scenario(scenario)
    if tilt_deg is not None:
        chosen.start.tilt_range = math.radians(tilt_deg)
    if friction is not None:
        chosen.contact.friction, chosen.contact.friction_spread = friction, 0.0
    validate_scenario(chosen, "command line")
    return chosen


def rig_index(scenario: Scenario, *, trials: int, seed: int, skill: bytes, arm: Arm = Arm.DEFAULT) -> SetIndex:
    """Returns the index of the trials of a skill, given as the content of its file."""
    numbers = range(seed, seed + trials)
    request = {
        **{"trials": trials, "seed": seed, "scenario": dump_scenario(scenario), "versions": versions()},
        "skill": hashlib.sha256(skill).hexdigest(),
    }
    if arm is not Arm.DEFAULT:  # an index of an earlier version has no arm, and its set can be continued
        request["arm"] = arm.value
    reports = (REPORT, *(replay_name(n) for n in numbers))
    return SetIndex(RUNS, request, (*(run_name(n) for n in numbers), RESULTS), reports)


def run_name(number: int) -> str:
    """The name of the file of a trial."""
    return f"run_{number:04d}.parquet"


def replay_name(number: int) -> str:
    """The name of the replay of a trial."""
    return f"replay_{number:04d}.html"


def _run_missing(
    files: OutputSet, scenario: Scenario, skill: ManipulationSkill, numbers: range, arm: Arm, jobs: int
) -> list[TrialResult]:
    """Runs the trials that are not there yet; `RESULTS` agrees with the run files after each."""
    done: dict[int, TrialResult] = {n: files.finished[run_name(n)] for n in numbers if run_name(n) in files.finished}

    def write_results() -> None:
        files.write(RESULTS, lambda path: write_json(path, [done[n].record() for n in sorted(done)]))

    if files.damaged:
        say(f"cannot be read and are run again: {', '.join(files.damaged)}")
    if done:
        say(f"{len(done)} of {len(numbers)} trials are there already")
        write_results()
    missing = [n for n in numbers if n not in done]
    with progress("rig trials", len(missing)) as advance:
        for result, record in run_trials(scenario, skill, missing, jobs=jobs, arm=arm):
            files.write(run_name(result.seed), partial(write_rig_run, record))
            done[result.seed] = result
            write_results()
            advance(f"trial {result.seed}: {result.reason}, {result.time:.1f} s")
    return [done[n] for n in numbers]


def write_report(results: Sequence[TrialResult], out: Path, *, skill: str, scenario: Scenario, kept: str) -> None:
    """Writes the report beside the runs in ``out``, and the replay of the worst trial to which it links.

    Raises:
        OSError: if one cannot be written. The message names it, and says with ``kept`` what is on disk.
    """
    worst = worst_trial(results)
    run_file, replay = out / run_name(worst.seed), replay_name(worst.seed)
    with named_errors(out / replay, kept):
        write_replay(run_file, out / replay, title=f"trial {worst.seed}")
    page = batch_report(
        results,
        title=f"{len(results)} insertions on the rig",
        state_names=read_rig_run(run_file).metadata["state_names"],
        replays={worst.seed: replay},
        made_by={"skill": skill, **versions()},
        scenario=dump_scenario(scenario),
    )
    with named_errors(out / REPORT, kept):
        write_atomically(out / REPORT, page.encode())
